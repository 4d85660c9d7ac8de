//! Settings chosen from the data: memory, quantity, hidden nodes, method and epochs by cross-validation that respects time and
//! groups, within a budget of work.
//!
//! Candidates are the training mean, ridge regression, kernel ridge regression and networks, also networks on what ridge
//! regression leaves. All are judged by their held-out answers in the same folds, a network at the lowest point of its error over
//! epochs, which is also when its training will stop. The answer is the convex combination of the fits, the three best networks
//! and one on what ridge regression leaves, for each target by non-negative least squares on the held-out answers (stacking:
//! Breiman 1996, doi:10.1007/BF00117832); in the folds it is never worse than one of them. The best network is trained in any
//! case.
//!
//! A memory is tried only on readings with times, or on request, and is taken only if it is clearly better in paired
//! comparisons: on samples in an order that the targets follow, such as a scan, it learns that order. Channels that are
//! [nearly dead](dead_channels) are to be left out before, and targets that nothing determines take no part in the choice.
//!
//! The budget counts estimated multiplications, never seconds of a clock, so that the same samples and seed give the same
//! choice on every machine. Test samples take no part.

mod channels;
mod features;
mod fits;
mod folded_training;
mod judge;
mod networks;
mod search;
#[cfg(test)]
mod tests;

use std::fmt;

use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::{Initialization, RunSettings};
use crate::{
    dataset::{Dataset, History, Memory, Span, SplitBy},
    decoupling::Combined,
    network::{InputChoice, Quantity, ScalingChoice},
    problem::Channel,
    text::{counted, format_below_one},
    training::Method,
};
pub use channels::dead_channels;
pub use search::choose_settings;
pub(crate) use search::{Fits, compare_fits};

/// Time on one core that a choice and the training may take if nothing else is given, in seconds.
pub const DEFAULT_BUDGET_S: f64 = 60.0;

/// Multiplications that count as one second of one core: about those of a training of small networks on an ordinary
/// machine.
const MULTIPLICATIONS_PER_SECOND: f64 = 8e9;

/// Samples that a choice is made for: the training samples alone.
#[derive(Clone, Copy, Debug)]
pub struct AutoSamples<'a> {
    /// Readings without memory, and targets.
    pub set: &'a Dataset,
    /// Everything that the sensor has read, and the index of each sample among the samples of this history; without it, no
    /// memory is tried.
    pub past: Option<(&'a History, &'a [usize])>,
    /// Rule by which folds are made: blocks of time, whole groups, or single samples.
    pub by: SplitBy,
}

/// Settings given by the user, which are not searched.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AutoFixed {
    /// Number of hidden nodes.
    pub hidden: Option<usize>,
    /// Training method.
    pub method: Option<Method>,
    /// Number of epochs.
    pub epochs: Option<usize>,
    /// Number of starts.
    pub starts: Option<usize>,
    /// Scaling of the inputs.
    pub scaling: Option<ScalingChoice>,
    /// Features; the readings alone if empty.
    pub memory: Option<Memory>,
    /// `true` if memories are to be tried even without times.
    pub tries_memory: bool,
}

/// Progress of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct AutoProgress {
    /// Description of the candidate that is being tried, its number, and the smallest error so far.
    pub text: String,
    /// Share of the budget used so far.
    pub share: f64,
}

/// Result of a search.
#[derive(Clone, Debug)]
pub struct AutoChoice {
    /// Settings of the network: inputs, hidden nodes, method, epochs and starts.
    pub settings: RunSettings,
    /// Memory from which the features are made.
    pub memory: Memory,
    /// The best combination with the network.
    pub combined: Combined,
    /// Everything that was tried.
    pub record: AutoRecord,
    /// Held-out answers of the combination to all samples (samples × targets).
    pub answers: Array2<f64>,
}

/// Everything that a search tried.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AutoRecord {
    /// Budget in seconds of one core.
    pub budget_s: f64,
    /// Number of folds.
    pub folds: usize,
    /// Rule by which the folds were made.
    pub by: SplitBy,
    /// Candidates in the order in which they were tried.
    pub tried: Vec<Tried>,
    /// Index of the network to be trained in `tried`.
    pub chosen: usize,
    /// Error of the combination, as [`Tried::error`]; `None` in files of version 0.1.0, whose choice is the network alone.
    pub combined: Option<f64>,
    /// Estimated time of the training on one core in seconds, which counts against the budget.
    pub training_s: f64,
    /// Names of the channels that are left out.
    pub left_out: Vec<String>,
    /// Indices of the targets that nothing determines, which took no part in the choice.
    pub undetermined: Vec<usize>,
    /// Targets that a memory predicts and the readings of the moment do not: the index of each, and R² without and with
    /// memory.
    pub leaks: Vec<(usize, [f64; 2])>,
}

