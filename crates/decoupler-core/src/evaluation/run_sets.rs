use std::sync::Arc;

use super::{RunError, RunSettings, TrainingSize, Workload};
use crate::{
    dataset::{Dataset, LARGEST_SAMPLES, Seed, Simulation, Split, SplitBy, Stream},
    job::Job,
    machine::MemoryBudget,
    network::Networks,
    problem::Problem,
    scene::{Noise, RowModel},
    training::TrainingError,
};

/// Sets of samples of a run, drawn from a model or recorded.
#[derive(Clone, Debug)]
pub struct RunSets {
    /// Training samples, and those held out for validation.
    pub split: Split,
    /// Test samples.
    pub test: Arc<Dataset>,
    /// Description of the readings and targets.
    pub problem: Arc<Problem>,
    /// Memory that trainings on these sets may use.
    pub memory: MemoryBudget,
}

impl RunSets {
    /// Draws the sets of a simulated array, after a check that samples and trainings fit into `memory`.
    ///
    /// # Errors
    /// If the samples are those of a recording, the settings are invalid, the run does not fit into memory, or the job
    /// is cancelled.
    pub fn draw(settings: &RunSettings, memory: MemoryBudget, job: &Job<'_>) -> Result<Self, RunError> {
        let (source, seed) = (settings.drawn()?, settings.seed);
        settings.check_counts()?;
        settings.training.check().map_err(TrainingError::from)?;
        Workload::of(settings, TrainingSize::drawn(settings)?).check_memory(memory)?;
        let rows = source.rows()?;
        let held_out = source.validation_samples.div_ceil(rows);
        let total = (source.samples.div_ceil(rows) + held_out) * rows;
        if total > LARGEST_SAMPLES {
            return Err(RunError::TooManySamples {
                training: source.samples,
                validation: source.validation_samples,
                rows,
                total,
                max: LARGEST_SAMPLES,
            });
        }
        let test = source.draw_test(seed)?;
        job.check()?;
        let drawn = source.draw_training(total, seed)?;
        job.check()?;
        // Whole snapshots, so that no validation sample was read at the same moment as a training sample.
        let split = SplitBy::Group.hold_out(&drawn, held_out, &mut seed.rng(Stream::Split));
        Ok(Self {
            memory,
            ..Self::new(split, test).described(source.problem())
        })
    }

    /// Returns sets without test samples, for programs that need only the networks. Their training is bit-identical to
    /// that with a test set.
    pub fn without_test(split: Split) -> Self {
        let none = split.training.select(&[]);
        Self::new(split, none)
    }

    /// Returns the sets of a run whose samples are all in memory, without a limit of memory for its trainings.
    pub fn new(split: Split, test: Dataset) -> Self {
        Self {
            problem: Arc::new(Problem::unnamed(test.channels(), test.outputs())),
            split,
            test: Arc::new(test),
            memory: MemoryBudget::UNLIMITED,
        }
    }

    /// Returns the sets with this description of their channels.
    #[must_use]
    pub fn described(self, problem: Problem) -> Self {
        Self {
            problem: Arc::new(problem),
            ..self
        }
    }
}

/// Checks the settings of the networks, and that the sets of a run match each other and these settings.
pub(super) fn check_sets(settings: &RunSettings, sets: &RunSets) -> Result<(), RunError> {
    settings.check_counts()?;
    let training = &sets.split.training;
    if settings.simulation().is_some() && training.row_wires_read().is_none() {
        return Err(RunError::NoRowWires);
    }
    if settings.simulation() != sets.problem.sensor.as_ref() {
        return Err(RunError::OtherSensor);
    }
    let parts = |set: &Dataset| {
        [
            (set.channels().to_string(), " channels"),
            (set.outputs().to_string(), " targets"),
            (describe_rows(set), ""),
        ]
    };
    let validation = sets.split.validation.as_ref().map(|set| ("validation", set));
    for (set, held_out) in validation.into_iter().chain([("test", &*sets.test)]) {
        let mut pairs = parts(held_out).into_iter().zip(parts(training));
        if let Some(((found, what), (expected, _))) = pairs.find(|(found, expected)| found != expected) {
            let found = format!("{found}{what}");
            return Err(RunError::Sets { set, found, expected });
        }
    }
    if settings.source.row_model() == RowModel::Each {
        // A test set may lack a row; the sets that fit a network and select its weights may not.
        for (name, set) in [("training", training)].into_iter().chain(validation) {
            check_rows(set, name)?;
        }
    }
    Ok(())
}

