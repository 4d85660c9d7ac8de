use std::sync::Arc;

use serde::Serialize;

use super::{Cell, Experiment, Trial, TrialFailure};
use crate::{
    evaluation::{ErrorMeasure, Spread, table::Figures},
    problem::Problem,
};

/// Results of an experiment so far.
#[derive(Clone, Debug)]
pub struct ExperimentResults {
    /// Experiment to which the results belong.
    pub experiment: Experiment,
    /// Description of the readings and targets; `None` until a recording is read.
    pub problem: Option<Arc<Problem>>,
    /// Results of the cells, row by row in the order of [`Experiment::cells`].
    pub cells: Vec<CellResults>,
}

/// Results of a cell so far.
#[derive(Clone, Debug)]
pub struct CellResults {
    /// Cell to which the results belong.
    pub cell: Cell,
    /// Number of trials planned.
    pub expected: usize,
    /// Finished trials, sorted by seed and repeat regardless of the order in which they finished.
    pub trials: Vec<Trial>,
    /// Failed trials, sorted likewise.
    pub failures: Vec<TrialFailure>,
}

impl ExperimentResults {
    /// Creates empty results.
    pub fn new(experiment: Experiment) -> Self {
        let cells = experiment.cells().into_iter().map(|cell| CellResults {
            cell,
            expected: experiment.trials_of(&cell.settings).count(),
            trials: Vec::new(),
            failures: Vec::new(),
        });
        Self {
            cells: cells.collect(),
            problem: experiment
                .base
                .simulation()
                .map(|simulation| Arc::new(simulation.problem())),
            experiment,
        }
    }

    /// Adds the outcome of a trial of cell `cell`.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn record(&mut self, cell: usize, outcome: Result<Trial, TrialFailure>) {
        let CellResults { trials, failures, .. } = &mut self.cells[cell];
        match outcome {
            Ok(trial) => trials.push(trial),
            Err(failure) => failures.push(failure),
        }
        trials.sort_by_key(|trial| (trial.seed.0, trial.repeat));
        failures.sort_by_key(|failure| (failure.seed.0, failure.repeat));
    }

    /// Returns the value of a cell on each axis, as text.
    pub fn cell_labels(&self, cell: &CellResults) -> Vec<String> {
        let axes = self.experiment.axes().zip([cell.cell.column, cell.cell.row]);
        axes.map(|(axis, place)| axis.label(place)).collect()
    }

    /// Returns `true` if every trial has finished or failed.
    pub fn is_complete(&self) -> bool {
        self.cells.iter().all(CellResults::is_complete)
    }

    /// Returns the figures of every cell, row by row.
    pub fn summaries(&self) -> Vec<CellSummary> {
        self.cells.iter().map(CellResults::summary).collect()
    }
}

impl CellResults {
    /// Returns `true` if every trial has finished or failed.
    pub fn is_complete(&self) -> bool {
        self.trials.len() + self.failures.len() == self.expected
    }

    /// Returns the trial with the median error in percent (the lower of two), as representative for the cell.
    pub fn median_trial(&self) -> Option<&Trial> {
        let percent = |trial: &Trial| trial.scores.network.percent();
        let with_errors = self.trials.iter().filter_map(|trial| Some((percent(trial)?, trial)));
        let mut trials = Vec::from_iter(with_errors);
        trials.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        Some(trials.get(trials.len().checked_sub(1)? / 2)?.1)
    }
}

/// Figures of a cell for tables and files: medians unless stated otherwise, `None` if there is no such figure (yet).
#[derive(Clone, Debug, PartialEq)]
pub struct CellSummary {
    /// Cell to which the figures belong.
    pub cell: Cell,
    /// Number of trials finished.
    pub trials: usize,
    /// Number of trials planned.
    pub expected_trials: usize,
    /// Errors of the network, the first of which ranks the cells: see [`TestErrors::figure`](crate::evaluation::TestErrors::figure).
    pub errors: Vec<(ErrorMeasure, Figure)>,
    /// Error in percent of always answering the mean of the training set.
    pub mean_percent: Option<f64>,
    /// Error in percent of the linear baseline.
    pub linear_percent: Option<f64>,
    /// Mean number of epochs per start.
    pub epochs_run: Option<f64>,
    /// Training time of a network, over all its starts.
    pub training_seconds: Option<f64>,
    /// Time of the fastest epoch, which is least affected by other load on the machine.
    pub epoch_ms: Option<f64>,
}

impl CellSummary {
    /// Errors of the nodes of an array.
    const OF_NODES: &[ErrorMeasure] = &[
        ErrorMeasure::ZPercent,
        ErrorMeasure::XPercent,
        ErrorMeasure::YPercent,
        ErrorMeasure::ZMm,
    ];
    /// Errors over all targets of a recording.
    const OF_TARGETS: &[ErrorMeasure] = &[ErrorMeasure::RangePercent, ErrorMeasure::R2];

