use std::sync::Arc;

use serde::Serialize;

use super::{Cell, Experiment, Trial, TrialFailure};
use crate::{
    evaluation::{Errors, PublishedErrors, Spread, TargetErrors},
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
            expected: experiment.seeds_of(&cell.settings).count() * experiment.repeats(),
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
        let cell = &mut self.cells[cell];
        match outcome {
            Ok(trial) => {
                let key = |trial: &Trial| (trial.seed.0, trial.repeat);
                let place = cell.trials.partition_point(|other| key(other) < key(&trial));
                cell.trials.insert(place, trial);
            }
            Err(failure) => {
                let key = |failure: &TrialFailure| (failure.seed.0, failure.repeat);
                let place = cell.failures.partition_point(|other| key(other) < key(&failure));
                cell.failures.insert(place, failure);
            }
        }
    }

    /// Returns the value of a cell on each axis, as text.
    pub fn cell_labels(&self, cell: &CellResults) -> Vec<String> {
        let places = [cell.cell.column, cell.cell.row].into_iter();
        places
            .zip(self.experiment.axes())
            .map(|(place, axis)| axis.label(place))
            .collect()
    }

    /// Returns `true` if every trial has finished or failed.
    pub fn is_complete(&self) -> bool {
        self.cells.iter().all(CellResults::is_complete)
    }
}

impl CellResults {
    /// Returns `true` if every trial has finished or failed.
    pub fn is_complete(&self) -> bool {
        self.trials.len() + self.failures.len() == self.expected
    }

    /// Returns the spread of a figure over the trials that have it.
    pub fn spread(&self, figure: impl Fn(&Trial) -> Option<f64>) -> Option<Spread> {
        Spread::of(self.trials.iter().filter_map(figure))
    }

    /// Returns the spread of [`TestErrors::percent`](crate::evaluation::TestErrors::percent) over the trials.
    pub fn percent(&self) -> Option<Spread> {
        self.spread(|trial| trial.errors.percent())
    }

    /// Returns the time of the fastest epoch, which is least affected by other load on the machine.
    pub fn min_epoch_seconds(&self) -> Option<f64> {
        self.spread(|trial| Some(trial.min_epoch_seconds))
            .map(|spread| spread.smallest)
    }

    /// Returns the trial with the median error in percent (the lower of two), as representative for the cell.
    pub fn median_trial(&self) -> Option<&Trial> {
        let with_errors = self
            .trials
            .iter()
            .filter_map(|trial| Some((trial, trial.errors.percent()?)));
        let mut trials: Vec<_> = with_errors.collect();
        trials.sort_by(|(_, one), (_, other)| one.total_cmp(other));
        let middle = trials.len().checked_sub(1)? / 2;
        Some(trials[middle].0)
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
    /// Error of the network in percent, by which cells are ranked: see
    /// [`TestErrors::percent`](crate::evaluation::TestErrors::percent).
    pub percent: Figure,
    /// Further errors on the nodes of an array, or on the targets of a recording.
    pub errors: SummaryErrors,
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

/// Errors of a cell in addition to the one by which it is ranked.
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
        CellSummary {
            cell: self.cell,
            trials: self.trials.len(),
            expected_trials: self.expected,
            percent: self.figure(|published| Some(published.z_percent), |trial| trial.errors.percent()),
            errors: match settings.simulation() {
                Some(_) => self.node_errors(),
                None => SummaryErrors::Targets {
                    r2: self.figure(|_| None, |trial| TargetErrors::over_all(trial.errors.targets())?.r2),
                },
            },
            mean_percent: median(|trial| trial.mean.percent()),
            linear_percent: median(|trial| trial.linear.percent()),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::Seed,
        evaluation::{Errors, NodeAddress, TestErrors, experiments::PaperTable},
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
            errors: errors(z_percent),
            mean: errors(5.5),
            linear: errors(1.6),
            networks: 1,
            epochs: 10,
            seconds: 10.0,
            min_epoch_seconds: 1.0,
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
        let z = forwards.cells[2].summary().percent;
        assert_eq!(
            [z.published, z.min, z.median, z.max],
            [Some(2.37), Some(1.0), Some(2.5), Some(9.0)]
        );
        assert_eq!(forwards.cells[1].median_trial(), None);
    }
}
