use std::sync::Arc;

use ndarray::Array2;
use rayon::prelude::*;

use super::{
    Baselines, Errors, RunError, RunFlaw, RunSettings, SimulatedSettings, StartRecord, StartTrainer, TargetErrors,
    TargetRow,
    baselines::fit_baselines,
    reference_errors,
    sets::check_sets,
    starts::lowest,
    task::{Task, tasks},
    workload::Workload,
};
use crate::{
    dataset::{Dataset, PerRow, Split, Stream},
    decoupling::decode_set,
    network::{DecouplingNetwork, Inputs, MinMax, Mlp, Networks, nguyen_widrow},
    training::{Method, ResumeError, SettingError, StopReason, StoppingRules, Trainer, TrainerState, check_width},
};

/// A run: its sets of samples, one training per restart, and the errors of the best network.
///
/// Restarts share the sets and scalings and differ only in their random initialisation. The *leader* is the restart
/// whose best network has the lowest validation error so far (training error if nothing is held out); the test set
/// never decides.
pub struct Run {
    settings: RunSettings,
    test: Arc<Dataset>,
    scalings: PerRow<(Inputs, MinMax)>,
    starts: Vec<StartTrainer>,
    /// Errors of the training mean and of the linear map, target by target.
    target_baselines: [TargetRow; 2],
    /// Errors of the baselines and the reference on the nodes, if the targets are nodes.
    baselines: Option<Baselines>,
}

/// Errors of networks and baselines on the nodes of a test set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeScores {
    /// Errors of the leader's best networks.
    pub network: Errors,
    /// Errors of the baselines.
    pub baselines: Baselines,
}

impl Run {
    /// Draws and scales the sets, initialises the networks and measures the baselines.
    ///
    /// # Errors
    /// If the settings are invalid.
    pub fn prepare(settings: SimulatedSettings) -> Result<Self, RunError> {
        Workload::of(&settings)?.check_memory()?;
        let (split, test) = settings.draw()?;
        Self::on_sets(settings.into(), split, test)
    }

    /// Prepares a run on existing sets, measured or from a cross-validation; see [`Self::prepare`].
    ///
    /// # Errors
    /// If the settings are invalid, or the sets do not belong together.
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

    /// Resumes a run of these settings from the states of all its trainings.
    ///
    /// # Errors
    /// If the settings are invalid, or the states are damaged or from another run.
    pub fn resume(settings: SimulatedSettings, states: Vec<TrainerState>) -> Result<Self, RunError> {
        settings.check_counts()?;
        check_states(&states, settings.starts * settings.source.model_size()?.networks)?;
        let (split, test) = settings.draw()?;
        Self::resume_on_sets(settings.into(), states, split, test)
    }

