use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Measured, PublishedErrors, Simulation, Source};
use crate::{
    dataset::{LARGEST_SAMPLES, Seed},
    network::{InputChoice, LARGEST_HIDDEN},
    scene::Scene,
    sensor::SensorModel,
    training::TrainingSettings,
};

/// Everything a run needs; the same settings (and the same sets, where they were measured) give the same network, bit
/// for bit.
///
/// `S` is where the samples come from: any [`Source`], or [`Simulation`] where only that will do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunSettings<S = Source> {
    /// Where the samples come from.
    pub source: S,
    /// What the network is given of the readings.
    pub inputs: InputChoice,
    /// Hidden nodes.
    pub hidden: usize,
    /// Trainings from different random weights, of which the best by its validation error is kept.
    pub starts: usize,
    /// Method, its settings, and when to stop.
    pub training: TrainingSettings,
    /// From which everything random follows.
    pub seed: Seed,
}

/// Settings of a run on simulated samples.
pub type SimulatedSettings = RunSettings<Simulation>;

/// The most starts of one run: enough to know the distribution of its results, and what memory allows.
pub const MOST_STARTS: usize = 100;

/// A number out of its range.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{what}: {count} is not possible, give from {} to {}", .allowed.start(), .allowed.end())]
pub struct CountError {
    /// What is counted.
    pub what: &'static str,
    /// The number given.
    pub count: usize,
    /// What is possible.
    pub allowed: RangeInclusive<usize>,
}

impl Default for SimulatedSettings {
    /// The paper's main experiment: 10×10_5×30, 12 hidden nodes, 1000 training and 100 test samples.
    fn default() -> Self {
        Self::of(Simulation::default(), InputChoice::PAPER)
    }
}

impl From<Measured> for RunSettings {
    /// Settings for measured samples: readings as they are, between −1 and 1.
    fn from(measured: Measured) -> Self {
        Self::of(measured.into(), InputChoice::MEASURED)
    }
}

impl From<SimulatedSettings> for RunSettings {
    fn from(settings: SimulatedSettings) -> Self {
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

    /// Checks hidden nodes and starts; the other parts check themselves where they are used.
    ///
    /// # Errors
    /// The first count out of range.
    pub fn check_network(&self) -> Result<(), CountError> {
        check([
            ("hidden nodes", self.hidden, 1..=LARGEST_HIDDEN),
            ("starts", self.starts, 1..=MOST_STARTS),
        ])
    }
}

impl RunSettings {
    /// The settings as those of a simulation, if they are.
    pub fn simulated(&self) -> Option<SimulatedSettings> {
        let simulation = self.source.simulation()?;
        Some(self.with_source(*simulation))
    }
}

impl SimulatedSettings {
    /// Checks the counts; the parts check themselves where they are used.
    ///
    /// # Errors
    /// The first count out of range.
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

    /// What the paper reports for this configuration, if it does.
    pub fn published(&self) -> Option<PublishedErrors> {
        let published = PublishedErrors::of(self.source.sensor.scale, self.hidden, self.source.samples);
        published.filter(|_| self.is_papers_scene())
    }

    /// Whether scene and inputs are those of the paper's experiments.
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

/// How settings of a simulation are written: in one record.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    sensor: SensorModel,
    scene: Scene,
    #[serde(default)]
    inputs: InputChoice,
    samples: usize,
    validation_samples: usize,
    test_samples: usize,
    hidden: usize,
    #[serde(default = "one_start")]
    starts: usize,
    training: TrainingSettings,
    seed: Seed,
}

/// Files written before there were several starts.
fn one_start() -> usize {
    1
}

impl Serialize for SimulatedSettings {
    fn serialize<Z: serde::Serializer>(&self, serializer: Z) -> Result<Z::Ok, Z::Error> {
        let Simulation {
            sensor,
            scene,
            samples,
            validation_samples,
            test_samples,
        } = self.source;
        let record = Record {
            sensor,
            scene,
            inputs: self.inputs,
            samples,
            validation_samples,
            test_samples,
            hidden: self.hidden,
            starts: self.starts,
            training: self.training,
            seed: self.seed,
        };
        record.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for SimulatedSettings {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let record = Record::deserialize(deserializer)?;
        Ok(Self {
            source: Simulation {
                sensor: record.sensor,
                scene: record.scene,
                samples: record.samples,
                validation_samples: record.validation_samples,
                test_samples: record.test_samples,
            },
            inputs: record.inputs,
            hidden: record.hidden,
            starts: record.starts,
            training: record.training,
            seed: record.seed,
        })
    }
}
