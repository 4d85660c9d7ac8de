use std::mem::discriminant;

use serde::{Deserialize, Serialize};

use crate::{dataset::Seed, evaluation::SimulatedSettings, sensor::ArrayScale, training::Method};

/// What an experiment varies, and over which values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// Hidden nodes.
    Hidden(Vec<usize>),
    /// Array scales.
    Array(Vec<ArrayScale>),
    /// Training samples; in a cross-validation, all samples.
    Samples(Vec<usize>),
    /// Methods with their settings.
    Method(Vec<Method>),
    /// Most epochs.
    Epochs(Vec<usize>),
    /// Seeds.
    Seed(Vec<Seed>),
}

impl Axis {
    /// What is varied.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Hidden(_) => "hidden nodes",
            Self::Array(_) => "array",
            Self::Samples(_) => "samples",
            Self::Method(_) => "method",
            Self::Epochs(_) => "epochs",
            Self::Seed(_) => "seed",
        }
    }

    /// How many values there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Hidden(values) | Self::Samples(values) | Self::Epochs(values) => values.len(),
            Self::Array(values) => values.len(),
            Self::Method(values) => values.len(),
            Self::Seed(values) => values.len(),
        }
    }

    /// Whether there is no value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether both vary the same thing.
    pub fn is_same_kind(&self, other: &Self) -> bool {
        discriminant(self) == discriminant(other)
    }

    /// Value `index` in words.
    ///
    /// # Panics
    /// If there are not so many values.
    pub fn label(&self, index: usize) -> String {
        match self {
            Self::Hidden(values) | Self::Samples(values) | Self::Epochs(values) => values[index].to_string(),
            Self::Array(values) => values[index].to_string(),
            Self::Method(values) => values[index].short_name().to_owned(),
            Self::Seed(values) => values[index].to_string(),
        }
    }

    /// Puts value `index` into `settings`.
    ///
    /// # Panics
    /// If there are not so many values.
    pub fn apply(&self, index: usize, settings: &mut SimulatedSettings) {
        match self {
            Self::Hidden(values) => settings.hidden = values[index],
            Self::Array(values) => settings.source.sensor.scale = values[index],
            Self::Samples(values) => settings.source.samples = values[index],
            Self::Method(values) => settings.training.method = values[index],
            Self::Epochs(values) => settings.training.stopping.epochs = values[index],
            Self::Seed(values) => settings.seed = values[index],
        }
    }
}