/// A candidate and its cross-validated error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tried {
    /// Memory from which the features are made.
    #[serde(default, skip_serializing_if = "Memory::is_empty")]
    pub memory: Memory,
    /// Quantity and scaling of the features.
    pub inputs: InputChoice,
    /// Model on the features.
    pub model: TriedModel,
    /// Root mean square error of held-out answers, relative to the standard deviation of each target and averaged over the
    /// targets that count: 1 for always answering the mean.
    pub error: f64,
    /// Standard error of `error`, from the differences between folds.
    pub standard_error: f64,
    /// Estimated time on one core in seconds, which counts against the budget.
    pub seconds: f64,
    /// Mean weight in the combination over the targets that count.
    #[serde(default)]
    pub share: f64,
    /// `true` if the budget ended its training before the error had passed its lowest point.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_cut_off: bool,
}

/// Model that was tried.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TriedModel {
    /// The mean of the training samples.
    Mean,
    /// Ridge regression.
    Ridge,
    /// Kernel ridge regression with Gaussians.
    Kernel {
        /// `true` if a linear kernel is added.
        is_linear: bool,
    },
    /// Mean of several networks.
    Network {
        /// Number of hidden nodes of each.
        hidden: usize,
        /// Training method.
        method: Method,
        /// Number of networks.
        starts: usize,
        /// Epochs after which the error was lowest.
        epochs: usize,
        /// Weights with which the trainings begin.
        #[serde(default, skip_serializing_if = "super::settings::is_default")]
        begin: Initialization,
        /// `true` if they learn what ridge regression leaves.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        is_on_residual: bool,
    },
}

impl Tried {
    /// Describes the features: `readings`, `averages 2s, 10s`.
    pub fn features(&self) -> String {
        let mut parts = vec![match self.inputs.quantity {
            Quantity::Raw | Quantity::Resistance => "readings".to_owned(),
            Quantity::Conductance => "1/readings".to_owned(),
            Quantity::LogResistance => "log readings".to_owned(),
        }];
        let mut list = |name: &str, spans: &[Span]| {
            let spans = Vec::from_iter(spans.iter().map(|span| format!("{span:#}")));
            parts.extend((!spans.is_empty()).then(|| format!("{name} {}", spans.join(", "))));
        };
        list("lags", &self.memory.lags);
        list("averages", &self.memory.averages);
        parts.extend(self.memory.differences.then(|| "as differences".to_owned()));
        parts.extend((self.inputs.scaling == ScalingChoice::Whitening).then(|| "whitened".to_owned()));
        parts.join(", ")
    }
}

impl fmt::Display for TriedModel {
    /// Writes `ridge`, or `average of 2 networks with 8 hidden nodes, Bayesian regularisation`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mean => f.write_str("mean"),
            Self::Ridge => f.write_str("ridge"),
            Self::Kernel { is_linear: true } => f.write_str("kernel ridge, Gaussian + linear"),
            Self::Kernel { is_linear: false } => f.write_str("kernel ridge, Gaussian"),
            Self::Network {
                hidden,
                method,
                starts,
                is_on_residual,
                ..
            } => {
                let of = if *starts > 1 { "average of " } else { "" };
                let (networks, nodes) = (counted(*starts, "network"), counted(*hidden, "hidden node"));
                write!(f, "{of}{networks} with {nodes}, {}", method.name())?;
                // Candidates that differ in nothing else.
                if let Method::ScaledConjugateGradient(settings) = method
                    && settings.decay > 0.0
                {
                    write!(f, ", decay {:.2}", settings.decay)?;
                }
                f.write_str(if *is_on_residual { ", added to ridge" } else { "" })
            }
        }
    }
}

impl AutoRecord {
    /// Returns the network that was chosen to be trained.
    pub fn choice(&self) -> Option<&Tried> {
        self.tried.get(self.chosen)
    }

    /// Estimated time of the search on one core in seconds.
    pub fn seconds(&self) -> f64 {
        self.tried.iter().map(|tried| tried.seconds).sum()
    }

    /// Remarks on what was found: channels that are left out, targets that are not determined or may leak.
    pub fn remarks(&self, targets: &[Channel]) -> Vec<String> {
        let mut remarks = Vec::new();
        let name = |index: &usize| targets.get(*index).map_or("a target", |target| &target.name).to_owned();
        if !self.left_out.is_empty() {
            remarks.push(format!(
                "left out as nearly dead (few different values, or nearly always the same): {}; give the settings of the \
                 training to keep them",
                self.left_out.join(", ")
            ));
        }
        if !self.undetermined.is_empty() {
            let names = Vec::from_iter(self.undetermined.iter().map(name));
            remarks.push(format!(
                "nothing that was tried explains {} in cross-validation: the choice of settings leaves it out",
                names.join(", ")
            ));
        }
        remarks.extend(self.leaks(targets));
        remarks
    }

    /// Remarks on the targets that may leak.
    pub fn leaks(&self, targets: &[Channel]) -> impl Iterator<Item = String> {
        self.leaks.iter().map(|(target, [now, past])| {
            format!(
                "possible leak: the history of readings predicts {} (R² {}), but the readings of the moment do not (R² {}). \
                 Either the order of recording gives it away, which does not help in use, or the sensor responds to changes \
                 only; use the history if it is the latter",
                targets.get(*target).map_or("a target", |target| &target.name),
                format_below_one(*past, 2),
                format_below_one(*now, 2)
            )
        })
    }
}
