use serde::Serialize;

use super::{CellResults, ExperimentResults};
use crate::{
    dataset::Seed,
    evaluation::{PublishedErrors, Spread},
    sensor::ArrayScale,
};

/// Figures of a cell for tables and files: medians unless stated otherwise, `None` where there is no such figure (yet).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellSummary {
    /// Array scale.
    pub array: ArrayScale,
    /// Number of hidden nodes.
    pub hidden: usize,
    /// Number of training samples; in a cross-validation, of all samples.
    pub samples: usize,
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
    /// AveZerr, in percent.
    pub z_percent: Figure,
    /// AveXerr, in percent.
    pub x_percent: Figure,
    /// AveYerr, in percent.
    pub y_percent: Figure,
    /// Mean |decoupled z − z|, in millimetres.
    pub z_mm: Figure,
    /// AveZerr of always answering the mean of the training set.
    pub mean_z_percent: Option<f64>,
    /// AveZerr of the best affine map on resistance.
    pub linear_z_percent: Option<f64>,
    /// AveZerr of the best answer possible with so few hidden nodes.
    pub bound_z_percent: Option<f64>,
    /// Mean number of epochs per start.
    pub epochs_run: Option<f64>,
    /// Training time of a network, over all its starts.
    pub training_seconds: Option<f64>,
    /// Time of the fastest epoch, the one least disturbed by other work on the machine.
    pub epoch_ms: Option<f64>,
}

/// A measured figure beside the published one.
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
        let median = |figure: fn(&super::Trial) -> Option<f64>| self.spread(figure).map(|spread| spread.median);
        let starts = settings.starts;
        let epochs_run = self.spread(|trial| Some(trial.epochs as f64 / (trial.networks * starts).max(1) as f64));
        CellSummary {
            array: settings.source.sensor.scale,
            hidden: settings.hidden,
            samples: settings.source.samples,
            method: settings.training.method.short_name(),
            epochs: settings.training.stopping.epochs,
            starts,
            seed: settings.seed,
            trials: self.trials.len(),
            expected_trials: self.expected,
            z_percent: self.figure(|published| published.z_percent, |trial| trial.errors.z_percent),
            x_percent: self.figure(|published| published.x_percent, |trial| trial.errors.x_percent),
            y_percent: self.figure(|published| published.y_percent, |trial| trial.errors.y_percent),
            z_mm: Figure {
                published: None,
                ..self.figure(|published| published.z_percent, |trial| Some(trial.errors.z_mm))
            },
            mean_z_percent: median(|trial| trial.baselines.mean.z_percent),
            linear_z_percent: median(|trial| trial.baselines.linear.z_percent),
            bound_z_percent: median(|trial| trial.bottleneck.z_percent).map(without_rounding),
            epochs_run: epochs_run.map(|spread| spread.median),
            training_seconds: median(|trial| Some(trial.seconds_per_network())),
            epoch_ms: self.least_epoch_seconds().map(|seconds| 1e3 * seconds),
        }
    }

    fn figure(&self, published: fn(&PublishedErrors) -> f64, measured: fn(&super::Trial) -> Option<f64>) -> Figure {
        let spread: Option<Spread> = self.spread(measured);
        Figure {
            published: self.cell.published.as_ref().map(published),
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
