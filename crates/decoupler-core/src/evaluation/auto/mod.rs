//! Settings chosen from the data: features, hidden nodes, method, epochs and committee by cross-validation that respects
//! time and groups, within a budget of work.
//!
//! The search goes from cheap to dear. Ridge regression screens the features (quantity, memory); small networks try the
//! best of them; then hidden nodes, then scaling, method and regularisation are varied; last, the best few are
//! cross-validated again as the committees that would be trained. Every network is judged by the lowest point of its error
//! over epochs, which is also when its training will stop. That error is the mean over folds plus its standard error, so
//! that a choice is steady from fold to fold. Among networks with the features of the best, the smallest wins that is not
//! worse by more than the standard error of the difference (Breiman et al. 1984).
//!
//! The budget counts estimated multiplications, never seconds of a clock, so that the same samples and seed give the same
//! choice on every machine. Test samples take no part.

mod fold_errors;
mod folded_training;
mod search;
mod spans;
#[cfg(test)]
mod tests;

use std::fmt;

use ndarray::{Array2, Axis};
use serde::{Deserialize, Serialize};

use super::{Initialization, RunSettings};
use crate::{
    dataset::{Dataset, Folds, History, Memory, Span, SplitBy},
    network::{InputChoice, Quantity, ScalingChoice},
    text::format_percent,
    training::Method,
};
use fold_errors::FoldErrors;
pub use search::choose_settings;

/// Time on one core that a search may take if nothing else is given, in seconds.
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

impl AutoSamples<'_> {
    /// Returns the samples with the features of `memory` as readings; `None` if it is not possible for them.
    fn with_memory(&self, memory: &Memory) -> Option<Dataset> {
        if memory.is_empty() {
            return Some(self.set.clone());
        }
        let (history, samples) = self.past?;
        let features = history.features(memory).ok()?;
        Some(self.set.with_readings(features.select(Axis(0), samples)))
    }
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
    /// Settings of the run: inputs, hidden nodes, method, epochs and committee.
    pub settings: RunSettings,
    /// Memory from which the features are made.
    pub memory: Memory,
    /// Everything that was tried.
    pub record: AutoRecord,
    /// Folds of the cross-validation.
    pub folds: Folds,
    /// Held-out answers of the choice to all samples (samples × targets), each by a committee trained without its fold.
    pub answers: Array2<f64>,
}

/// Everything that a search tried.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AutoRecord {
    /// Budget in seconds of one core.
    pub budget_s: f64,
    /// Number of folds.
    pub folds: usize,
    /// Rule by which the folds were made.
    pub by: SplitBy,
    /// Candidates in the order in which they were tried.
    pub tried: Vec<Tried>,
    /// Index of the choice in `tried`.
    pub chosen: usize,
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
    /// Root mean square error of held-out answers, relative to the standard deviation of each target and averaged over
    /// targets: 1 for always answering the mean.
    pub error: f64,
    /// Standard error of `error`, from the differences between folds.
    pub standard_error: f64,
    /// Estimated time on one core in seconds, which counts against the budget.
    pub seconds: f64,
}

/// Model that was tried.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TriedModel {
    /// Ridge regression.
    Ridge,
    /// Committee of networks.
    Network {
        /// Number of hidden nodes of each.
        hidden: usize,
        /// Training method.
        method: Method,
        /// Number of networks in the committee.
        starts: usize,
        /// Epochs after which the error was lowest.
        epochs: usize,
        /// Weights with which the trainings begin.
        #[serde(default, skip_serializing_if = "Initialization::is_random")]
        begin: Initialization,
    },
}

impl Tried {
    /// Describes the features: `readings`, `averages 2s, 10s`.
    pub fn features(&self) -> String {
        describe_features(&self.memory, self.inputs)
    }

    /// Weights with which the training of a network begins, and its number of epochs; `None` for ridge regression.
    pub fn training(&self) -> Option<(Initialization, usize)> {
        match self.model {
            TriedModel::Ridge => None,
            TriedModel::Network { begin, epochs, .. } => Some((begin, epochs)),
        }
    }
}

impl fmt::Display for TriedModel {
    /// Writes `ridge`, or `5 × 8 hidden nodes, br`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self::Network {
            hidden, method, starts, ..
        } = self
        else {
            return f.write_str("ridge");
        };
        write!(f, "{starts} × {hidden} hidden nodes, {}", method.short_name())?;
        match method {
            Method::BayesianRegularization(settings) if settings.correlation_epoch > 0.0 => {
                f.write_str(", errors correlated")
            }
            _ => Ok(()),
        }
    }
}

impl AutoRecord {
    /// Returns the candidate that was chosen.
    pub fn choice(&self) -> Option<&Tried> {
        self.tried.get(self.chosen)
    }

    /// Estimated time of the search on one core in seconds.
    pub fn seconds(&self) -> f64 {
        self.tried.iter().map(|tried| tried.seconds).sum()
    }

    /// Remarks that no network was better than ridge regression; `None` if the choice was.
    pub fn remark(&self) -> Option<String> {
        let ridges = self.tried.iter().filter(|tried| tried.model == TriedModel::Ridge);
        let best = ridges.min_by(|one, other| one.error.total_cmp(&other.error));
        let (choice, ridge) = (self.choice()?, best?);
        (choice.error >= ridge.error).then(|| {
            format!(
                "in cross-validation, no network that was tried is better than ridge regression: error {} of the spread of \
                 the targets, ridge ({}) {}",
                format_percent(100.0 * choice.error),
                ridge.features(),
                format_percent(100.0 * ridge.error)
            )
        })
    }
}

fn describe_features(memory: &Memory, inputs: InputChoice) -> String {
    let mut parts = vec![match inputs.quantity {
        Quantity::Raw | Quantity::Resistance => "readings".to_owned(),
        Quantity::Conductance => "1/readings".to_owned(),
        Quantity::LogResistance => "log readings".to_owned(),
    }];
    let spans = |spans: &[Span]| spans.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    if !memory.lags.is_empty() {
        parts.push(format!("lags {}", spans(&memory.lags)));
    }
    if !memory.averages.is_empty() {
        parts.push(format!("averages {}", spans(&memory.averages)));
    }
    if memory.differences {
        parts.push("as differences".to_owned());
    }
    if inputs.scaling == ScalingChoice::Whitening {
        parts.push("whitened".to_owned());
    }
    parts.join(", ")
}
