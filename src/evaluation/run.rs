use std::sync::Arc;

use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Errors, RunError, RunSettings, StartRecord, StartTrainer, reference_errors, starts::lowest, task::Task};
use crate::{
    dataset::{Dataset, Split, Stream, hold_out},
    decoupling::{Decoupler, LinearMap, TrainingMean},
    network::{DecouplingNetwork, Inputs, MinMax, Mlp, Networks, Shape, nguyen_widrow},
    training::{Method, ResumeError, SettingError, StopReason, StoppingRules, Trainer, TrainerState, TrainingError},
};

/// A run: the sets drawn, one training for each start, and what the best network is worth.
///
/// The starts share sets and scaling and differ in their first weights only. The *leader* is the start whose best
/// network has the lowest validation error so far (training error where nothing is held out); the test set never
/// decides.
pub struct Run {
    settings: RunSettings,
    test: Arc<Dataset>,
    /// Of each row-wire that has a network of its own, or of all.
    scalings: Vec<(Inputs, MinMax)>,
    starts: Vec<StartTrainer>,
    baselines: Baselines,
}

/// What stands beside a network in every table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baselines {
    /// Always answering the mean of the training set.
    pub mean: Errors,
    /// The best affine map on resistance.
    pub linear: Errors,
    /// The Bayesian reference, below which no decoder comes: [`reference_errors`]. Absent from older files.
    #[serde(default)]
    pub reference: Option<Errors>,
}

/// The most memory that the equations of all starts may take.
const LARGEST_EQUATIONS_BYTES: usize = 4_000_000_000;

impl Run {
    /// Draws the sets, scales them, starts the networks and measures the baselines.
    ///
    /// # Errors
    /// Settings that are impossible, with the reason.
    pub fn prepare(settings: RunSettings) -> Result<Self, RunError> {
        let (split, test) = Self::draw(&settings)?;
        Self::on_sets(settings, split, test)
    }

    /// As [`Self::prepare`], on sets that come from elsewhere, such as the folds of a cross-validation.
    ///
    /// # Errors
    /// Settings that are impossible, with the reason.
    pub fn on_sets(settings: RunSettings, split: Split, test: Dataset) -> Result<Self, RunError> {
        Self::with_sets(settings, split, test, |tasks| {
            let starts = (0..settings.starts).into_par_iter().map(|number| {
                let mut rng = settings.seed.start_rng(number);
                let begun: Vec<_> = tasks
                    .iter()
                    .map(|task| (task, nguyen_widrow(task.shape, &mut rng)))
                    .collect();
                let rows = begun
                    .into_par_iter()
                    .map(|(task, start)| Trainer::new(start, task.problem.clone(), settings.training));
                Ok(StartTrainer::new(rows.collect::<Result<_, _>>()?))
            });
            starts.collect()
        })
    }

    /// Goes on where the states of all starts were taken from a run of these settings.
    ///
    /// # Errors
    /// Settings that are impossible, or states that are damaged or not theirs.
    pub fn resume(settings: RunSettings, states: Vec<TrainerState>) -> Result<Self, RunError> {
        settings.check_counts()?;
        let networks = settings.model_size()?.networks;
        if states.len() != settings.starts * networks {
            return Err(RunError::Starts {
                found: states.len(),
                expected: settings.starts * networks,
            });
        }
        let (split, test) = Self::draw(&settings)?;
        Self::with_sets(settings, split, test, |tasks| {
            let trainers = states.into_par_iter().enumerate().map(|(number, state)| {
                let (start, task) = (number / networks, &tasks[number % networks]);
                let refused = |source| RunError::Resume { start, source };
                let trainer = Trainer::resume(state, task.problem.clone()).map_err(refused)?;
                if trainer.present().shape() != task.shape {
                    return Err(refused(ResumeError::Damaged("it has another number of hidden nodes")));
                }
                Ok(trainer)
            });
            let mut trainers = trainers.collect::<Result<Vec<_>, RunError>>()?.into_iter();
            let starts = (0..settings.starts).map(|_| StartTrainer::new(trainers.by_ref().take(networks).collect()));
            Ok(starts.collect())
        })
    }

    /// The training and validation set of these settings, and their test set.
    ///
    /// # Errors
    /// Settings that are impossible, with the reason.
    pub fn draw(settings: &RunSettings) -> Result<(Split, Dataset), RunError> {
        settings.check_counts()?;
        settings.training.check().map_err(TrainingError::from)?;
        let test = Self::test_set(settings)?;
        let rows = settings.model_size()?.rows;
        let held_out = settings.validation_samples.div_ceil(rows);
        let drawn = Self::training_set(settings, (settings.samples.div_ceil(rows) + held_out) * rows)?;
        Ok((hold_out(drawn, held_out, &mut settings.seed.rng(Stream::Split)), test))
    }

