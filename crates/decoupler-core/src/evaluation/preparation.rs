use std::time::Instant;

use rand::Rng;
use rayon::prelude::*;

use super::{
    Baselines, Initialization, Run, RunError, RunSets, RunSettings, SimulatedSettings, Simulation, Source,
    StartTrainer, TestErrors, baselines::fit_baselines, linear_start::LinearStart, run_sets::check_sets,
};
use crate::{
    dataset::{Dataset, PerRow, Split},
    decoupling::{NewtonDecoder, decode_set},
    machine::MemoryBudget,
    network::{Inputs, MinMax, Mlp, Shape, nguyen_widrow},
    scene::{NoiseSource, NoisySets, RowModel},
    training::{Examples, Problem, ResumeError, Trainer, TrainerState, check_width},
};

impl Run {
    /// Draws and scales the sets, initialises the networks and measures the baselines, without a limit of memory.
    ///
    /// # Errors
    /// If the settings are invalid.
    pub fn prepare(settings: SimulatedSettings) -> Result<Self, RunError> {
        whole(Self::prepare_unless(settings, MemoryBudget::UNLIMITED, &|| false))
    }

    /// As [`Self::prepare`], if the run fits into `memory`; returns `None` once `is_cancelled`, which is called between the
    /// parts of the work.
    pub fn prepare_unless(
        settings: SimulatedSettings,
        memory: MemoryBudget,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        match settings.checked_sets_unless(memory, is_cancelled)? {
            Some(sets) => Self::on_unless(settings.into(), sets, is_cancelled),
            None => Ok(None),
        }
    }

    /// Prepares a run on existing sets, recorded or from a cross-validation; see [`Self::prepare`].
    ///
    /// # Errors
    /// If the settings are invalid, or the sets do not belong together.
    pub fn on_sets(settings: RunSettings, split: Split, test: Dataset) -> Result<Self, RunError> {
        whole(Self::on_unless(settings, RunSets::new(split, test), &|| false))
    }

    /// As [`Self::on_sets`]; returns `None` once `is_cancelled`, which is called between the parts of the work.
    pub fn on_unless(
        settings: RunSettings,
        sets: RunSets,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        Self::with_baselines(settings, sets, is_cancelled, |tasks| begin(settings, tasks))
    }

    /// Resumes a run of these settings from the states of all its trainings.
    ///
    /// # Errors
    /// If the settings are invalid, or the states are damaged or from another run.
    pub fn resume(settings: SimulatedSettings, states: Vec<TrainerState>) -> Result<Self, RunError> {
        settings.check_states(&states)?;
        let sets = settings.sets_unless(&|| false)?.expect("nothing cancels it");
        whole(Self::resume_unless(settings.into(), states, sets, &|| false))
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
        whole(Self::resume_unless(
            settings,
            states,
            RunSets::new(split, test),
            &|| false,
        ))
    }

