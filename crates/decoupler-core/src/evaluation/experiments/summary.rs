use std::cmp::Ordering;

use serde::Serialize;

use super::{CellResults, ExperimentResults, Trial};
use crate::{
    dataset::{Seed, SplitBy},
    evaluation::{Errors, PublishedErrors, Spread, TargetErrors},
    sensor::ArrayScale,
    text::format_number,
};

/// Figures of a cell for tables and files: medians unless stated otherwise, `None` where there is no such figure (yet).
#[derive(Clone, Debug, PartialEq)]
pub struct CellSummary {
    /// Array scale; `None` for a recording.
    pub array: Option<ArrayScale>,
    /// Number of hidden nodes.
    pub hidden: usize,
    /// Number of training samples; in a cross-validation, of all samples. `None` for a recording.
    pub samples: Option<usize>,
    /// Rule by which a recording is divided.
    pub split: Option<SplitBy>,
    /// Short name of the training method.
    pub method: &'static str,
    /// Largest number of epochs.
    pub epochs: usize,
    /// Number of starts per network.
    pub starts: usize,
    /// First seed of the cell.
    pub seed: Seed,
    /// Number of trials finished.
    pub trials: usize,
    /// Number of trials planned.
    pub expected_trials: usize,
    /// Error of the network in percent, by which cells are ranked: see
    /// [`TestErrors::percent`](crate::evaluation::TestErrors::percent).
    pub percent: Figure,
    /// Further errors on the nodes of an array, or on the targets of a recording.
    pub errors: SummaryErrors,
    /// Error in percent of always answering the mean of the training set.
    pub mean_percent: Option<f64>,
    /// Error in percent of the linear baseline.
    pub linear_percent: Option<f64>,
    /// Error in percent of the best answer possible with so few hidden nodes.
    pub bound_percent: Option<f64>,
    /// Mean number of epochs per start.
    pub epochs_run: Option<f64>,
    /// Training time of a network, over all its starts.
    pub training_seconds: Option<f64>,
    /// Time of the fastest epoch, the one least disturbed by other work on the machine.
    pub epoch_ms: Option<f64>,
}

/// Errors of a cell next to the one by which it is ranked.
#[derive(Clone, Debug, PartialEq)]
pub enum SummaryErrors {
    /// Errors on the nodes of an array.
    Nodes {
        /// AveXerr, in percent.
        x_percent: Figure,
        /// AveYerr, in percent.
        y_percent: Figure,
        /// Mean |decoupled z − z|, in millimetres.
        z_mm: Figure,
    },
    /// Errors on the targets of a recording.
    Targets {
        /// Coefficient of determination R², the mean over the targets that vary.
        r2: Figure,
    },
}

/// A measured figure next to the published one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// Value that the paper reports.
    pub published: Option<f64>,
    /// Median of the trials.
    pub median: Option<f64>,
    /// Smallest value of the trials.
    pub min: Option<f64>,
    /// Largest value of the trials.
    pub max: Option<f64>,
    /// Value of each trial, by seed and repeat.
    pub values: Vec<Option<f64>>,
}

impl ExperimentResults {
    /// Returns the figures of every cell, row by row.
    pub fn summaries(&self) -> Vec<CellSummary> {
        self.cells.iter().map(CellResults::summary).collect()
    }
}

impl CellResults {
    /// Returns the figures of this cell.
    pub fn summary(&self) -> CellSummary {
        let settings = &self.cell.settings;
        let median = |figure: fn(&Trial) -> Option<f64>| self.spread(figure).map(|spread| spread.median);
        let starts = settings.starts;
        let epochs_run = self.spread(|trial| Some(trial.epochs as f64 / (trial.networks * starts).max(1) as f64));
        let simulation = settings.source.simulation();
        CellSummary {
            array: simulation.map(|source| source.sensor.scale),
            hidden: settings.hidden,
            samples: simulation.map(|source| source.samples),
            split: self.cell.division.map(|division| division.by),
            method: settings.training.method.short_name(),
            epochs: settings.training.stopping.epochs,
            starts,
            seed: settings.seed,
            trials: self.trials.len(),
            expected_trials: self.expected,
            percent: self.figure(|published| Some(published.z_percent), |trial| trial.errors.percent()),
            errors: match simulation {
                Some(_) => self.node_errors(),
                None => SummaryErrors::Targets {
                    r2: self.figure(|_| None, |trial| TargetErrors::over_all(trial.errors.targets())?.r2),
                },
            },
            mean_percent: median(|trial| trial.baselines.mean.percent()),
            linear_percent: median(|trial| trial.baselines.linear.percent()),
            bound_percent: median(|trial| trial.bottleneck.as_ref()?.percent()).map(without_rounding),
            epochs_run: epochs_run.map(|spread| spread.median),
            training_seconds: median(|trial| Some(trial.seconds_per_network())),
            epoch_ms: self.min_epoch_seconds().map(|seconds| 1e3 * seconds),
        }
    }

