use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use ndarray::Array2;
use rayon::prelude::*;

use super::{
    Baselines, Problem, RunDefect, RunError, RunSettings, Scores, StartRecord, StartTrainer, TestErrors, starts::lowest,
};
use crate::{
    dataset::{Dataset, PerRow},
    network::{DecouplingNetwork, Inputs, MinMax, Mlp, Networks},
    training::{Method, SettingError, StopReason, StoppingRules, TrainerState, check_width},
};

/// A run: its sets of samples, one training per start, and the errors of the best network.
///
/// Starts share the sets and scalings and differ only in their random initialisation. The *leader* is the start
/// whose best network has the lowest validation error so far (training error if nothing is held out); the test set
/// never decides.
pub struct Run {
    pub(super) settings: RunSettings,
    pub(super) test: Arc<Dataset>,
    pub(super) problem: Arc<Problem>,
    pub(super) scalings: PerRow<(Inputs, MinMax)>,
    pub(super) starts: Vec<StartTrainer>,
    /// See [`Self::wall_time`].
    pub(super) wall_time: Option<Duration>,
    /// Errors of the baselines; `None` if only the networks count.
    pub(super) baselines: Option<Baselines>,
}

impl Run {
    /// Settings of the run.
    pub fn settings(&self) -> &RunSettings {
        &self.settings
    }

    /// Runs one epoch of every start that has not ended, in parallel. Returns the reason for stopping once every
    /// start has ended. Results are bit-identical for any number of threads.
    pub fn step(&mut self) -> Option<StopReason> {
        let begun = Instant::now();
        match self.starts.as_mut_slice() {
            // Stays on this thread, which saves a hand-over every epoch.
            [only] => {
                only.step();
            }
            all => all.par_iter_mut().for_each(|start| {
                start.step();
            }),
        }
        self.wall_time = self.wall_time.map(|time| time.saturating_add(begun.elapsed()));
        self.stop_reason()
    }

    /// Time that all starts together have taken by the clock, without pauses; `None` if the run was resumed and the
    /// time before is not known. [`StartTrainer::elapsed`] adds up the times of trainings that ran side by side.
    pub fn wall_time(&self) -> Option<Duration> {
        self.wall_time
    }

    /// Sets the time of a resumed run, if it was saved.
    pub fn with_wall_time(mut self, saved: Option<Duration>) -> Self {
        self.wall_time = saved.or(self.wall_time);
        self
    }

    /// Stops every start at the user's request.
    pub fn stop(&mut self) {
        self.starts.iter_mut().for_each(StartTrainer::stop);
    }

    /// Returns the reason for stopping once every start has ended: the leader's, or [`StopReason::Stopped`] if the
    /// user stopped any start before its end.
    pub fn stop_reason(&self) -> Option<StopReason> {
        let reasons = self.starts.iter().map(StartTrainer::stop_reason);
        let reasons: Vec<_> = reasons.collect::<Option<_>>()?;
        if reasons.contains(&StopReason::Stopped) {
            return Some(StopReason::Stopped);
        }
        self.leader().stop_reason()
    }

    /// Finds the defect of the leader, once its trainings have ended; `None` for a sound run.
    pub fn defect(&self) -> Option<RunDefect> {
        RunDefect::of(self.leader())
    }

    /// Continues every start from its present weights with another method: [`Trainer::continue_with`](crate::training::Trainer::continue_with).
    ///
    /// # Errors
    /// If a setting is out of range, or the networks are too wide for the method; nothing is then changed.
    pub fn continue_with(&mut self, method: Method) -> Result<(), RunError> {
        let rows = self.leader().rows();
        let trainings = rows.len() * self.starts.len();
        let samples = rows[0].samples();
        check_width(&method, rows[0].present().shape(), samples, trainings)?;
        // Starts have the same shapes, so either the first is refused or none.
        for start in &mut self.starts {
            start.continue_with(method)?;
        }
        self.settings.training.method = method;
        Ok(())
    }

    /// Changes the stopping rules of every start: [`Trainer::set_stopping`](crate::training::Trainer::set_stopping).
    ///
    /// # Errors
    /// If a setting is out of range; nothing is then changed.
    pub fn set_stopping(&mut self, stopping: StoppingRules) -> Result<(), SettingError> {
        for start in &mut self.starts {
            start.set_stopping(stopping)?;
        }
        self.settings.training.stopping = stopping;
        Ok(())
    }

    /// Trainings of all starts.
    pub fn trainers(&self) -> &[StartTrainer] {
        &self.starts
    }

    /// Index of the leader, from 0.
    pub fn leader_number(&self) -> usize {
        lowest(self.starts.iter().map(StartTrainer::best_mse)).unwrap_or(0)
    }

    /// Training of the leader.
    pub fn leader(&self) -> &StartTrainer {
        &self.starts[self.leader_number()]
    }

    /// Returns a record of each start. Decodes the test set once per start.
    pub fn starts(&self) -> Vec<StartRecord> {
        let record = |trainer: &StartTrainer| {
            let best = trainer.best_records();
            let errors = self.errors_of(&self.network_of(trainer).decouple(&self.test));
            let is_array = errors.nodes().is_some();
            StartRecord {
                train_mse: best.training_mse,
                validation_mse: best.validation_mse,
                z_percent: errors.percent().filter(|_| is_array),
                percent_of_range: errors.percent().filter(|_| !is_array),
                epochs: trainer.latest().epoch,
                best_epoch: trainer.best_epoch(),
                stop_reason: trainer.stop_reason(),
            }
        };
        self.starts.par_iter().map(record).collect()
    }

    /// Returns the states of all trainings for [`Self::resume`]: start by start, and in each row by row.
    pub fn states(&self) -> Vec<TrainerState> {
        self.starts.iter().flat_map(StartTrainer::states).collect()
    }

    /// The test set.
    pub fn test(&self) -> &Arc<Dataset> {
        &self.test
    }

    /// Description of the readings and targets.
    pub fn problem(&self) -> &Arc<Problem> {
        &self.problem
    }

    /// Returns the leader's best networks so far, ready to decode readings.
    pub fn network(&self) -> Networks {
        self.network_of(self.leader())
    }

    fn network_of(&self, start: &StartTrainer) -> Networks {
        let rows = self.scalings.values().iter().zip(start.best());
        let network = |((inputs, outputs), mlp): (&(Inputs, MinMax), &Mlp)| {
            DecouplingNetwork::new(inputs.clone(), mlp.clone(), outputs.clone())
        };
        Networks::each(rows.map(network).collect())
    }

    /// Returns the answers of [`Self::network`] to the test set: samples × outputs, in the units of the targets.
    pub fn decouple_test(&self) -> Array2<f64> {
        self.network().decouple(&self.test)
    }

    /// Returns the errors of answers to the test set (samples × targets, in the units of the targets).
    pub fn errors_of(&self, answers: &Array2<f64>) -> TestErrors {
        TestErrors::measure(&self.settings.source, &self.test, answers)
    }

    /// Returns the errors of [`Self::network`] on the test set.
    pub fn errors(&self) -> TestErrors {
        self.errors_of(&self.decouple_test())
    }

    /// Errors of the baselines on the test set; `None` for the run of a fold.
    pub fn baselines(&self) -> Option<&Baselines> {
        self.baselines.as_ref()
    }

    /// Returns the errors of [`Self::network`] and of the baselines on the test set; `None` for the run of a fold.
    pub fn scores(&self) -> Option<Scores> {
        Some(Scores {
            network: self.errors(),
            baselines: self.baselines.clone()?,
        })
    }
}