/// Checks that every row-wire read has samples.
fn check_rows(set: &Dataset, name: &'static str) -> Result<(), RunError> {
    let mut has_samples = vec![false; set.row_count()];
    (0..set.samples()).for_each(|sample| has_samples[set.row_index(sample)] = true);
    let Some(row_index) = has_samples.iter().position(|has_samples| !has_samples) else {
        return Ok(());
    };
    let row_wire = set.row_wires_read().map_or(0, |read| read[row_index]);
    Err(RunError::RowWithoutSamples { row_wire, set: name })
}

/// Checks that the sets of a split match `networks`.
pub(super) fn check_networks(networks: &Networks, split: &Split) -> Result<(), RunError> {
    let network = networks.at(0);
    let sets = [
        ("training", Some(&split.training)),
        ("validation", split.validation.as_ref()),
    ];
    for (set, samples) in sets.into_iter().filter_map(|(name, set)| Some((name, set?))) {
        let count = networks.values().len();
        let sizes = [
            ("channels", samples.channels(), network.inputs().channels()),
            ("targets", samples.outputs(), network.outputs().channels()),
            ("row-wires", if count == 1 { 1 } else { samples.row_count() }, count),
        ];
        if let Some((what, found, expected)) = sizes.into_iter().find(|(_, found, expected)| found != expected) {
            return Err(RunError::Networks {
                set,
                found: format!("{found} {what}"),
                expected,
            });
        }
        if count > 1 {
            check_rows(samples, set)?;
        }
    }
    Ok(())
}

/// Lists the row-wires of a set, counted from 1.
fn describe_rows(set: &Dataset) -> String {
    match set.row_wires_read() {
        None => "no row-wires".to_owned(),
        Some(read) => {
            let numbers: Vec<String> = read.iter().map(|row_wire| (row_wire + 1).to_string()).collect();
            format!("the row-wires {}", numbers.join(", "))
        }
    }
}

impl Simulation {
    /// Draws at least `samples` samples with the noise of the training set.
    ///
    /// # Errors
    /// If the sensor, scene, or number of samples is invalid.
    pub(super) fn draw_training(&self, samples: usize, seed: Seed) -> Result<Dataset, RunError> {
        let noise = (self.scene.noise.in_training(), Stream::TrainingNoise);
        self.draw_with(noise, samples, Stream::Training, seed)
    }

    /// Draws the samples of `set`, which [`Self::draw_training`] drew, with the noise of the test set; `None` if the
    /// noise is the same.
    pub(super) fn draw_tested_folds(&self, set: &Dataset, seed: Seed) -> Result<Option<Dataset>, RunError> {
        let noise = self.scene.noise.in_test();
        if noise == self.scene.noise.in_training() {
            return Ok(None);
        }
        let drawn = self.draw_with((noise, Stream::TestNoise), set.samples(), Stream::Training, seed);
        drawn.map(Some)
    }

    /// Draws the test set, also for display before anything is trained.
    ///
    /// # Errors
    /// If the sensor, scene, or number of samples is invalid.
    pub fn draw_test(&self, seed: Seed) -> Result<Dataset, RunError> {
        let noise = (self.scene.noise.in_test(), Stream::TestNoise);
        self.draw_with(noise, self.test_samples, Stream::Test, seed)
    }

    fn draw_with(
        &self,
        (noise, of_noise): (Noise, Stream),
        samples: usize,
        stream: Stream,
        seed: Seed,
    ) -> Result<Dataset, RunError> {
        let Self { sensor, scene, .. } = self;
        sensor.check()?;
        scene.check()?;
        let mut set = Dataset::simulate(sensor, scene, samples, &mut seed.rng(stream))?;
        set.disturb(sensor, &noise, &mut seed.rng(of_noise))?;
        Ok(set)
    }
}
