use std::{fmt, str::FromStr};

use thiserror::Error;

use super::{SimulatedSettings, Simulation};
use crate::{
    network::InputChoice,
    scene::{Noise, Rows, Scene},
    training::{StoppingRules, TrainingSettings},
};

/// Where the settings of a run begin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// As the paper: all rows by one network, resistances between −1 and 1.
    #[default]
    Paper,
    /// What measurement found best: known rows, whitened conductances, more samples, more patience.
    Best,
}

/// A word that is none of the presets.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("'{0}' is not a preset: give paper or best")]
pub struct PresetError(String);

impl Preset {
    /// All of them, in the order offered.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Best];

    /// The settings it stands for, without noise.
    pub fn settings(self) -> SimulatedSettings {
        self.settings_in(Noise::default())
    }

    /// The settings it stands for where readings bear `noise`: then a network is as good as its samples are many, and
    /// it has learnt what it can after few epochs.
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