    /// As many samples as are asked for, drawn and disturbed as those that a network is trained on.
    ///
    /// # Errors
    /// An impossible sensor, scene, or number of samples.
    pub fn training_set(settings: &RunSettings, samples: usize) -> Result<Dataset, RunError> {
        let RunSettings {
            sensor, scene, seed, ..
        } = settings;
        sensor.check()?;
        scene.check()?;
        let mut set = Dataset::simulate(sensor, scene, samples, &mut seed.rng(Stream::Training))?;
        set.disturb(sensor, &scene.noise.in_training(), &mut seed.rng(Stream::TrainingNoise))?;
        Ok(set)
    }

    /// The test set of these settings: what the window shows before anything is trained.
    ///
    /// # Errors
    /// An impossible sensor, scene, or number of samples.
    pub fn test_set(settings: &RunSettings) -> Result<Dataset, RunError> {
        let RunSettings {
            sensor, scene, seed, ..
        } = settings;
        sensor.check()?;
        scene.check()?;
        let mut set = Dataset::simulate(sensor, scene, settings.test_samples, &mut seed.rng(Stream::Test))?;
        set.disturb(sensor, &scene.noise.in_test(), &mut seed.rng(Stream::TestNoise))?;
        Ok(set)
    }

    fn with_sets(
        settings: RunSettings,
        split: Split,
        test: Dataset,
        begin: impl FnOnce(&[Task]) -> Result<Vec<StartTrainer>, RunError>,
    ) -> Result<Self, RunError> {
        settings.check_counts()?;
        let networks = settings.model_size()?.networks;
        let Split { training, validation } = split;
        let stroke_mm = settings.stroke_mm();
        let score = |decoupler: &dyn Decoupler| {
            Errors::measure(&test, &decoupler.decouple(test.resistances_ohm.view()), stroke_mm)
        };
        let baselines = Baselines {
            mean: score(&TrainingMean::fit(&training)),
            linear: score(&LinearMap::fit(&training)?),
            reference: reference(&settings, &test)?,
        };
        let tasks: Vec<Task> = if networks == 1 {
            vec![Task::new(&settings, &training, validation.as_ref(), &test)?]
        } else {
            let of_row = |row| {
                let validation = validation.as_ref().map(|set| set.of_row(row));
                Task::new(&settings, &training.of_row(row), validation.as_ref(), &test.of_row(row))
            };
            (0..networks).map(of_row).collect::<Result<_, _>>()?
        };
        // They are in the tasks, scaled: large sets need not be held twice.
        drop((training, validation));
        let first = &tasks[0];
        let samples = first.problem.training.samples();
        let trainings = settings.starts * networks;
        check_memory(&settings.training.method, first.shape, samples, trainings)?;
        let starts = begin(&tasks)?;
        Ok(Self {
            settings,
            test: Arc::new(test),
            scalings: tasks.into_iter().map(|task| task.scaling).collect(),
            starts,
            baselines,
        })
    }

    /// What was asked for.
    pub fn settings(&self) -> &RunSettings {
        &self.settings
    }

    /// Runs one epoch of every start that has not ended, side by side. Returns why the run has ended, once every
    /// start has. The bits do not depend on the number of threads.
    pub fn step(&mut self) -> Option<StopReason> {
        match self.starts.as_mut_slice() {
            // Stays on this thread, which saves handing it over each epoch.
            [only] => only.step(),
            all => {
                all.par_iter_mut().for_each(|start| {
                    start.step();
                });
                self.stop_reason()
            }
        }
    }

    /// Ends every start by the user's wish.
    pub fn stop(&mut self) {
        self.starts.iter_mut().for_each(StartTrainer::stop);
    }

    /// Why the run has ended, once every start has ended: the leader's reason, or the user's wish if any start could
    /// have gone on.
    pub fn stop_reason(&self) -> Option<StopReason> {
        let reasons = self.starts.iter().map(StartTrainer::stop_reason);
        let reasons: Vec<_> = reasons.collect::<Option<_>>()?;
        if reasons.contains(&StopReason::Stopped) {
            return Some(StopReason::Stopped);
        }
        self.leader().stop_reason()
    }

