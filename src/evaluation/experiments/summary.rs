use serde::Serialize;

use super::{CellResults, ExperimentResults};
use crate::{
    dataset::Seed,
    evaluation::{PublishedErrors, Spread},
    sensor::ArrayScale,
};

/// The figures of a cell as tables and files show them; medians where nothing else is said, `None` where there is no
/// such figure (yet).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellSummary {
    /// Array scale.
    pub array: ArrayScale,
    /// Hidden nodes.
    pub hidden: usize,
    /// Training samples; in a cross-validation, all samples.
    pub samples: usize,
    /// Method.
    pub method: &'static str,
    /// Most epochs.
    pub epochs: usize,
    /// Starts of each network.
    pub starts: usize,
    /// First seed.
    pub seed: Seed,
    /// Trials finished.
    pub trials: usize,
    /// Trials asked for.
    pub expected_trials: usize,
    /// AveZerr.
    pub z_percent: Figure,
    /// AveXerr.
    pub x_percent: Figure,
    /// AveYerr.
    pub y_percent: Figure,
    /// Mean |decoupled z − z|.
    pub z_mm: Figure,
    /// AveZerr of always answering the mean of the training set.
    pub mean_z_percent: Option<f64>,
    /// AveZerr of the best affine map on resistance.
    pub linear_z_percent: Option<f64>,
    /// AveZerr of the best answer that so few hidden nodes can give.
    pub bound_z_percent: Option<f64>,
    /// Mean number of epochs of a start.
    pub epochs_run: Option<f64>,
    /// Training time of a network, all its starts together.
    pub training_seconds: Option<f64>,
    /// Time of the quickest epoch, which other work on the machine has disturbed least.
    pub epoch_ms: Option<f64>,
}

/// A figure beside the published one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figure {
    /// What the paper reports.
    pub published: Option<f64>,
    /// Half of the trials are below.
    pub median: Option<f64>,
    /// The smallest.
    pub min: Option<f64>,
    /// The largest.
    pub max: Option<f64>,
    /// Of each trial, by seed and repeat.
    pub values: Vec<Option<f64>>,
}

impl ExperimentResults {
    /// The figures of every cell, row by row.
    pub fn summaries(&self) -> Vec<CellSummary> {
        self.cells.iter().map(CellResults::summary).collect()
    }
}

impl CellResults {
    /// The figures of this cell.
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

/// Zero for what only rounding has left.
fn without_rounding(percent: f64) -> f64 {
    if percent < 1e-9 { 0.0 } else { percent }
}
