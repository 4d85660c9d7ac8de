use std::time::Instant;

use rand::Rng;
use rayon::prelude::*;

use super::{
    Baselines, Initialization, Run, RunError, RunSets, RunSettings, StartTrainer, TrainingSize,
    linear_start::LinearStart, run_sets::check_sets,
};
use crate::{
    dataset::{Dataset, PerRow, Simulation, Split},
    job::Job,
    machine::MemoryBudget,
    network::{Inputs, MinMax, Mlp, Shape, nguyen_widrow},
    scene::{NoiseSource, NoisySets, RowModel},
    training::{ExampleSets, Examples, Trainer, TrainerState, TrainingError, check_width},
};

impl Run {
    /// Draws the sets of a simulated array, measures the baselines, and initialises the networks, without a limit of
    /// memory.
    ///
    /// # Errors
    /// If the settings are invalid or those of a recording.
    pub fn prepare(settings: RunSettings) -> Result<Self, RunError> {
        let sets = RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED)?;
        Self::with_baselines(settings, sets, None, &Job::UNINTERRUPTED)
    }

    /// As [`Self::new`], and measures the baselines.
    ///
    /// # Errors
    /// As [`Self::new`], or if a baseline cannot be fitted.
    pub fn with_baselines(
        settings: RunSettings,
        sets: RunSets,
        states: Option<Vec<TrainerState>>,
        job: &Job<'_>,
    ) -> Result<Self, RunError> {
        let baselines = Baselines::measure(&settings, &sets, job)?;
        let run = Self::new(settings, sets, states, job)?;
        Ok(Self {
            baselines: Some(baselines),
            ..run
        })
    }

    /// Scales the sets and begins the trainings with the [`Initialization`] of the settings, or with the `states` of saved
    /// trainings ([`Self::states`]).
    ///
    /// # Errors
    /// If the settings are invalid, the sets do not belong together, saved trainings are damaged or do not match settings
    /// and sets, the networks are too wide for the memory of the sets, or the job is cancelled.
    pub fn new(
        settings: RunSettings,
        sets: RunSets,
        states: Option<Vec<TrainerState>>,
        job: &Job<'_>,
    ) -> Result<Self, RunError> {
        check_sets(&settings, &sets)?;
        let RunSets {
            split,
            test,
            problem,
            memory,
        } = sets;
        let tasks = tasks(&settings, &split, &test)?;
        // The tasks hold the scaled samples; large sets need not be held twice.
        drop(split);
        let first = tasks.at(0);
        let samples = first.problem.training.samples();
        let trainings = settings.starts * tasks.values().len();
        check_width(&settings.training.method, first.shape, samples, trainings, memory)?;
        job.check()?;
        let begun = Instant::now();
        let is_resumed = states.is_some();
        let starts = match states {
            None => initialize(settings, tasks.values()),
            Some(states) => resume(settings, states, tasks.values()),
        }?;
        let wall_time = match &starts[..] {
            _ if !is_resumed => Some(begun.elapsed()),
            [only] if only.rows().len() == 1 => Some(only.elapsed()),
            // The total wall time of parallel trainings is not known.
            _ => None,
        };
        Ok(Self {
            wall_time,
            settings,
            test,
            problem,
            memory,
            scalings: tasks.map(|task| task.scaling.clone()),
            starts,
            baselines: None,
            combined: None,
            intervals: None,
        })
    }
}

/// Begins trainings from random initialisations.
fn initialize(settings: RunSettings, tasks: &[Task]) -> Result<Vec<StartTrainer>, RunError> {
    let starts = (0..settings.starts).into_par_iter().map(|number| {
        let mut rng = settings.seed.start_rng(number);
        let begun: Vec<_> = tasks.iter().map(|task| (task, task.start(&mut rng))).collect();
        let rows = begun
            .into_par_iter()
            .map(|(task, start)| Trainer::new(start, task.problem.clone(), settings.training));
        Ok(StartTrainer::new(rows.collect::<Result<_, _>>()?))
    });
    starts.collect()
}

/// Resumes trainings from their saved states.
fn resume(settings: RunSettings, states: Vec<TrainerState>, tasks: &[Task]) -> Result<Vec<StartTrainer>, RunError> {
    let networks = tasks.len();
    check_states(&states, settings.starts * networks)?;
    let trainers = states.into_par_iter().enumerate().map(|(number, state)| {
        let (start, task) = (number / networks, &tasks[number % networks]);
        let refused = |source| RunError::Resume { start, source };
        let trainer = Trainer::resume(state, task.problem.clone()).map_err(refused)?;
        if trainer.present().shape() != task.shape {
            return Err(refused(TrainingError::Damaged("it has another number of hidden nodes")));
        }
        Ok(trainer)
    });
    let mut trainers = trainers.collect::<Result<Vec<_>, RunError>>()?.into_iter();
    let starts = (0..settings.starts).map(|_| StartTrainer::new(trainers.by_ref().take(networks).collect()));
    Ok(starts.collect())
}