    /// Goes on with another method from the present weights of every start: [`Trainer::continue_with`].
    ///
    /// # Errors
    /// A setting out of range, or networks too wide for the method; then nothing has changed.
    pub fn continue_with(&mut self, method: Method) -> Result<(), RunError> {
        let rows = self.leader().rows();
        let trainings = rows.len() * self.starts.len();
        let samples = self.settings.samples.div_ceil(rows.len());
        check_memory(&method, rows[0].present().shape(), samples, trainings)?;
        // The starts have the same shapes, so the first is refused or none.
        for start in &mut self.starts {
            start.continue_with(method)?;
        }
        self.settings.training.method = method;
        Ok(())
    }

    /// Changes when every start stops: [`Trainer::set_stopping`].
    ///
    /// # Errors
    /// A setting out of range; then nothing has changed.
    pub fn set_stopping(&mut self, stopping: StoppingRules) -> Result<(), SettingError> {
        for start in &mut self.starts {
            start.set_stopping(stopping)?;
        }
        self.settings.training.stopping = stopping;
        Ok(())
    }

    /// The trainings of all starts.
    pub fn trainers(&self) -> &[StartTrainer] {
        &self.starts
    }

    /// The number of the leader, from 0.
    pub fn leader_number(&self) -> usize {
        lowest(self.starts.iter().map(StartTrainer::best_mse)).unwrap_or(0)
    }

    /// The training of the leader.
    pub fn leader(&self) -> &StartTrainer {
        &self.starts[self.leader_number()]
    }

    /// How each start stands. Costs a decoupling of the test set for each.
    pub fn starts(&self) -> Vec<StartRecord> {
        let record = |trainer: &StartTrainer| {
            let best = trainer.best_records();
            StartRecord {
                train_mse: best.training_mse,
                validation_mse: best.validation_mse,
                z_percent: self.test_errors(&self.network_of(trainer)).1.z_percent,
                epochs: trainer.latest().epoch,
                best_epoch: trainer.best_epoch(),
                stop_reason: trainer.stop_reason(),
            }
        };
        self.starts.par_iter().map(record).collect()
    }

    /// The states of all trainings, from which [`Self::resume`] goes on: start by start, in each its rows.
    pub fn states(&self) -> Vec<TrainerState> {
        self.starts.iter().flat_map(StartTrainer::states).collect()
    }

    /// The test set.
    pub fn test(&self) -> &Arc<Dataset> {
        &self.test
    }

    /// The baselines on the test set.
    pub fn baselines(&self) -> &Baselines {
        &self.baselines
    }

    /// The leader's best networks so far, ready to read resistances.
    pub fn network(&self) -> Networks {
        self.network_of(self.leader())
    }

    fn network_of(&self, start: &StartTrainer) -> Networks {
        let rows = self.scalings.iter().zip(start.best());
        let network = |((inputs, outputs), mlp): (&(Inputs, MinMax), &Mlp)| {
            DecouplingNetwork::new(inputs.clone(), mlp.clone(), outputs.clone())
        };
        Networks::new(rows.map(network).collect())
    }

    /// What [`Self::network`] makes of the test set: coordinates in millimetres (samples × 3·M2) and their errors.
    pub fn decouple_test(&self) -> (Array2<f64>, Errors) {
        self.test_errors(&self.network())
    }

    fn test_errors(&self, network: &Networks) -> (Array2<f64>, Errors) {
        let decoupled_mm = network.decouple(self.test.resistances_ohm.view());
        let errors = Errors::measure(&self.test, &decoupled_mm, self.settings.stroke_mm());
        (decoupled_mm, errors)
    }
}

/// The errors of the Bayesian reference on `test`; `None` where rounding hides it.
pub(super) fn reference(settings: &RunSettings, test: &Dataset) -> Result<Option<Errors>, RunError> {
    let RunSettings {
        sensor, scene, seed, ..
    } = settings;
    let rows = scene.rows.read(sensor.scale.rows())?;
    Ok(reference_errors(
        sensor,
        scene,
        &rows,
        test,
        &mut seed.rng(Stream::Expectation),
    )?)
}

/// Refuses starts whose equations would not fit into memory together; one alone is the trainer's to judge.
fn check_memory(method: &Method, shape: Shape, samples: usize, starts: usize) -> Result<(), RunError> {
    let bytes = method.equations_bytes(shape, samples).saturating_mul(starts);
    if starts > 1 && bytes > LARGEST_EQUATIONS_BYTES {
        return Err(RunError::TooManyStarts { starts, bytes });
    }
    Ok(())
}