    /// Resumes a run on the sets it was started on; see [`Self::resume`].
    ///
    /// # Errors
    /// As [`Self::on_sets`], or if the states are damaged or do not match these settings and sets.
    pub fn resume_on_sets(
        settings: RunSettings,
        states: Vec<TrainerState>,
        split: Split,
        test: Dataset,
    ) -> Result<Self, RunError> {
        Self::with_sets(settings, split, test, |tasks| {
            let networks = tasks.len();
            check_states(&states, settings.starts * networks)?;
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

    fn with_sets(
        settings: RunSettings,
        split: Split,
        test: Dataset,
        begin: impl FnOnce(&[Task]) -> Result<Vec<StartTrainer>, RunError>,
    ) -> Result<Self, RunError> {
        settings.check_network()?;
        check_sets(&settings, &split, &test)?;
        let (mut mean, mut linear) = fit_baselines(&split.training, &settings)?;
        let (mean, linear) = (decode_set(&mut mean, &test)?, decode_set(&mut linear, &test)?);
        let baselines = match settings.simulated() {
            Some(simulated) => {
                let errors = |answers| Errors::measure(&test, answers, simulated.source.stroke_mm());
                Some(Baselines {
                    mean: errors(&mean),
                    linear: errors(&linear),
                    reference: reference(&simulated, &test)?,
                })
            }
            None => None,
        };
        let target_baselines = [("training mean", &mean), ("linear map", &linear)].map(|(name, answers)| TargetRow {
            name,
            targets: TargetErrors::measure(test.targets(), answers.view()),
        });
        let tasks = tasks(&settings, &split, &test)?;
        // The tasks hold the samples scaled; large sets need not be held twice.
        drop(split);
        let first = tasks.at(0);
        let samples = first.problem.training.samples();
        let trainings = settings.starts * tasks.values().len();
        check_width(&settings.training.method, first.shape, samples, trainings)?;
        let starts = begin(tasks.values())?;
        Ok(Self {
            settings,
            test: Arc::new(test),
            scalings: tasks.map(|task| task.scaling.clone()),
            starts,
            target_baselines,
            baselines,
        })
    }

    /// Settings of the run.
    pub fn settings(&self) -> &RunSettings {
        &self.settings
    }

    /// Runs one epoch of every restart that has not ended, in parallel. Returns the reason for stopping once every
    /// restart has ended. Results are bit-identical for any number of threads.
    pub fn step(&mut self) -> Option<StopReason> {
        match self.starts.as_mut_slice() {
            // Stays on this thread, which saves a hand-over every epoch.
            [only] => only.step(),
            all => {
                all.par_iter_mut().for_each(|start| {
                    start.step();
                });
                self.stop_reason()
            }
        }
    }

    /// Stops every restart at the user's request.
    pub fn stop(&mut self) {
        self.starts.iter_mut().for_each(StartTrainer::stop);
    }

    /// Returns the reason for stopping once every restart has ended: the leader's, or [`StopReason::Stopped`] if the
    /// user stopped any restart before its end.
    pub fn stop_reason(&self) -> Option<StopReason> {
        let reasons = self.starts.iter().map(StartTrainer::stop_reason);
        let reasons: Vec<_> = reasons.collect::<Option<_>>()?;
        if reasons.contains(&StopReason::Stopped) {
            return Some(StopReason::Stopped);
        }
        self.leader().stop_reason()
    }

    /// Finds the defect of the leader, once its trainings have ended; `None` for a sound run.
    pub fn flaw(&self) -> Option<RunFlaw> {
        RunFlaw::of(self.leader())
    }

    /// Continues every restart from its present weights with another method: [`Trainer::continue_with`].
    ///
    /// # Errors
    /// If a setting is out of range, or the networks are too wide for the method; nothing is then changed.
    pub fn continue_with(&mut self, method: Method) -> Result<(), RunError> {
        let rows = self.leader().rows();
        let trainings = rows.len() * self.starts.len();
        let samples = rows[0].samples();
        check_width(&method, rows[0].present().shape(), samples, trainings)?;
        // Restarts have the same shapes, so either the first is refused or none.
        for start in &mut self.starts {
            start.continue_with(method)?;
        }
        self.settings.training.method = method;
        Ok(())
    }

    /// Changes the stopping rules of every restart: [`Trainer::set_stopping`].
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

    /// Trainings of all restarts.
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

    /// Returns a record of each restart. Decodes the test set once per restart.
    pub fn starts(&self) -> Vec<StartRecord> {
        let record = |trainer: &StartTrainer| {
            let best = trainer.best_records();
            StartRecord {
                train_mse: best.training_mse,
                validation_mse: best.validation_mse,
                z_percent: self
                    .errors_of(&self.network_of(trainer).decouple(&self.test))
                    .and_then(|errors| errors.z_percent),
                epochs: trainer.latest().epoch,
                best_epoch: trainer.best_epoch(),
                stop_reason: trainer.stop_reason(),
            }
        };
        self.starts.par_iter().map(record).collect()
    }

    /// Returns the states of all trainings for [`Self::resume`]: restart by restart, and in each row by row.
    pub fn states(&self) -> Vec<TrainerState> {
        self.starts.iter().flat_map(StartTrainer::states).collect()
    }

    /// The test set.
    pub fn test(&self) -> &Arc<Dataset> {
        &self.test
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

    /// Returns the errors of answers to the test set (samples × 3·M2, mm) on its nodes; `None` for a measured run.
    pub fn errors_of(&self, answers: &Array2<f64>) -> Option<Errors> {
        let simulation = self.settings.source.simulation()?;
        Some(Errors::measure(&self.test, answers, simulation.stroke_mm()))
    }

    /// Returns the errors of [`Self::network`] and the baselines on the nodes of the test set; `None` for a measured
    /// run, which has [`Self::target_table`].
    pub fn node_scores(&self) -> Option<NodeScores> {
        Some(NodeScores {
            network: self.errors_of(&self.decouple_test())?,
            baselines: self.baselines?,
        })
    }

    /// Errors of the baselines on the nodes of the test set; `None` for a measured run.
    pub fn baselines(&self) -> Option<&Baselines> {
        self.baselines.as_ref()
    }

    /// Returns the errors of the baselines and of [`Self::network`] on each target of the test set, of any meaning.
    pub fn target_table(&self) -> Vec<TargetRow> {
        let mut rows = self.target_baselines.to_vec();
        rows.push(TargetRow {
            name: "network",
            targets: TargetErrors::measure(self.test.targets(), self.decouple_test().view()),
        });
        rows
    }
}

/// Checks the number of saved trainings.
fn check_states(states: &[TrainerState], expected: usize) -> Result<(), RunError> {
    let found = states.len();
    if found == expected {
        Ok(())
    } else {
        Err(RunError::Starts { found, expected })
    }
}

/// The errors of the Bayesian reference on `test`; `None` where a posterior did not converge.
pub(super) fn reference(settings: &SimulatedSettings, test: &Dataset) -> Result<Option<Errors>, RunError> {
    let SimulatedSettings { source, seed, .. } = settings;
    let mut rng = seed.rng(Stream::Expectation);
    Ok(reference_errors(&source.sensor, &source.scene, test, &mut rng)?)
}
