use std::fmt;

use super::RunSettings;
use crate::{
    dataset::Simulation,
    network::InputChoice,
    scene::{Noise, Rows},
    text::Named,
    training::StoppingRules,
};

/// Preset settings of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// As in the paper: one network for all rows, resistances scaled to [−1, 1].
    #[default]
    Paper,
    /// Best settings found in experiments: known rows, whitened conductances, more samples, and later early stopping.
    Best,
}

impl Preset {
    /// All presets, in the order offered to the user.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Best];

    /// Returns the settings of the preset, without noise.
    pub fn settings(self) -> RunSettings {
        self.settings_in(Noise::default())
    }

    /// Returns the settings of the preset for readings with `noise`. Accuracy then depends on the number of samples,
    /// and few epochs are enough.
    pub fn settings_in(self, noise: Noise) -> RunSettings {
        let mut settings = RunSettings::from(self.simulation_in(noise));
        if self == Self::Best {
            settings.inputs = InputChoice::BEST;
            settings.training.stopping = StoppingRules {
                epochs: if noise.is_none() { 1000 } else { 100 },
                max_fail: 30,
                min_gradient: 0.0,
                ..StoppingRules::default()
            };
        }
        settings
    }

    /// Returns the sensor, the scene and the numbers of samples of [`Self::settings_in`].
    pub fn simulation_in(self, noise: Noise) -> Simulation {
        let mut simulation = Simulation::default();
        simulation.scene.noise = noise;
        if self == Self::Best {
            simulation.scene.rows = Rows::Known;
            let (samples, validation) = if noise.is_none() { (5000, 1000) } else { (50_000, 5000) };
            (simulation.samples, simulation.validation_samples) = (samples, validation);
        }
        simulation
    }
}

impl Named for Preset {
    const WHAT: &'static str = "a preset";
    const ALL: &'static [Self] = &Self::ALL;

    fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Best => "best",
        }
    }
}

impl fmt::Display for Preset {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