impl RunSettings {
    /// Checks these settings and the number of saved trainings, before samples are drawn for them.
    pub fn check_states(&self, states: &[TrainerState]) -> Result<(), RunError> {
        self.check_counts()?;
        check_states(states, self.starts * TrainingSize::drawn(self)?.networks)
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

/// Training problem of one network, for one row-wire or for all.
pub(super) struct Task {
    pub(super) problem: ExampleSets,
    pub(super) shape: Shape,
    pub(super) scaling: (Inputs, MinMax),
    /// Weights that replace random ones.
    linear: Option<LinearStart>,
}

impl Task {
    /// Scales the sets into a training problem.
    pub(super) fn new(
        settings: &RunSettings,
        training: &Dataset,
        validation: Option<&Dataset>,
        test: &Dataset,
    ) -> Result<Self, RunError> {
        let inputs = Inputs::fit(
            settings.inputs,
            training.readings(),
            unseen_noise(settings.simulation())?,
        )?;
        let outputs = MinMax::fit(training.targets())?;
        let scaled = |set: &Dataset| (inputs.of(set.readings()), outputs.scale(set.targets()));
        let linear = match settings.initialization {
            Initialization::Random => None,
            Initialization::Ridge => {
                let (x, y) = scaled(training);
                LinearStart::fit(x.view(), y.view(), LinearStart::nodes(settings.hidden))
            }
        };
        let examples = |set: &Dataset| {
            Examples::scaled(
                (set.readings(), |readings| inputs.of(readings)),
                (set.targets(), |targets| outputs.scale(targets)),
            )
        };
        let problem = ExampleSets {
            training: examples(training),
            validation: validation.map(examples),
            // The error on no samples is undefined.
            test: (test.samples() > 0).then(|| examples(test)),
        };
        let shape = Shape {
            inputs: problem.training.inputs(),
            hidden: settings.hidden,
            outputs: problem.training.outputs(),
        };
        Ok(Self {
            problem,
            shape,
            scaling: (inputs, outputs),
            linear,
        })
    }

    /// Returns the weights with which a training begins.
    fn start(&self, rng: &mut impl Rng) -> Mlp {
        let mut mlp = nguyen_widrow(self.shape, rng);
        if let Some(linear) = &self.linear {
            linear.apply(&mut mlp);
        }
        mlp
    }
}

/// Returns the tasks of a run: one, or one per row-wire.
pub(super) fn tasks(settings: &RunSettings, split: &Split, test: &Dataset) -> Result<PerRow<Task>, RunError> {
    let Split { training, validation } = split;
    match settings.source.row_model() {
        RowModel::Shared => Ok(PerRow::shared(Task::new(
            settings,
            training,
            validation.as_ref(),
            test,
        )?)),
        RowModel::Each => {
            let of_row = |row| {
                let validation = validation.as_ref().map(|set| set.of_row(row));
                let (training, test) = (training.of_row(row), test.of_row(row));
                Task::new(settings, &training, validation.as_ref(), &test)
            };
            let tasks = (0..training.row_count()).map(of_row);
            Ok(PerRow::each(tasks.collect::<Result<_, _>>()?))
        }
    }
}

/// Returns the noise of the readings that the training set lacks.
pub(super) fn unseen_noise(sensor: Option<&Simulation>) -> Result<NoiseSource, RunError> {
    match sensor {
        Some(Simulation { sensor, scene, .. }) if scene.noise.sets == NoisySets::Test => {
            Ok(scene.noise.source(sensor)?)
        }
        _ => Ok(NoiseSource::default()),
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use ndarray::{Axis, Slice};

    use super::*;
    use crate::{network::InputChoice, scene::Noise};

    /// Returns a run of few samples, cancelled at poll number `poll` of the token, from 0, and the number of polls.
    fn cancelled_at(poll: usize, prepare: &dyn Fn(&Job<'_>) -> Result<Run, RunError>) -> (Option<Run>, usize) {
        let polls = Cell::new(0);
        let is_cancelled = || {
            polls.set(polls.get() + 1);
            polls.get() > poll
        };
        let run = match prepare(&Job::new(&is_cancelled)) {
            Err(RunError::Cancelled(_)) => None,
            run => Some(run.unwrap()),
        };
        (run, polls.get())
    }

    #[test]
    fn a_run_without_a_test_set_trains_the_same_network() {
        let mut settings = RunSettings::default();
        settings.simulation_mut().unwrap().sensor.scale = "4x4_2x12".parse().unwrap();
        (settings.hidden, settings.training.stopping.epochs) = (3, 5);
        // More than one block of samples, the last with a single one.
        (
            settings.simulation_mut().unwrap().samples,
            settings.simulation_mut().unwrap().validation_samples,
        ) = (1028, 4);
        for inputs in [InputChoice::PAPER, InputChoice::BEST] {
            settings.inputs = inputs;
            let drawn = RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
            let (split, test) = (drawn.split, Dataset::clone(&drawn.test));
            let problem = settings.simulation().unwrap().problem();
            let split_of_one = Split {
                training: split.training.select(&Vec::from_iter(0..1025)),
                validation: split.validation,
            };
            let mut with_test = Run::with_baselines(
                settings,
                RunSets::new(split_of_one.clone(), test).described(problem.clone()),
                None,
                &Job::UNINTERRUPTED,
            )
            .unwrap();
            let mut without = Run::new(
                settings,
                RunSets::without_test(split_of_one).described(problem.clone()),
                None,
                &Job::UNINTERRUPTED,
            )
            .unwrap();
            while with_test.step().is_none() {}
            while without.step().is_none() {}
            assert_eq!(with_test.network(), without.network());
            assert_eq!(without.leader().latest().test_mse, None);
        }
    }

    #[test]
    fn sets_of_another_scene_and_draws_of_a_recording_are_refused() {
        let mut settings = RunSettings {
            hidden: 3,
            ..RunSettings::default()
        };
        let simulation = settings.simulation_mut().unwrap();
        simulation.sensor.scale = "4x4_2x12".parse().unwrap();
        (simulation.samples, simulation.test_samples) = (40, 8);
        let sets = RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
        let begin = |settings| Run::new(settings, sets.clone(), None, &Job::UNINTERRUPTED).map(|_| ());
        assert_eq!(begin(settings), Ok(()));
        settings.simulation_mut().unwrap().scene.largest_compression = 0.1;
        assert_eq!(begin(settings), Err(RunError::OtherSensor));
        let recorded = RunSettings::measured(RowModel::Shared);
        assert_eq!(begin(recorded), Err(RunError::OtherSensor));
        let message = Run::prepare(recorded).err().unwrap().to_string();
        assert!(message.contains("read, not drawn"), "{message}");
    }

    #[test]
    fn blocks_are_scaled_like_all_samples_at_once() {
        let mut settings = RunSettings::default();
        settings.simulation_mut().unwrap().samples = 1030;
        let RunSets { split, .. } = RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
        for choice in [InputChoice::PAPER, InputChoice::BEST] {
            let whole = Inputs::fit(choice, split.training.readings(), NoiseSource::default()).unwrap();
            let all = whole.of(split.training.readings());
            for samples in [1, 2, 3, 7, 512, 513, 825] {
                let some = split.training.select(&Vec::from_iter(0..samples));
                let of_some = whole.of(some.readings());
                assert_eq!(of_some, all.slice_axis(Axis(0), Slice::from(..samples)), "{samples}");
            }
        }
    }

    #[test]
    fn a_cancelled_preparation_ends_at_the_next_part() {
        let mut settings = RunSettings::default();
        settings.simulation_mut().unwrap().sensor.scale = "4x4_2x12".parse().unwrap();
        (
            settings.hidden,
            settings.simulation_mut().unwrap().samples,
            settings.simulation_mut().unwrap().test_samples,
        ) = (3, 40, 8);
        let whole = Run::prepare(settings).unwrap();
        let (states, answers_mm) = (whole.states(), whole.decouple_test());
        for begin in [None, Some(states)] {
            let prepare = |job: &Job<'_>| {
                let sets = RunSets::draw(&settings, MemoryBudget::UNLIMITED, job)?;
                Run::with_baselines(settings, sets, begin.clone(), job)
            };
            let (run, parts) = cancelled_at(usize::MAX, &prepare);
            assert_eq!(run.map(|run| run.decouple_test()).as_ref(), Some(&answers_mm));
            assert!(parts >= 4, "polled only {parts} times");
            for part in 0..parts {
                let (run, polls) = cancelled_at(part, &prepare);
                assert!(run.is_none() && polls == part + 1, "part {part}: {polls} polls");
            }
        }
    }

    fn inputs(noise: Noise) -> Inputs {
        let mut settings = RunSettings {
            inputs: InputChoice::BEST,
            ..RunSettings::default()
        };
        settings.simulation_mut().unwrap().samples = 40;
        settings.simulation_mut().unwrap().scene.noise = Noise {
            sets: NoisySets::Test,
            ..noise
        };
        let RunSets { split, test, .. } =
            RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
        let task = Task::new(&settings, &split.training, None, &test).unwrap();
        task.scaling.0
    }

    #[test]
    fn whitening_accounts_for_every_kind_of_noise_that_the_training_set_lacks() {
        let clean = inputs(Noise::default());
        let noises = [
            Noise::relative(1e-2),
            Noise {
                additive_ohm: 1.0,
                ..Noise::default()
            },
            Noise {
                converter_bits: Some(6),
                ..Noise::default()
            },
            Noise {
                drift: 1e-2,
                ..Noise::default()
            },
        ];
        for noise in noises {
            let sum = |inputs: &Inputs| inputs.affine().1.iter().map(|value| value.abs()).sum::<f64>();
            assert!(sum(&inputs(noise)) < 0.9 * sum(&clean), "{noise:?}");
        }
    }
}