    /// Returns the error in percent by which cells are ranked.
    pub fn percent(&self) -> &Figure {
        &self.errors[0].1
    }

    /// Returns this error; `None` if the source has another one.
    pub fn error(&self, measure: ErrorMeasure) -> Option<&Figure> {
        self.errors
            .iter()
            .find_map(|(of, figure)| (*of == measure).then_some(figure))
    }
}

/// Measured figure, with the published one for comparison.
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

impl CellResults {
    /// Returns the figures of this cell.
    pub fn summary(&self) -> CellSummary {
        let settings = &self.cell.settings;
        let spread = |figure: &dyn Fn(&Trial) -> Option<f64>| Spread::of(self.trials.iter().filter_map(figure));
        let median = |figure: &dyn Fn(&Trial) -> Option<f64>| spread(figure).map(|spread| spread.median);
        let figure = |measure: ErrorMeasure| {
            let measured = |trial: &Trial| trial.scores.network.figure(measure);
            let spread = spread(&measured);
            let published = self.cell.published.as_ref();
            Figure {
                published: published.and_then(|published| measure.of(Figures::Published(published))),
                median: spread.map(|spread| spread.median),
                min: spread.map(|spread| spread.smallest),
                max: spread.map(|spread| spread.largest),
                values: self.trials.iter().map(measured).collect(),
            }
        };
        let measures = match settings.simulation() {
            Some(_) => CellSummary::OF_NODES,
            None => CellSummary::OF_TARGETS,
        };
        let epochs =
            |trial: &Trial| trial.effort.epochs as f64 / (trial.effort.networks * settings.starts).max(1) as f64;
        let seconds = |trial: &Trial| trial.effort.seconds / trial.effort.networks.max(1) as f64;
        CellSummary {
            cell: self.cell,
            trials: self.trials.len(),
            expected_trials: self.expected,
            errors: measures.iter().map(|&measure| (measure, figure(measure))).collect(),
            mean_percent: median(&|trial| trial.scores.baselines.mean.percent()),
            linear_percent: median(&|trial| trial.scores.baselines.linear.percent()),
            epochs_run: median(&|trial| Some(epochs(trial))),
            training_seconds: median(&|trial| Some(seconds(trial))),
            epoch_ms: spread(&|trial| Some(trial.effort.min_epoch_seconds)).map(|spread| 1e3 * spread.smallest),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::Seed,
        evaluation::{Baselines, Effort, Errors, NodeAddress, Scores, TestErrors, experiments::PaperTable},
    };

    fn errors(z_percent: f64) -> TestErrors {
        TestErrors::Nodes(Errors {
            z_percent: Some(z_percent),
            x_percent: Some(0.1),
            y_percent: Some(1e-12),
            z_mm: z_percent / 20.0,
            z_full_scale_percent: 5.0 * z_percent,
            worst_mm: 0.5,
            worst_node: NodeAddress::default(),
        })
    }

    /// Returns a trial with these errors; the linear map has 1.6 %, and an epoch takes a second.
    fn trial(seed: u64, z_percent: f64) -> Trial {
        Trial {
            seed: Seed(seed),
            repeat: 0,
            scores: Scores {
                network: errors(z_percent),
                network_alone: None,
                baselines: Baselines {
                    mean: errors(5.5),
                    linear: errors(1.6),
                    model_based: None,
                },
                coverage: Vec::new(),
            },
            effort: Effort {
                networks: 1,
                epochs: 10,
                seconds: 10.0,
                min_epoch_seconds: 1.0,
            },
            states: Vec::new(),
        }
    }

    #[test]
    fn results_do_not_depend_on_the_order_in_which_trials_finish() {
        let mut forwards = ExperimentResults::new(PaperTable::HiddenNodes.experiment());
        let mut backwards = forwards.clone();
        let trials = [trial(0, 3.0), trial(1, 1.0), trial(2, 2.0), trial(3, 9.0)];
        for trial in &trials {
            forwards.record(2, Ok(trial.clone()));
        }
        for trial in trials.iter().rev() {
            backwards.record(2, Ok(trial.clone()));
        }
        assert_eq!(forwards.cells[2].trials, trials);
        assert_eq!(backwards.cells[2].trials, trials);
        assert_eq!(forwards.cells[2].median_trial().unwrap().seed, Seed(2));
        assert!(!forwards.cells[2].is_complete());
        let summary = forwards.cells[2].summary();
        let z = summary.percent();
        assert_eq!(
            [z.published, z.min, z.median, z.max],
            [Some(2.37), Some(1.0), Some(2.5), Some(9.0)]
        );
        assert_eq!(forwards.cells[1].median_trial(), None);
    }
}
