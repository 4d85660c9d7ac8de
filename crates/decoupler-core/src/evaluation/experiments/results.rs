use std::sync::Arc;

use serde::Serialize;

use super::{Cell, Experiment, Trial};
use crate::{
    evaluation::{ErrorMeasure, RunError, Spread, table::Figures},
    problem::Problem,
};

/// Results of an experiment so far.
#[derive(Clone, Debug)]
pub struct ExperimentResults {
    /// Experiment to which the results belong.
    pub experiment: Experiment,
    /// Description of the readings and targets; `None` until a recording is read.
    pub problem: Option<Arc<Problem>>,
    /// Cells with their trials, row by row in the order of [`Experiment::cells`].
    pub cells: Vec<Cell>,
}

impl ExperimentResults {
    /// Creates empty results.
    pub fn new(experiment: Experiment) -> Self {
        let simulation = experiment.base.simulation();
        Self {
            cells: experiment.cells(),
            problem: simulation.map(|simulation| Arc::new(simulation.problem())),
            experiment,
        }
    }

    /// Adds the outcome of a trial of cell `cell`.
    ///
    /// # Panics
    /// If there is no such cell.
    pub fn record(&mut self, cell: usize, outcome: Result<Trial, RunError>) {
        let Cell { trials, failures, .. } = &mut self.cells[cell];
        match outcome {
            Ok(trial) => trials.push(trial),
            Err(failure) => failures.push(failure),
        }
        trials.sort_by_key(|trial| (trial.seed.0, trial.repeat));
        failures.sort_by_key(|failure| match failure {
            RunError::Trial { seed, repeat, .. } => Some((seed.0, *repeat)),
            _ => None,
        });
    }

    /// Returns the value of a cell on each axis, as text.
    pub fn cell_labels(&self, cell: &Cell) -> Vec<String> {
        let axes = self.experiment.axes().zip([cell.column, cell.row]);
        axes.map(|(axis, place)| axis.label(place)).collect()
    }

    /// Returns `true` if every trial has finished or failed.
    pub fn is_complete(&self) -> bool {
        self.cells.iter().all(Cell::is_complete)
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

/// Figures for tables and files are medians unless stated otherwise, `None` if there is no such figure (yet).
impl Cell {
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

    /// Measures of the errors of the network, the first of which ranks the cells: of the nodes of an array, or over all
    /// targets of a recording.
    fn measures(&self) -> &'static [ErrorMeasure] {
        match self.settings.simulation() {
            Some(_) => &[
                ErrorMeasure::ZPercent,
                ErrorMeasure::XPercent,
                ErrorMeasure::YPercent,
                ErrorMeasure::ZMm,
            ],
            None => &[ErrorMeasure::RangePercent, ErrorMeasure::R2],
        }
    }

    /// Returns the [errors of the network](crate::evaluation::TestErrors::figure), the first of which ranks the cells.
    pub fn errors(&self) -> impl Iterator<Item = (ErrorMeasure, Figure)> {
        self.measures().iter().map(|&measure| (measure, self.figure(measure)))
    }

    /// Returns this error of the network; `None` if the source has another one.
    pub fn error(&self, measure: ErrorMeasure) -> Option<Figure> {
        self.measures().contains(&measure).then(|| self.figure(measure))
    }

    fn figure(&self, measure: ErrorMeasure) -> Figure {
        let measured = |trial: &Trial| trial.scores.network.figure(measure);
        let spread = self.spread(measured);
        let published = self.published.as_ref();
        Figure {
            published: published.and_then(|published| measure.of(Figures::Published(published))),
            median: spread.map(|spread| spread.median),
            min: spread.map(|spread| spread.smallest),
            max: spread.map(|spread| spread.largest),
            values: self.trials.iter().map(measured).collect(),
        }
    }

    /// Returns the error in percent by which cells are ranked.
    pub fn percent(&self) -> Figure {
        self.figure(self.measures()[0])
    }

    fn spread(&self, figure: impl Fn(&Trial) -> Option<f64>) -> Option<Spread> {
        Spread::of(self.trials.iter().filter_map(figure))
    }

    fn median(&self, figure: impl Fn(&Trial) -> Option<f64>) -> Option<f64> {
        self.spread(figure).map(|spread| spread.median)
    }

    /// Error in percent of always answering the mean of the training set.
    pub fn mean_percent(&self) -> Option<f64> {
        self.median(|trial| trial.scores.baselines.mean.percent())
    }

    /// Error in percent of the linear baseline.
    pub fn linear_percent(&self) -> Option<f64> {
        self.median(|trial| trial.scores.baselines.linear.percent())
    }

    /// Mean number of epochs per start.
    pub fn epochs_run(&self) -> Option<f64> {
        let starts = self.settings.starts;
        self.median(|trial| Some(trial.effort.epochs as f64 / (trial.effort.networks * starts).max(1) as f64))
    }

    /// Time of a training in seconds, with all its starts.
    pub fn training_seconds(&self) -> Option<f64> {
        self.median(|trial| Some(trial.effort.seconds / trial.effort.networks.max(1) as f64))
    }

    /// Time of the fastest epoch in milliseconds, which is least affected by other load on the machine.
    pub fn epoch_ms(&self) -> Option<f64> {
        let fastest = self.spread(|trial| trial.effort.min_epoch_seconds)?;
        Some(1e3 * fastest.smallest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::Seed,
        evaluation::{
            Baselines, Errors, NodeAddress, Scores, TestErrors, cross_validation::Effort, experiments::PaperTable,
        },
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
                min_epoch_seconds: Some(1.0),
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
        let z = forwards.cells[2].percent();
        assert_eq!(
            [z.published, z.min, z.median, z.max],
            [Some(2.37), Some(1.0), Some(2.5), Some(9.0)]
        );
        assert_eq!(forwards.cells[1].median_trial(), None);
    }
}
