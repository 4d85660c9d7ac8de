//! Synthetic recordings, and runs with settings that were chosen for them.

use decoupler_core::{
    dataset::{Dataset, History, Split, SplitBy},
    evaluation::{
        Run, RunSets, RunSettings,
        auto::{AutoChoice, AutoFixed, AutoSamples, choose_settings},
    },
    job::Job,
    machine::MemoryBudget,
    scene::RowModel,
};
use ndarray::{Array1, Array2, Axis};
use rand::{Rng, RngExt, SeedableRng, rngs::ChaCha8Rng};

/// A generator for a test.
pub(crate) fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// A value of mean 0 and variance 1, nearly normal.
pub(crate) fn normal(rng: &mut impl Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

pub(crate) fn normals(shape: (usize, usize), rng: &mut impl Rng) -> Array2<f64> {
    Array2::from_shape_simple_fn(shape, || normal(rng))
}

/// A slow series of variance 1 in each column, whose correlation falls to 1/e after `length` samples.
pub(crate) fn wandering(shape: (usize, usize), length: f64, rng: &mut impl Rng) -> Array2<f64> {
    let kept = (-1.0 / length).exp();
    let mut series = normals(shape, rng);
    for sample in 1..shape.0 {
        for column in 0..shape.1 {
            let before = series[[sample - 1, column]];
            let new = &mut series[[sample, column]];
            *new = kept * before + (1.0 - kept * kept).sqrt() * *new;
        }
    }
    series
}

/// Smooth responses of sensors: tanh of random combinations of the targets (samples × targets, of about unit size).
pub(crate) fn responses(targets: &Array2<f64>, channels: usize, rng: &mut impl Rng) -> Array2<f64> {
    let weights = normals((targets.ncols(), channels), rng);
    let offsets = Array1::from_shape_simple_fn(channels, || 0.5 * normal(rng));
    (targets.dot(&weights) + offsets).mapv(f64::tanh)
}

/// A recording in order of time, at an interval of 0.1 s if it is timed.
pub(crate) struct Recording {
    pub(crate) readings: Array2<f64>,
    pub(crate) targets: Array2<f64>,
    /// Session of each sample.
    pub(crate) sessions: Vec<usize>,
    pub(crate) by: SplitBy,
    pub(crate) is_timed: bool,
}

impl Recording {
    /// One session without groups.
    pub(crate) fn of_time(readings: Array2<f64>, targets: Array2<f64>) -> Self {
        Self {
            sessions: (0..readings.nrows()).collect(),
            readings,
            targets,
            by: SplitBy::Time,
            is_timed: true,
        }
    }

    pub(crate) fn set(&self) -> Dataset {
        let (readings, targets) = (self.readings.clone(), self.targets.clone());
        Dataset::new(readings, targets, None, self.sessions.clone()).unwrap()
    }

    /// The samples with these numbers.
    pub(crate) fn part(&self, samples: &[usize]) -> Self {
        Self {
            readings: self.readings.select(Axis(0), samples),
            targets: self.targets.select(Axis(0), samples),
            sessions: samples.iter().map(|sample| self.sessions[*sample]).collect(),
            by: self.by,
            is_timed: self.is_timed,
        }
    }

    /// Chooses settings within an estimated `budget_s`.
    pub(crate) fn choose(&self, budget_s: f64) -> AutoChoice {
        let set = self.set();
        let samples = Vec::from_iter(0..set.samples());
        let times_s = self
            .is_timed
            .then(|| samples.iter().map(|sample| 0.1 * *sample as f64).collect());
        let series = Vec::from_iter(self.sessions.iter().map(|session| *session as u64));
        let series = (self.by == SplitBy::Group).then_some(&series[..]);
        let history = History::new(self.readings.clone(), series, None, times_s, samples.clone());
        let samples = AutoSamples {
            set: &set,
            past: Some((&history, &samples)),
            by: self.by,
        };
        let base = RunSettings::measured(RowModel::Shared);
        let (fixed, job) = (AutoFixed::default(), Job::UNINTERRUPTED);
        choose_settings(
            &base,
            &fixed,
            &samples,
            (budget_s, MemoryBudget::UNLIMITED),
            &job,
            &mut |_| (),
        )
        .unwrap()
    }
}

/// Trains on `training` as chosen, without a memory, and returns the finished run with `test` as its test samples.
pub(crate) fn trained(choice: &AutoChoice, training: &Recording, test: &Recording) -> Run {
    assert!(choice.memory.is_empty());
    let split = Split {
        training: training.set(),
        validation: None,
    };
    let sets = RunSets::new(split, test.set());
    let mut run = Run::with_baselines(choice.settings, sets, None, &Job::UNINTERRUPTED).unwrap();
    run.set_combined(Some(choice.combined.clone()));
    run.finish(&Job::UNINTERRUPTED).unwrap();
    run
}

/// Root mean square of the errors of each target, relative to its standard deviation in `truth`.
pub(crate) fn relative_errors(answers: &Array2<f64>, truth: &Array2<f64>) -> Vec<f64> {
    let square = (answers - truth).mapv(|error| error * error);
    let mean_square = square.mean_axis(Axis(0)).unwrap();
    (mean_square / truth.var_axis(Axis(0), 0.0)).mapv(f64::sqrt).to_vec()
}