    fn node_errors(&self) -> SummaryErrors {
        fn nodes(trial: &Trial) -> Option<&Errors> {
            trial.errors.nodes()
        }
        SummaryErrors::Nodes {
            x_percent: self.figure(|published| Some(published.x_percent), |trial| nodes(trial)?.x_percent),
            y_percent: self.figure(|published| Some(published.y_percent), |trial| nodes(trial)?.y_percent),
            z_mm: self.figure(|_| None, |trial| Some(nodes(trial)?.z_mm)),
        }
    }

    fn figure(&self, published: fn(&PublishedErrors) -> Option<f64>, measured: fn(&Trial) -> Option<f64>) -> Figure {
        let spread: Option<Spread> = self.spread(measured);
        Figure {
            published: self.cell.published.as_ref().and_then(published),
            median: spread.map(|spread| spread.median),
            min: spread.map(|spread| spread.smallest),
            max: spread.map(|spread| spread.largest),
            values: self.trials.iter().map(measured).collect(),
        }
    }
}

/// Replaces rounding errors by zero.
fn without_rounding(percent: f64) -> f64 {
    if percent < 1e-9 { 0.0 } else { percent }
}

/// Errors of the trials of a cell that has some.
#[derive(Clone, Debug)]
pub(super) struct CellErrors {
    pub(super) label: String,
    pub(super) column: usize,
    /// Errors of the network in percent.
    pub(super) percent: Spread,
    pub(super) published: Option<f64>,
    pub(super) linear: Option<f64>,
    pub(super) bound: Option<f64>,
    /// Number of trials.
    trials: usize,
}

impl CellErrors {
    /// Fewest trials that have a spread. By chance, the ranges of three and three trials are apart in this order once in 20.
    pub(super) const FEWEST_TRIALS: usize = 3;

    /// Returns the cells that have results.
    pub(super) fn all(results: &ExperimentResults) -> Vec<Self> {
        let errors = |cell: &CellResults| {
            let place = cell.cell;
            let median = |spread: Option<Spread>| spread.map(|spread| spread.median);
            Some(Self {
                label: results.cell_labels(cell).join("/"),
                column: place.column,
                percent: cell.percent()?,
                published: place.published.map(|published| published.z_percent),
                linear: median(cell.spread(|trial| trial.baselines.linear.percent())),
                trials: cell
                    .trials
                    .iter()
                    .filter(|trial| trial.errors.percent().is_some())
                    .count(),
                bound: median(cell.spread(|trial| trial.bottleneck.as_ref()?.percent())),
            })
        };
        results.cells.iter().filter_map(errors).collect()
    }

    /// Compares the errors of all trials with a figure; `None` within their spread, or with too few trials.
    pub(super) fn against(&self, figure: f64) -> Option<Ordering> {
        self.apart([figure, figure])
    }

    /// Compares the errors of all trials with those of another cell; `None` if their ranges overlap, or with too few trials.
    pub(super) fn compare(&self, other: &Self) -> Option<Ordering> {
        let is_enough = other.trials >= Self::FEWEST_TRIALS;
        self.apart([other.percent.smallest, other.percent.largest])
            .filter(|_| is_enough)
    }

    fn apart(&self, [low, high]: [f64; 2]) -> Option<Ordering> {
        match self.percent {
            _ if self.trials < Self::FEWEST_TRIALS => None,
            Spread { largest, .. } if largest < low => Some(Ordering::Less),
            Spread { smallest, .. } if smallest > high => Some(Ordering::Greater),
            _ => None,
        }
    }

    /// Returns the label and errors as text.
    pub(super) fn figures(&self) -> String {
        format!("{}: {}", self.label, spread(&self.percent))
    }
}

/// Sorts cells by a key, ascending.
pub(super) fn sorted_by<K: Ord>(mut cells: Vec<CellErrors>, key: impl FnMut(&CellErrors) -> K) -> Vec<CellErrors> {
    cells.sort_by_key(key);
    cells
}

/// Formats the median, and the smallest to largest value where they differ.
fn spread(spread: &Spread) -> String {
    if spread.smallest == spread.largest {
        return format!("{} %", format_number(spread.median));
    }
    let [median, smallest, largest] = [spread.median, spread.smallest, spread.largest].map(format_number);
    format!("{median} % ({smallest} to {largest})")
}
