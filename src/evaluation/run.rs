use std::sync::Arc;

use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Errors, RunError, RunSettings, StartRecord, starts::lowest};
use crate::{
    dataset::{Dataset, Split, Stream, hold_out},
    decoupling::{Decoupler, LinearMap, TrainingMean},
    network::{DecouplingNetwork, MinMax, Shape, nguyen_widrow},
    training::{
        Examples, Method, Problem, ResumeError, SettingError, StopReason, StoppingRules, Trainer, TrainerState,
        TrainingError,
    },
};

/// A run: the sets drawn, one training for each start, and what the best network is worth.
///
/// The starts share sets and scaling and differ in their first weights only. The *leader* is the start whose best
/// network has the lowest validation error so far (training error where nothing is held out); the test set never
/// decides.
pub struct Run {
    settings: RunSettings,
    test: Arc<Dataset>,
    inputs: MinMax,
    outputs: MinMax,
    trainers: Vec<Trainer>,
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
        Self::with_sets(settings, split, test, |problem, shape| {
            let start = |number| nguyen_widrow(shape, &mut settings.seed.start_rng(number));
            let trainers = (0..settings.starts).into_par_iter().map(|number| {
                let trainer = Trainer::new(start(number), problem.clone(), settings.training);
                trainer.map_err(RunError::from)
            });
            trainers.collect()
        })
    }

    /// Goes on where the states of all starts were taken from a run of these settings.
    ///
    /// # Errors
    /// Settings that are impossible, or states that are damaged or not theirs.
    pub fn resume(settings: RunSettings, states: Vec<TrainerState>) -> Result<Self, RunError> {
        if states.len() != settings.starts {
            return Err(RunError::Starts {
                found: states.len(),
                expected: settings.starts,
            });
        }
        let (split, test) = Self::draw(&settings)?;
        Self::with_sets(settings, split, test, |problem, shape| {
            let trainers = states.into_par_iter().enumerate().map(|(start, state)| {
                let refused = |source| RunError::Resume { start, source };
                let trainer = Trainer::resume(state, problem.clone()).map_err(refused)?;
                if trainer.present().shape() != shape {
                    return Err(refused(ResumeError::Damaged("it has another number of hidden nodes")));
                }
                Ok(trainer)
            });
            trainers.collect()
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
        let RunSettings {
            sensor, scene, seed, ..
        } = settings;
        let rows = sensor.scale.rows();
        let held_out = settings.validation_samples.div_ceil(rows);
        let drawn = (settings.samples.div_ceil(rows) + held_out) * rows;
        let drawn = Dataset::simulate(sensor, scene, drawn, &mut seed.rng(Stream::Training))?;
        Ok((hold_out(drawn, held_out, &mut seed.rng(Stream::Split)), test))
    }

    /// The test set of these settings: what the window shows before anything is trained.
    ///
    /// # Errors
    /// An impossible sensor, scene, or number of samples.
    pub fn test_set(settings: &RunSettings) -> Result<Dataset, RunError> {
        settings.sensor.check()?;
        settings.scene.check()?;
        let mut rng = settings.seed.rng(Stream::Test);
        Ok(Dataset::simulate(
            &settings.sensor,
            &settings.scene,
            settings.test_samples,
            &mut rng,
        )?)
    }

    fn with_sets(
        settings: RunSettings,
        split: Split,
        test: Dataset,
        trainers: impl FnOnce(&Problem, Shape) -> Result<Vec<Trainer>, RunError>,
    ) -> Result<Self, RunError> {
        settings.check_counts()?;
        let Split { training, validation } = split;
        let stroke_mm = settings.stroke_mm();
        let score = |decoupler: &dyn Decoupler| {
            Errors::measure(&test, &decoupler.decouple(test.resistances_ohm.view()), stroke_mm)
        };
        let baselines = Baselines {
            mean: score(&TrainingMean::fit(&training)),
            linear: score(&LinearMap::fit(&training)?),
        };
        let inputs = MinMax::fit(training.resistances_ohm.view())?;
        let outputs = MinMax::fit(training.coordinates_mm.view())?;
        let examples = |set: &Dataset| {
            let scaled = inputs.scale(set.resistances_ohm.view());
            Examples::new(scaled.view(), outputs.scale(set.coordinates_mm.view()).view())
        };
        let problem = Problem {
            training: examples(&training),
            validation: validation.as_ref().map(examples),
            test: Some(examples(&test)),
        };
        // They are in `problem`, scaled: large sets need not be held twice.
        drop((training, validation));
        let shape = Shape {
            inputs: problem.training.inputs(),
            hidden: settings.hidden,
            outputs: problem.training.outputs(),
        };
        check_memory(
            &settings.training.method,
            shape,
            problem.training.samples(),
            settings.starts,
        )?;
        let trainers = trainers(&problem, shape)?;
        Ok(Self {
            settings,
            test: Arc::new(test),
            inputs,
            outputs,
            trainers,
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
        match self.trainers.as_mut_slice() {
            // Stays on this thread, which saves handing it over each epoch.
            [only] => only.step(),
            all => {
                all.par_iter_mut().for_each(|trainer| {
                    trainer.step();
                });
                self.stop_reason()
            }
        }
    }

    /// Ends every start by the user's wish.
    pub fn stop(&mut self) {
        self.trainers.iter_mut().for_each(Trainer::stop);
    }

    /// Why the run has ended, once every start has ended: the leader's reason, or the user's wish if any start could
    /// have gone on.
    pub fn stop_reason(&self) -> Option<StopReason> {
        let reasons = self.trainers.iter().map(Trainer::stop_reason);
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
        let shape = self.leader().present().shape();
        check_memory(&method, shape, self.settings.samples, self.trainers.len())?;
        // The starts have the same shape, so the first is refused or none.
        for trainer in &mut self.trainers {
            trainer.continue_with(method)?;
        }
        self.settings.training.method = method;
        Ok(())
    }

    /// Changes when every start stops: [`Trainer::set_stopping`].
    ///
    /// # Errors
    /// A setting out of range; then nothing has changed.
    pub fn set_stopping(&mut self, stopping: StoppingRules) -> Result<(), SettingError> {
        for trainer in &mut self.trainers {
            trainer.set_stopping(stopping)?;
        }
        self.settings.training.stopping = stopping;
        Ok(())
    }

    /// The trainings of all starts.
    pub fn trainers(&self) -> &[Trainer] {
        &self.trainers
    }

    /// The number of the leader, from 0.
    pub fn leader_number(&self) -> usize {
        lowest(self.trainers.iter().map(Trainer::best_mse)).unwrap_or(0)
    }

    /// The training of the leader.
    pub fn leader(&self) -> &Trainer {
        &self.trainers[self.leader_number()]
    }

    /// How each start stands. Costs a decoupling of the test set for each.
    pub fn starts(&self) -> Vec<StartRecord> {
        let record = |trainer: &Trainer| {
            let best = trainer.history()[trainer.best_epoch()];
            StartRecord {
                train_mse: best.training_mse,
                validation_mse: best.validation_mse,
                z_percent: self.test_errors(&self.network_of(trainer)).1.z_percent,
                epochs: trainer.latest().epoch,
                best_epoch: trainer.best_epoch(),
                stop_reason: trainer.stop_reason(),
            }
        };
        self.trainers.par_iter().map(record).collect()
    }

    /// The states of all starts, from which [`Self::resume`] goes on.
    pub fn states(&self) -> Vec<TrainerState> {
        self.trainers.iter().map(Trainer::state).collect()
    }

    /// The test set.
    pub fn test(&self) -> &Arc<Dataset> {
        &self.test
    }

    /// The baselines on the test set.
    pub fn baselines(&self) -> &Baselines {
        &self.baselines
    }

    /// The leader's best network so far, ready to read resistances.
    pub fn network(&self) -> DecouplingNetwork {
        self.network_of(self.leader())
    }

    fn network_of(&self, trainer: &Trainer) -> DecouplingNetwork {
        DecouplingNetwork::new(self.inputs.clone(), trainer.best().clone(), self.outputs.clone())
    }

    /// What [`Self::network`] makes of the test set: coordinates in millimetres (samples × 3·M2) and their errors.
    pub fn decouple_test(&self) -> (Array2<f64>, Errors) {
        self.test_errors(&self.network())
    }

    fn test_errors(&self, network: &DecouplingNetwork) -> (Array2<f64>, Errors) {
        let decoupled_mm = network.decouple(self.test.resistances_ohm.view());
        let errors = Errors::measure(&self.test, &decoupled_mm, self.settings.stroke_mm());
        (decoupled_mm, errors)
    }
}

/// Refuses starts whose equations would not fit into memory together; one alone is the trainer's to judge.
fn check_memory(method: &Method, shape: Shape, samples: usize, starts: usize) -> Result<(), RunError> {
    let bytes = method.equations_bytes(shape, samples).saturating_mul(starts);
    if starts > 1 && bytes > LARGEST_EQUATIONS_BYTES {
        return Err(RunError::TooManyStarts { starts, bytes });
    }
    Ok(())
}