    /// As [`Self::resume_on_sets`]; returns `None` once `is_cancelled`, which is called between the parts of the work.
    pub fn resume_unless(
        settings: RunSettings,
        states: Vec<TrainerState>,
        sets: RunSets,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, RunError> {
        let resumed = Self::with_baselines(settings, sets, is_cancelled, |tasks| resume(settings, states, tasks))?;
        Ok(resumed.map(|mut run| {
            // The total wall time of parallel trainings is not known.
            run.wall_time = match &run.starts[..] {
                [only] if only.rows().len() == 1 => Some(only.elapsed()),
                _ => None,
            };
            run
        }))
    }

    /// Prepares a run with the trainings of `begin`; `None` once `is_cancelled`.
    fn with_baselines(
        settings: RunSettings,
        sets: RunSets,
        is_cancelled: &dyn Fn() -> bool,
        begin: impl FnOnce(&[Task]) -> Result<Vec<StartTrainer>, RunError>,
    ) -> Result<Option<Self>, RunError> {
        let [mean, linear] = mean_and_linear(&settings, &sets)?;
        if is_cancelled() {
            return Ok(None);
        }
        let baselines = Baselines {
            mean,
            linear,
            model_based: model_based(&settings.source, &sets.test)?,
        };
        if is_cancelled() {
            return Ok(None);
        }
        let run = Self::of_networks(settings, sets, is_cancelled, begin)?;
        Ok(run.map(|run| Self {
            baselines: Some(baselines),
            ..run
        }))
    }

    /// Prepares a run without the model-based decoder, and measures the training mean and the linear baseline. Returns
    /// `None` once `is_cancelled`.
    pub(super) fn without_model_based(
        settings: RunSettings,
        sets: RunSets,
        is_cancelled: &dyn Fn() -> bool,
    ) -> Result<Option<(Self, [TestErrors; 2])>, RunError> {
        let measured = mean_and_linear(&settings, &sets)?;
        if is_cancelled() {
            return Ok(None);
        }
        let run = Self::of_networks(settings, sets, is_cancelled, |tasks| begin(settings, tasks))?;
        Ok(run.map(|run| (run, measured)))
    }

    /// Prepares a run of networks only, without baselines, such as the run of a fold.
    pub(super) fn of_networks_on_sets(settings: RunSettings, split: Split, test: Dataset) -> Result<Self, RunError> {
        settings.check_network()?;
        check_sets(&settings, &split, &test)?;
        let sets = RunSets::new(split, test);
        whole(Self::of_networks(settings, sets, &|| false, |tasks| {
            begin(settings, tasks)
        }))
    }

    /// Prepares a run without a test set and baselines, for programs that need only its networks. Their
    /// training is bit-identical to that of [`Self::on_sets`].
    ///
    /// # Errors
    /// As [`Self::on_sets`].
    pub fn on_split(settings: RunSettings, split: Split) -> Result<Self, RunError> {
        let none = split.training.select(&[]);
        Self::of_networks_on_sets(settings, split, none)
    }

    /// As [`Self::with_baselines`], without baselines, for settings and sets that were checked.
    fn of_networks(
        settings: RunSettings,
        RunSets {
            split,
            test,
            problem,
            memory,
        }: RunSets,
        is_cancelled: &dyn Fn() -> bool,
        begin: impl FnOnce(&[Task]) -> Result<Vec<StartTrainer>, RunError>,
    ) -> Result<Option<Self>, RunError> {
        let tasks = tasks(&settings, &split, &test)?;
        // The tasks hold the scaled samples; large sets need not be held twice.
        drop(split);
        let first = tasks.at(0);
        let samples = first.problem.training.samples();
        let trainings = settings.starts * tasks.values().len();
        check_width(&settings.training.method, first.shape, samples, trainings, memory)?;
        if is_cancelled() {
            return Ok(None);
        }
        let begun = Instant::now();
        let starts = begin(tasks.values())?;
        let wall_time = Some(begun.elapsed());
        Ok(Some(Self {
            wall_time,
            settings,
            test,
            problem,
            memory,
            scalings: tasks.map(|task| task.scaling.clone()),
            starts,
            baselines: None,
            intervals: None,
        }))
    }
}

/// Checks settings and sets, and returns the errors of the training mean and of the linear baseline on the test set.
fn mean_and_linear(settings: &RunSettings, RunSets { split, test, .. }: &RunSets) -> Result<[TestErrors; 2], RunError> {
    settings.check_network()?;
    check_sets(settings, split, test)?;
    let (mut mean, mut linear) = fit_baselines(&split.training, settings)?;
    let errors = |answers| TestErrors::measure(&settings.source, test, &answers);
    Ok([
        errors(decode_set(&mut mean, test)?),
        errors(decode_set(&mut linear, test)?),
    ])
}

/// Returns the run of a preparation that cannot be cancelled.
fn whole(prepared: Result<Option<Run>, RunError>) -> Result<Run, RunError> {
    Ok(prepared?.expect("nothing cancels it"))
}

/// Begins trainings from random initialisations.
fn begin(settings: RunSettings, tasks: &[Task]) -> Result<Vec<StartTrainer>, RunError> {
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
            return Err(refused(ResumeError::Damaged("it has another number of hidden nodes")));
        }
        Ok(trainer)
    });
    let mut trainers = trainers.collect::<Result<Vec<_>, RunError>>()?.into_iter();
    let starts = (0..settings.starts).map(|_| StartTrainer::new(trainers.by_ref().take(networks).collect()));
    Ok(starts.collect())
}

