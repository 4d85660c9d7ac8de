use std::mem::discriminant;

use serde::{Deserialize, Serialize};

use crate::{dataset::Seed, evaluation::SimulatedSettings, sensor::ArrayScale, training::Method};

/// A setting that an experiment varies, with its values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// Numbers of hidden nodes.
    Hidden(Vec<usize>),
    /// Array scales.
    Array(Vec<ArrayScale>),
    /// Numbers of training samples; in a cross-validation, of all samples.
    Samples(Vec<usize>),
    /// Training methods with their settings.
    Method(Vec<Method>),
    /// Largest numbers of epochs.
    Epochs(Vec<usize>),
    /// Seeds of the run.
    Seed(Vec<Seed>),
}

impl Axis {
    /// Returns the name of the setting.
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

    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::Hidden(values) | Self::Samples(values) | Self::Epochs(values) => values.len(),
            Self::Array(values) => values.len(),
            Self::Method(values) => values.len(),
            Self::Seed(values) => values.len(),
        }
    }

    /// Returns `true` if there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns `true` if both vary the same setting.
    pub(super) fn is_same_kind(&self, other: &Self) -> bool {
        discriminant(self) == discriminant(other)
    }

    /// Returns value `index` as text.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn label(&self, index: usize) -> String {
        match self {
            Self::Hidden(values) | Self::Samples(values) | Self::Epochs(values) => values[index].to_string(),
            Self::Array(values) => values[index].to_string(),
            Self::Method(values) => values[index].short_name().to_owned(),
            Self::Seed(values) => values[index].to_string(),
        }
    }

    /// Writes value `index` to `settings`.
    ///
    /// # Panics
    /// If `index` is out of range.
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
