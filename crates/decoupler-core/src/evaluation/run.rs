use std::{
    ops::RangeInclusive,
    sync::Arc,
    time::{Duration, Instant},
};

use ndarray::Array2;
use rayon::prelude::*;
use thiserror::Error;

use super::{
    Baselines, Combination, Coverage, Intervals, RunSettings, Scores, StartRecord, StartTrainer, TestErrors,
    starts::lowest,
};
use crate::{
    dataset::{Dataset, DatasetError, PerRow, Seed},
    decoupling::{Combined, DecodeError, Program, ProgramDecoder},
    job::{Cancelled, Job},
    machine::MemoryBudget,
    network::{DecouplingNetwork, Inputs, MinMax, Mlp, NetworkError, Networks},
    problem::Problem,
    scene::SceneError,
    sensor::SensorError,
    text::counted,
    training::{
        Method, SettingError, StopReason, StoppingRules, Trainer, TrainerState, TrainingError, check_width,
        for_each_part,
    },
};

/// Run: its sets of samples, one training per start, and the errors of the best network.
///
/// Starts share the sets and scalings and differ only in their random initialisation. The *leader* is the start
/// whose best network has the lowest validation error so far (training error if nothing is held out); the test set
/// never decides. The run answers with the leader's network, or with the mean of the networks of all starts
/// ([`RunSettings::combine`]).
pub struct Run {
    pub(super) settings: RunSettings,
    pub(super) test: Arc<Dataset>,
    pub(super) problem: Arc<Problem>,
    /// Memory that the trainings may use.
    pub(super) memory: MemoryBudget,
    pub(super) scalings: PerRow<(Inputs, MinMax)>,
    pub(super) starts: Vec<StartTrainer>,
    /// See [`Self::wall_time`].
    pub(super) wall_time: Option<Duration>,
    /// Errors of the baselines; `None` if only the networks are needed.
    pub(super) baselines: Option<Baselines>,
    /// What a choice of settings answers with once the network is trained; `None` for the network alone.
    pub(super) combined: Option<Combined>,
    /// Intervals of the present network, with their coverage on the test set.
    pub(super) intervals: Option<(Intervals, Vec<Option<Coverage>>)>,
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
        self.intervals = None;
        for_each_part(&mut self.starts, StartTrainer::step);
        self.wall_time = self.wall_time.map(|time| time.saturating_add(begun.elapsed()));
        self.stop_reason()
    }

    /// Trains to the end.
    ///
    /// # Errors
    /// If the job is cancelled, which is checked before every epoch; the run can then be continued.
    pub fn finish(&mut self, job: &Job<'_>) -> Result<(), Cancelled> {
        while self.stop_reason().is_none() {
            job.check()?;
            self.step();
        }
        Ok(())
    }

    /// Wall time of all starts together, without pauses; `None` if the run was resumed and the time before is not
    /// known. In contrast, [`StartTrainer::elapsed`] is the sum over trainings that ran in parallel.
    pub fn wall_time(&self) -> Option<Duration> {
        self.wall_time
    }

    /// The training time that is shown and saved: the wall time, or as far as known for a resumed run.
    pub fn training_time(&self) -> Duration {
        self.wall_time.unwrap_or_else(|| self.leader().elapsed())
    }

    /// Sets the time of a resumed run, if it was saved.
    pub fn with_wall_time(mut self, saved: Option<Duration>) -> Self {
        self.wall_time = saved.or(self.wall_time);
        self
    }

    /// Stops every start at the user's request.
    pub fn stop(&mut self) {
        self.trainers_mut().for_each(Trainer::stop);
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

    /// Describes the defect of the leader, or of the first start with one if their mean is kept, once the trainings have
    /// ended: some failed or diverged. The text includes the remedy; `None` if there is no defect.
    pub fn defect(&self) -> Option<String> {
        match self.settings.combine {
            Combination::Best => defect_of(self.leader(), self.combined().is_some()),
            Combination::Mean => (self.starts.iter()).find_map(|start| defect_of(start, self.combined().is_some())),
        }
    }

    /// Continues every start from its current weights with another method:
    /// [`Trainer::continue_with`](crate::training::Trainer::continue_with).
    ///
    /// # Errors
    /// If a setting is out of range, or the networks are too wide for the method; nothing is then changed.
    pub fn continue_with(&mut self, method: Method) -> Result<(), RunError> {
        let rows = self.leader().rows();
        let trainings = rows.len() * self.starts.len();
        let samples = rows[0].samples();
        check_width(&method, rows[0].present().shape(), samples, trainings, self.memory)?;
        // They have the same shapes, so either the first is rejected or none.
        self.trainers_mut()
            .try_for_each(|trainer| trainer.continue_with(method))?;
        self.settings.training.method = method;
        Ok(())
    }

    /// Changes the stopping rules of every start: [`Trainer::set_stopping`](crate::training::Trainer::set_stopping).
    ///
    /// # Errors
    /// If a setting is out of range; nothing is then changed.
    pub fn set_stopping(&mut self, stopping: StoppingRules) -> Result<(), SettingError> {
        self.trainers_mut()
            .try_for_each(|trainer| trainer.set_stopping(stopping))?;
        self.settings.training.stopping = stopping;
        Ok(())
    }

    fn trainers_mut(&mut self) -> impl Iterator<Item = &mut Trainer> {
        self.starts.iter_mut().flat_map(|start| &mut start.rows)
    }

    /// Returns the trainings of all starts.
    pub fn trainers(&self) -> &[StartTrainer] {
        &self.starts
    }

    /// Index of the leader, from 0.
    pub fn leader_number(&self) -> usize {
        lowest(self.starts.iter().map(StartTrainer::best_mse)).unwrap_or(0)
    }

    /// Returns the training of the leader.
    pub fn leader(&self) -> &StartTrainer {
        &self.starts[self.leader_number()]
    }

    /// Returns a record of each start. Decodes the test set once per start.
    pub fn starts(&self) -> Vec<StartRecord> {
        let record = |trainer: &StartTrainer| {
            let best = trainer.best_records();
            let errors = self.errors_of(&self.network_of(trainer.best().cloned()).decouple(&self.test));
            let has_nodes = self.problem.has_nodes();
            StartRecord {
                train_mse: best.training_mse,
                validation_mse: best.validation_mse,
                z_percent: errors.percent().filter(|_| has_nodes),
                percent_of_range: errors.percent().filter(|_| !has_nodes),
                epochs: trainer.latest().epoch,
                best_epoch: trainer.best_epoch(),
                stop_reason: trainer.stop_reason(),
            }
        };
        self.starts.par_iter().map(record).collect()
    }

    /// Returns the states of all trainings for [`Self::new`]: start by start, and in each row by row.
    pub fn states(&self) -> Vec<TrainerState> {
        let trainers = self.starts.iter().flat_map(StartTrainer::rows);
        trainers.map(Trainer::state).collect()
    }

    /// Returns the test set.
    pub fn test(&self) -> &Arc<Dataset> {
        &self.test
    }

    /// Returns the description of the readings and targets.
    pub fn problem(&self) -> &Arc<Problem> {
        &self.problem
    }

    /// Returns the best networks so far, ready to decode readings: the leader's, or the mean of the networks of all
    /// starts.
    pub fn network(&self) -> Networks {
        self.network_of(self.best())
    }

    /// Returns the best weights so far, for all rows or for each.
    pub fn best(&self) -> Vec<Mlp> {
        match self.settings.combine {
            Combination::Best => self.leader().best().cloned().collect(),
            Combination::Mean => {
                let of_row = |row: usize| {
                    let of_starts: Vec<&Mlp> = self.starts.iter().map(|start| start.rows()[row].best()).collect();
                    Mlp::mean(&of_starts)
                };
                (0..self.scalings.values().len()).map(of_row).collect()
            }
        }
    }

    fn network_of(&self, weights: impl IntoIterator<Item = Mlp>) -> Networks {
        let rows = self.scalings.values().iter().zip(weights);
        let network = |((inputs, outputs), mlp): (&(Inputs, MinMax), Mlp)| {
            DecouplingNetwork::new(inputs.clone(), mlp, outputs.clone())
        };
        Networks::each(rows.map(network).collect())
    }

    /// Sets what the run answers with once it has ended by itself, instead of its network alone.
    pub fn set_combined(&mut self, combined: Option<Combined>) {
        self.combined = combined;
    }

    /// What the run answers with instead of its network alone: `None` unless the training has ended by itself.
    pub fn combined(&self) -> Option<&Combined> {
        let has_ended = self.stop_reason().is_some_and(|reason| reason != StopReason::Stopped);
        self.combined.as_ref().filter(|_| has_ended)
    }

    /// Returns the program of the answers: of the combination, if settings were chosen and the training has ended, otherwise of
    /// [`Self::network`]. For a recording, readings are limited to their range in training, extended by a tenth.
    pub fn program(&self) -> Program {
        self.network().decoder_program(&self.problem, self.combined())
    }

    /// Returns the answers of [`Self::program`] to the test set: samples × outputs, in the units of the targets.
    pub fn decouple_test(&self) -> Array2<f64> {
        ProgramDecoder::new(self.program()).answers_to(&self.test)
    }

    /// Returns the errors of answers to the test set (samples × targets, in the units of the targets).
    pub fn errors_of(&self, answers: &Array2<f64>) -> TestErrors {
        TestErrors::measure(&self.problem, &self.test, answers)
    }

    /// Returns the errors of [`Self::decouple_test`].
    pub fn errors(&self) -> TestErrors {
        self.errors_of(&self.decouple_test())
    }

    /// Returns the errors of the baselines on the test set; `None` for the run of a fold.
    pub fn baselines(&self) -> Option<&Baselines> {
        self.baselines.as_ref()
    }

    /// Sets the intervals of [`Self::decouple_test`], and measures their coverage on the test set. Another epoch removes them.
    pub fn set_intervals(&mut self, intervals: Intervals) {
        let coverage = intervals.coverage(&self.test, self.decouple_test().view());
        self.intervals = Some((intervals, coverage));
    }

    /// Intervals of [`Self::network`], if they were calibrated.
    pub fn intervals(&self) -> Option<&Intervals> {
        self.intervals.as_ref().map(|(intervals, _)| intervals)
    }

    /// Coverage of [`Self::intervals`] on the test set, target by target; empty if there are none.
    pub fn coverage(&self) -> &[Option<Coverage>] {
        self.intervals.as_ref().map_or(&[], |(_, coverage)| coverage)
    }

    /// Returns the errors of [`Self::network`] and of the baselines on the test set; `None` for the run of a fold.
    pub fn scores(&self) -> Option<Scores> {
        let alone = || {
            let network = self.network().decoder_program(&self.problem, None);
            self.errors_of(&ProgramDecoder::new(network).answers_to(&self.test))
        };
        let several = self.combined().filter(|combined| !combined.others.is_empty());
        Some(Scores {
            network: self.errors(),
            network_alone: several.map(|_| alone()),
            baselines: self.baselines.clone()?,
            coverage: self.coverage().to_vec(),
        })
    }
}

