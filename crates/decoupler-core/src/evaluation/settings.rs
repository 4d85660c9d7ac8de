use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Measured, PublishedErrors, Simulation, Source};
use crate::{
    dataset::{LARGEST_SAMPLES, Seed},
    network::{InputChoice, LARGEST_HIDDEN},
    scene::Scene,
    training::{Method, TrainingSettings},
};

/// Settings of a run. The same settings (and the same sets, if measured) give the same network, bit for bit.
///
/// `S` is the source of the samples: any [`Source`], or [`Simulation`] where only that is possible.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSettings<S = Source> {
    /// Source of the samples.
    pub source: S,
    /// Input quantity and its scaling.
    pub inputs: InputChoice,
    /// Number of hidden nodes.
    pub hidden: usize,
    /// Number of starts: trainings from different random initialisations, the best of which by validation error is
    /// kept.
    pub starts: usize,
    /// Training method, its settings, and the stopping rules.
    pub training: TrainingSettings,
    /// Seed from which all randomness follows.
    pub seed: Seed,
}

/// Settings of a run on simulated samples.
pub type SimulatedSettings = RunSettings<Simulation>;

/// Settings of a run on measured samples.
pub type MeasuredSettings = RunSettings<Measured>;

/// Largest number of starts in a run: enough for the distribution of its results, and within memory.
pub const MAX_STARTS: usize = 100;

/// Error for a number out of its range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{what}: {count} is not possible, give from {} to {}", .allowed.start(), .allowed.end())]
pub struct CountError {
    /// Name of the number.
    pub what: &'static str,
    /// Number given.
    pub count: usize,
    /// Range allowed.
    pub allowed: RangeInclusive<usize>,
}

impl Default for SimulatedSettings {
    /// Returns the paper's main experiment: 10×10_5×30, 12 hidden nodes, 1000 training and 100 test samples.
    fn default() -> Self {
        Self::of(Simulation::default(), InputChoice::PAPER)
    }
}

impl From<Measured> for RunSettings {
    /// Returns the settings for measured samples: raw readings scaled to [−1, 1], and 300 epochs of Bayesian
    /// regularisation for [recordings](Method::recorded_regularization) with nothing held out.
    ///
    /// Recordings are short, noisy, and differ from one stretch to the next, so a validation part in time costs samples
    /// and can end the training by chance: Levenberg-Marquardt stopped by the last fifth of a recording of forces has
    /// errors that vary twofold with the seed, which Bayesian regularisation on all of it has not. It measures the
    /// correlation of neighbouring frames, which tell less than as many independent ones, and gives each class of weights a
    /// strength of its own: with one for all, 20 samples are told worse than by ridge regression. The best of several starts
    /// by their training error gains nothing.
    fn from(measured: Measured) -> Self {
        let mut settings = Self::of(measured.into(), InputChoice::MEASURED);
        settings.training.method = Method::recorded_regularization();
        settings.training.stopping.epochs = 300;
        settings
    }
}

impl From<SimulatedSettings> for RunSettings {
    fn from(settings: SimulatedSettings) -> Self {
        settings.with_source(settings.source.into())
    }
}

impl From<MeasuredSettings> for RunSettings {
    fn from(settings: MeasuredSettings) -> Self {
        settings.with_source(settings.source.into())
    }
}

impl<S> RunSettings<S> {
    fn of(source: S, inputs: InputChoice) -> Self {
        Self {
            source,
            inputs,
            hidden: 12,
            starts: 1,
            training: TrainingSettings::default(),
            seed: Seed::default(),
        }
    }

    fn with_source<T>(&self, source: T) -> RunSettings<T> {
        let &Self {
            source: _,
            inputs,
            hidden,
            starts,
            training,
            seed,
        } = self;
        RunSettings {
            source,
            inputs,
            hidden,
            starts,
            training,
            seed,
        }
    }

    /// Checks the numbers of hidden nodes and starts; the other parts are checked where they are used.
    ///
    /// # Errors
    /// The first number out of range.
    pub fn check_network(&self) -> Result<(), CountError> {
        check([
            ("hidden nodes", self.hidden, 1..=LARGEST_HIDDEN),
            ("starts", self.starts, 1..=MAX_STARTS),
        ])
    }
}

impl RunSettings {
    /// Share of the training samples of a recording to hold out for validation, unless the user says otherwise: a fifth,
    /// or none where the method [needs none](Method::needs_validation).
    pub fn validation_fraction(&self) -> f64 {
        if self.training.method.needs_validation() {
            0.2
        } else {
            0.0
        }
    }

    /// Returns these settings as those of a run on measured samples, if they are.
    pub fn measured(&self) -> Option<MeasuredSettings> {
        match self.source {
            Source::Simulated(_) => None,
            Source::Measured(measured) => Some(self.with_source(measured)),
        }
    }

    /// Returns these settings as those of a simulation, if they are.
    pub fn simulated(&self) -> Option<SimulatedSettings> {
        let simulation = self.source.simulation()?;
        Some(self.with_source(*simulation))
    }
}

impl SimulatedSettings {
    /// Checks all numbers; the other parts are checked where they are used.
    ///
    /// # Errors
    /// The first number out of range.
    pub fn check_counts(&self) -> Result<(), CountError> {
        self.check_network()?;
        check([
            ("training samples", self.source.samples, 1..=LARGEST_SAMPLES),
            (
                "validation samples",
                self.source.validation_samples,
                0..=LARGEST_SAMPLES,
            ),
            ("test samples", self.source.test_samples, 1..=LARGEST_SAMPLES),
        ])
    }

    /// Returns the errors that the paper reports for this configuration, if there are any.
    pub fn published(&self) -> Option<PublishedErrors> {
        let published = PublishedErrors::of(self.source.sensor.scale, self.hidden, self.source.samples);
        published.filter(|_| self.is_papers_scene())
    }

    /// Returns `true` if scene and inputs are those of the paper's experiments.
    pub fn is_papers_scene(&self) -> bool {
        self.source.scene == Scene::default() && self.inputs == InputChoice::PAPER
    }
}

fn check<const N: usize>(counts: [(&'static str, usize, RangeInclusive<usize>); N]) -> Result<(), CountError> {
    match counts.into_iter().find(|(_, count, allowed)| !allowed.contains(count)) {
        Some((what, count, allowed)) => Err(CountError { what, count, allowed }),
        None => Ok(()),
    }
}
