use std::{fmt, str::FromStr};

use thiserror::Error;

use super::{SimulatedSettings, Simulation};
use crate::{
    network::InputChoice,
    scene::{Noise, Rows, Scene},
    training::{StoppingRules, TrainingSettings},
};

/// Preset settings of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// As in the paper: one network for all rows, resistances scaled to [−1, 1].
    #[default]
    Paper,
    /// The best settings measured: known rows, whitened conductances, more samples, and later early stopping.
    Best,
}

/// Error for a word that names no preset.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{0}' is not a preset: give paper or best")]
pub struct PresetError(String);

impl Preset {
    /// All presets, in the order offered to the user.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Best];

    /// Returns the settings of the preset, without noise.
    pub fn settings(self) -> SimulatedSettings {
        self.settings_in(Noise::default())
    }

    /// Returns the settings of the preset for readings with `noise`. Accuracy then depends on the number of samples,
    /// and few epochs suffice.
    pub fn settings_in(self, noise: Noise) -> SimulatedSettings {
        let mut paper = SimulatedSettings::default();
        paper.source.scene.noise = noise;
        let (samples, validation_samples, epochs) = if noise.is_none() {
            (5000, 1000, 1000)
        } else {
            (50_000, 5000, 100)
        };
        match self {
            Self::Paper => paper,
            Self::Best => SimulatedSettings {
                source: Simulation {
                    scene: Scene {
                        rows: Rows::Known,
                        ..paper.source.scene
                    },
                    samples,
                    validation_samples,
                    ..paper.source
                },
                inputs: InputChoice::BEST,
                training: TrainingSettings {
                    stopping: StoppingRules {
                        epochs,
                        max_fail: 30,
                        min_gradient: 0.0,
                        ..paper.training.stopping
                    },
                    ..paper.training
                },
                ..paper
            },
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Paper => "paper",
            Self::Best => "best",
        })
    }
}

impl FromStr for Preset {
    type Err = PresetError;

    fn from_str(text: &str) -> Result<Self, PresetError> {
        let found = Self::ALL.into_iter().find(|preset| preset.to_string() == text.trim());
        found.ok_or_else(|| PresetError(text.to_owned()))
    }
}