impl SimulatedSettings {
    /// Checks these settings and the number of saved trainings, before samples are drawn for them.
    pub fn check_states(&self, states: &[TrainerState]) -> Result<(), RunError> {
        self.check_counts()?;
        check_states(states, self.starts * self.source.model_size()?.networks)
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

/// Returns the errors on `test` of Newton's method with the noise of the scene and mean and covariance of its loading;
/// `None` without a sensor model, and if it would take many minutes.
pub(super) fn model_based(source: &Source, test: &Dataset) -> Result<Option<TestErrors>, RunError> {
    /// Multiplications of a few minutes on one core.
    const MAX_MULTIPLICATIONS: f64 = 2e11;
    /// Usual number of steps per row.
    const STEPS: f64 = 8.0;
    let Source::Simulated(Simulation { sensor, scene, .. }) = source else {
        return Ok(None);
    };
    let rows = test.row_wires_read().expect("samples of a scene know their row-wire");
    let is_each_tried = scene.rows.model() == RowModel::Shared && !scene.noise.in_test().is_none();
    let tried = if is_each_tried { rows.len() } else { 1 };
    let unknowns = (sensor.scale.nodes_per_row() * scene.movement.axes().count()) as f64;
    // QR decomposition of the equations of readings and prior.
    let of_step = 2.0 * unknowns * unknowns * (sensor.scale.columns() as f64 + unknowns);
    if STEPS * of_step * (test.samples() * tried) as f64 > MAX_MULTIPLICATIONS {
        return Ok(None);
    }
    let mut decoder = NewtonDecoder::new(sensor, scene, rows)?;
    let answers = decode_set(&mut decoder, test)?;
    Ok(Some(TestErrors::measure(source, test, &answers)))
}

/// Training problem of one network, for one row-wire or for all.
pub(super) struct Task {
    pub(super) problem: Problem,
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
        let inputs = Inputs::fit(settings.inputs, training.readings(), unseen_noise(&settings.source)?)?;
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
        let problem = Problem {
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
pub(super) fn unseen_noise(source: &Source) -> Result<NoiseSource, RunError> {
    match source {
        Source::Simulated(Simulation { sensor, scene, .. }) if scene.noise.sets == NoisySets::Test => {
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
    use crate::{evaluation::SimulatedSettings, network::InputChoice, scene::Noise};

    /// Returns a run of few samples, cancelled at poll number `poll` of the token, from 0, and the number of polls.
    fn cancelled_at(poll: usize, prepare: &dyn Fn(&dyn Fn() -> bool) -> Option<Run>) -> (Option<Run>, usize) {
        let polls = Cell::new(0);
        let run = prepare(&|| {
            polls.set(polls.get() + 1);
            polls.get() > poll
        });
        (run, polls.get())
    }

    #[test]
    fn a_run_without_a_test_set_trains_the_same_network() {
        let mut settings = SimulatedSettings::default();
        settings.source.sensor.scale = "4x4_2x12".parse().unwrap();
        (settings.hidden, settings.training.stopping.epochs) = (3, 5);
        // More than one block of samples, the last with a single one.
        (settings.source.samples, settings.source.validation_samples) = (1028, 4);
        for inputs in [InputChoice::PAPER, InputChoice::BEST] {
            settings.inputs = inputs;
            let (split, test) = settings.draw().unwrap();
            let split_of_one = Split {
                training: split.training.select(&Vec::from_iter(0..1025)),
                validation: split.validation,
            };
            let mut with_test = Run::on_sets(settings.into(), split_of_one.clone(), test).unwrap();
            let mut without = Run::on_split(settings.into(), split_of_one).unwrap();
            while with_test.step().is_none() {}
            while without.step().is_none() {}
            assert_eq!(with_test.network(), without.network());
            assert_eq!(without.leader().latest().test_mse, None);
        }
    }

    #[test]
    fn blocks_are_scaled_like_all_samples_at_once() {
        let mut settings = SimulatedSettings::default();
        settings.source.samples = 1030;
        let (split, _) = settings.draw().unwrap();
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
        let mut settings = SimulatedSettings::default();
        settings.source.sensor.scale = "4x4_2x12".parse().unwrap();
        (settings.hidden, settings.source.samples, settings.source.test_samples) = (3, 40, 8);
        let whole = Run::prepare(settings).unwrap();
        let (states, answers_mm) = (whole.states(), whole.decouple_test());
        let begun = |is_cancelled: &dyn Fn() -> bool| {
            Run::prepare_unless(settings, MemoryBudget::UNLIMITED, is_cancelled).unwrap()
        };
        let resumed = |is_cancelled: &dyn Fn() -> bool| {
            let sets = settings.sets_unless(is_cancelled).unwrap()?;
            Run::resume_unless(settings.into(), states.clone(), sets, is_cancelled).unwrap()
        };
        for prepare in [&begun as &dyn Fn(&dyn Fn() -> bool) -> Option<Run>, &resumed] {
            let (run, parts) = cancelled_at(usize::MAX, prepare);
            assert_eq!(run.map(|run| run.decouple_test()).as_ref(), Some(&answers_mm));
            assert!(parts >= 4, "polled only {parts} times");
            for part in 0..parts {
                let (run, polls) = cancelled_at(part, prepare);
                assert!(run.is_none() && polls == part + 1, "part {part}: {polls} polls");
            }
        }
    }

    fn inputs(noise: Noise) -> Inputs {
        let mut settings = SimulatedSettings {
            inputs: InputChoice::BEST,
            ..SimulatedSettings::default()
        };
        settings.source.samples = 40;
        settings.source.scene.noise = Noise {
            sets: NoisySets::Test,
            ..noise
        };
        let (split, test) = settings.draw().unwrap();
        let task = Task::new(&settings.into(), &split.training, None, &test).unwrap();
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
