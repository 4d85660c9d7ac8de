use std::time::Instant;

use faer::Mat;
use ndarray::{Array2, ArrayView2};
use rand::Rng;
use rayon::prelude::*;

use super::{
    Baselines, Initialization, Run, RunError, RunSets, RunSettings, StartTrainer, TrainingSize, run_sets::check_sets,
};
use crate::{
    dataset::{Dataset, Folds, PerRow, Simulation, Split},
    decoupling::ridge,
    job::Job,
    machine::MemoryBudget,
    network::{Inputs, MinMax, Mlp, Shape, nguyen_widrow},
    scene::{NoiseSource, NoisySets},
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
    PerRow::of_rows(settings.source.row_model(), training.row_count(), |row| {
        let of = |set: &Dataset| row.map_or_else(|| set.clone(), |row| set.of_row(row));
        Task::new(settings, &of(training), validation.as_ref().map(of).as_ref(), &of(test))
    })
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

/// Weights of hidden nodes in the linear range of tanh that make a network answer like ridge regression.
///
/// With the singular value decomposition U S Vᵀ of the gains of the map, node k is u_k·(x − x̄), scaled to a standard
/// deviation of [`DEVIATION`], and its output weights are s_k v_k over that scale. All other hidden nodes keep their
/// random weights, and begin with output weights of zero. Training then starts from the regression and adds what it
/// lacks, so that early stopping returns to it where there is nothing to add.
#[derive(Clone, Debug)]
struct LinearStart {
    /// Inputs + 1 × nodes.
    hidden: Array2<f64>,
    /// Nodes × outputs.
    output: Array2<f64>,
    /// Answer to the mean input.
    constant: Vec<f64>,
}

/// Standard deviation of the net input of a linear node: tanh deviates from its argument by 1 % at most there.
const DEVIATION: f64 = 0.15;

/// Number of blocks of consecutive samples that select the penalties.
const BLOCKS: usize = 4;

impl LinearStart {
    /// Fits the regression of scaled `targets` (samples × outputs) on scaled `inputs` (samples × inputs) with up to `nodes`
    /// nodes; `None` if there are too few samples or no solution.
    fn fit(inputs: ArrayView2<'_, f64>, targets: ArrayView2<'_, f64>, nodes: usize) -> Option<Self> {
        let samples = inputs.nrows();
        if samples < 2 * BLOCKS || inputs.ncols() == 0 {
            return None;
        }
        let map = ridge(inputs, targets, &Folds::consecutive(samples, BLOCKS)).ok()?.map;
        let (n, m) = (inputs.ncols(), targets.ncols());
        let mean: Vec<f64> = inputs
            .columns()
            .into_iter()
            .map(|column| column.sum() / samples as f64)
            .collect();
        let gains = Mat::from_fn(n, m, |i, t| map[[i, t]]);
        let svd = gains.thin_svd().ok()?;
        let rank = n.min(m).min(nodes);
        let (mut hidden, mut output) = (Array2::zeros((n + 1, rank)), Array2::zeros((rank, m)));
        for node in 0..rank {
            let direction = svd.U().col(node);
            let project = |row: ndarray::ArrayView1<'_, f64>| {
                let products = row.iter().zip(&mean).zip(direction.iter());
                products.map(|((value, mean), u)| (value - mean) * u).sum::<f64>()
            };
            let square: f64 = inputs.rows().into_iter().map(|row| project(row).powi(2)).sum();
            let deviation = (square / samples as f64).sqrt();
            if deviation.is_nan() || deviation <= 1e-12 {
                continue;
            }
            let scale = DEVIATION / deviation;
            for (i, u) in direction.iter().enumerate() {
                hidden[[i, node]] = scale * u;
                hidden[[n, node]] -= scale * u * mean[i];
            }
            let singular = svd.S().column_vector()[node];
            for t in 0..m {
                output[[node, t]] = singular * svd.V()[(t, node)] / scale;
            }
        }
        let constant =
            |t: usize| map[[n, t]] + mean.iter().enumerate().map(|(i, mean)| mean * map[[i, t]]).sum::<f64>();
        Some(Self {
            hidden,
            output,
            constant: (0..m).map(constant).collect(),
        })
    }

    /// Number of linear nodes in a network with this many hidden nodes; one stays random if there are several.
    fn nodes(hidden: usize) -> usize {
        hidden.saturating_sub(1).max(1)
    }

    /// Replaces the first hidden nodes and all output weights of `mlp`, which has random weights.
    fn apply(&self, mlp: &mut Mlp) {
        let shape = mlp.shape();
        let (w, v) = mlp.weights_mut().split_at_mut(shape.hidden_weights());
        for ((i, node), weight) in self.hidden.indexed_iter() {
            w[i * shape.hidden + node] = *weight;
        }
        v.fill(0.0);
        for ((node, t), weight) in self.output.indexed_iter() {
            v[node * shape.outputs + t] = *weight;
        }
        v[shape.hidden * shape.outputs..].copy_from_slice(&self.constant);
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use ndarray::{Axis, Slice};

    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        network::InputChoice,
        scene::{Noise, RowModel},
    };

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

    #[test]
    fn the_network_answers_like_the_regression() {
        let inputs = Array2::from_shape_fn((100, 4), |(s, i)| ((3 * s + 17 * i * s + i) as f64).sin());
        let targets = Array2::from_shape_fn((100, 3), |(s, t)| {
            0.5 * inputs[[s, t]] - 0.2 * inputs[[s, 3]] + 0.1 * t as f64
        });
        let shape = Shape {
            inputs: 4,
            hidden: 6,
            outputs: 3,
        };
        let mut mlp = nguyen_widrow(shape, &mut Seed(1).rng(Stream::Start));
        let start = LinearStart::fit(inputs.view(), targets.view(), LinearStart::nodes(6)).unwrap();
        start.apply(&mut mlp);
        let worst = (&mlp.forward(inputs.view()) - &targets)
            .iter()
            .fold(0.0_f64, |worst, error| worst.max(error.abs()));
        assert!(worst < 0.02, "{worst}");
    }
}