/// Describes the defect of a start whose trainings have all ended, with its remedy. Settings that were chosen by
/// cross-validation may end a training that hardly improves on its start; a divergence is a defect even then.
fn defect_of(start: &StartTrainer, is_chosen: bool) -> Option<String> {
    start.stop_reason()?;
    let numbered = start.rows().iter().enumerate();
    let is_judged = |trainer: &Trainer| !is_chosen || trainer.stop_reason() == Some(StopReason::Diverged);
    let numbered = numbered.filter(|(_, trainer)| is_judged(trainer));
    let mut defects = numbered.filter_map(|(index, trainer)| Some((index + 1, trainer.defect()?)));
    let (first, defect) = defects.next()?;
    let (defective, networks) = (1 + defects.count(), start.rows().len());
    Some(match networks {
        1 => defect,
        _ => format!("{defective} of {networks} networks, the first being number {first}: {defect}"),
    })
}

/// Error in preparing a run, an experiment of many runs, or the analysis of a scene.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RunError {
    /// A number is out of range.
    #[error("{what}: {count} is not possible, give from {} to {}", .allowed.start(), .allowed.end())]
    Count {
        /// Name of the setting.
        what: &'static str,
        /// Given number.
        count: usize,
        /// Allowed range.
        allowed: RangeInclusive<usize>,
    },
    /// There are more samples than a run can hold.
    #[error(
        "{training} training and {validation} validation samples, held together as whole snapshots of {rows} rows, are \
         {total}: the limit is {max}; give fewer for validation"
    )]
    TooManySamples {
        /// Number of training samples.
        training: usize,
        /// Number of validation samples.
        validation: usize,
        /// Number of row-wires in a snapshot.
        rows: usize,
        /// Number of samples in whole snapshots.
        total: usize,
        /// Maximum number of samples.
        max: usize,
    },
    /// The sensor is invalid.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Samples cannot be drawn or divided.
    #[error(transparent)]
    Division(#[from] DatasetError),
    /// Samples cannot be scaled, or a decoder cannot be fitted.
    #[error(transparent)]
    Scaling(#[from] NetworkError),
    /// A reading is not a resistance.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The sets do not belong together.
    #[error("the {set} set has {found}, the training set {expected}: give sets of one sensor")]
    Sets {
        /// Name of the set: validation or test.
        set: &'static str,
        /// Channels, targets or row-wires of the set.
        found: String,
        /// Channels, targets or row-wires of the training set.
        expected: String,
    },
    /// The samples do not match the networks.
    #[error(
        "the {set} set has {found}, the networks have {expected}: give samples of the sensor they were trained for"
    )]
    Networks {
        /// Name of the set: training or validation.
        set: &'static str,
        /// Channels, targets or row-wires of the set.
        found: String,
        /// Number in the networks.
        expected: usize,
    },
    /// A row-wire that needs its own network has no samples.
    #[error("row {} has no {set} samples: give samples of every row, or train one network for all rows", .row_wire + 1)]
    RowWithoutSamples {
        /// Row-wire, from 0.
        row_wire: usize,
        /// Name of the set: training, validation or test.
        set: &'static str,
    },
    /// The samples of a simulated run have no row-wires.
    #[error("samples of a simulated sensor need a row-wire: build the set with row-wires, or declare it as measured")]
    NoRowWires,
    /// The sets are described as those of another sensor than that of the settings.
    #[error(
        "the sets are not described as samples of the sensor and scene in the settings: draw them with these settings, or \
         describe them by the problem of their simulation"
    )]
    OtherSensor,
    /// The samples of a recording cannot be drawn.
    #[error("samples of a recording are read, not drawn: import its files, or give the settings of a simulated array")]
    NotDrawn,
    /// A training cannot begin.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// The run would take more memory than it may use.
    #[error(
        "this would take about {:.1} GB of memory, and {memory}: use fewer samples, hidden nodes or restarts, or the scaled \
         conjugate gradient (scg)",
        *.bytes as f64 * 1e-9
    )]
    Memory {
        /// Memory needed, in bytes.
        bytes: u64,
        /// Memory that it may use.
        memory: MemoryBudget,
    },
    /// The caller cancelled the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A saved training cannot be resumed.
    #[error("start {}: {source}", .start + 1)]
    Resume {
        /// Index of the start, from 0.
        start: usize,
        /// Reason given by the trainer.
        source: TrainingError,
    },
    /// The number of saved trainings does not match the settings.
    #[error("{found} saved trainings, but the settings ask for {expected}: starts times networks")]
    Starts {
        /// Number of trainings found.
        found: usize,
        /// Number of trainings expected.
        expected: usize,
    },
    /// No target has enough effective samples for an interval.
    #[error(
        "there are fewer than 9 independent training samples (their errors are correlated in time or within groups)"
    )]
    NoIntervals,
    /// The number of saved intervals is not the number of targets.
    #[error("{} for {}", counted(*.found, "interval"), counted(*.expected, "target"))]
    IntervalCount {
        /// Number of intervals.
        found: usize,
        /// Number of targets.
        expected: usize,
    },
    /// A saved half-width is negative or not finite, or its answers are not ascending.
    #[error("the interval of target {0} is not valid")]
    Interval(usize),
    /// A trial of an experiment failed.
    #[error("seed {seed}: {source}")]
    Trial {
        /// Seed of the trial.
        seed: Seed,
        /// Index of the repeat of a cross-validation, from 0.
        repeat: usize,
        /// Reason for the failure.
        source: Box<RunError>,
    },
    /// An axis of an experiment has no values.
    #[error("there are no values for {0}: give at least one")]
    NoValues(&'static str),
    /// Both axes of an experiment vary the same setting.
    #[error("both axes vary {0}: choose two different ones")]
    SameAxes(&'static str),
    /// Runs on this source do not have the setting that an axis varies.
    #[error("{of} have no setting '{axis}': vary another one")]
    NoSetting {
        /// Name of the setting.
        axis: &'static str,
        /// Source of the samples.
        of: &'static str,
    },
    /// The settings of an experiment are those of another source than the samples.
    #[error("settings and samples have different sources: one is simulated, the other recorded")]
    OtherSamples,
    /// A recording without groups is divided by group.
    #[error("split group: the recording has no column of groups; choose one, or omit this split")]
    NoGroups,
    /// An experiment cross-validates a recording.
    #[error("a recording is divided again for each seed: give seeds instead of a cross-validation")]
    CrossValidation,
    /// An experiment has too many trainings.
    #[error("{trainings} trainings: give fewer values, seeds or repeats, so that there are at most {max}")]
    TooManyTrainings {
        /// Number of trainings.
        trainings: usize,
        /// Maximum number of trainings.
        max: usize,
    },
    /// The operating system provides no threads.
    #[error("cannot start worker threads: {0}")]
    Threads(String),
}

impl RunError {
    /// Checks that a number is in its range.
    pub(super) fn check_count(what: &'static str, count: usize, allowed: RangeInclusive<usize>) -> Result<(), Self> {
        if allowed.contains(&count) {
            return Ok(());
        }
        Err(Self::Count { what, count, allowed })
    }
}
