use std::sync::Arc;

use super::{Cell, Experiment, Trial, TrialFailure};
use crate::evaluation::{Problem, Spread};

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
    /// Finished trials, sorted by seed and repeat, in whichever order they finished.
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
                .source
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

    /// Summarises a figure over the trials that have it.
    pub fn spread(&self, figure: impl Fn(&Trial) -> Option<f64>) -> Option<Spread> {
        Spread::of(self.trials.iter().filter_map(figure))
    }

    /// Summarises [`TestErrors::percent`](crate::evaluation::TestErrors::percent) over the trials.
    pub fn percent(&self) -> Option<Spread> {
        self.spread(|trial| trial.errors.percent())
    }

    /// Time of the fastest epoch, the one least disturbed by other work on the machine.
    pub fn min_epoch_seconds(&self) -> Option<f64> {
        self.spread(|trial| Some(trial.min_epoch_seconds))
            .map(|spread| spread.smallest)
    }

    /// Returns the trial with the median error in percent (the lower of two), as representative of the cell.
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

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::{
        dataset::Seed,
        evaluation::{Baselines, Errors, NodeAddress, TestErrors, experiments::PaperTable},
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

    /// A trial with these errors; the linear map has 1.6 %, an epoch takes a second.
    pub(in crate::evaluation::experiments) fn trial(seed: u64, z_percent: f64) -> Trial {
        Trial {
            seed: Seed(seed),
            repeat: 0,
            errors: errors(z_percent),
            baselines: Baselines {
                mean: errors(5.5),
                linear: errors(1.6),
                reference: None,
                no_reference: None,
            },
            bottleneck: Some(errors(0.0)),
            networks: 1,
            epochs: 10,
            seconds: 10.0,
            min_epoch_seconds: 1.0,
            states: Vec::new(),
        }
    }

    #[test]
    fn the_order_in_which_trials_finish_leaves_no_trace() {
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
