use crate::{
    evaluation::{DecoderKind, Precision, Preset, RunSettings},
    scene::{Noise, Scene},
};

/// A measurement as it is run.
#[derive(Clone, Debug, PartialEq)]
pub struct TradePlan {
    /// Sensor, scene and seed.
    pub base: RunSettings,
    /// Relative errors of a reading.
    pub noises: Vec<f64>,
    /// Where the settings of the networks begin.
    pub presets: Vec<Preset>,
    /// Hidden nodes.
    pub hidden: Vec<usize>,
    /// Ways of decoding.
    pub decoders: Vec<DecoderKind>,
    /// The most training samples and epochs, if not those of the presets.
    pub at_most: Option<(usize, usize)>,
    /// Samples that errors are measured on.
    pub test_samples: usize,
}

impl TradePlan {
    /// The settings of a preset at a level of noise, in the sensor and the scene of [`Self::base`]. Which rows are read,
    /// and what networks are given of the readings, is the preset's.
    pub fn settings(&self, preset: Preset, noise: f64) -> RunSettings {
        let noise = Noise {
            relative: noise,
            ..self.base.scene.noise
        };
        let mut settings = preset.settings_in(noise);
        settings.sensor = self.base.sensor;
        settings.seed = self.base.seed;
        settings.scene = Scene {
            rows: settings.scene.rows,
            noise,
            ..self.base.scene
        };
        settings.test_samples = self.test_samples;
        if let Some((samples, epochs)) = self.at_most {
            settings.samples = settings.samples.min(samples);
            settings.validation_samples = settings.validation_samples.min(settings.samples.div_ceil(5));
            settings.training.stopping.epochs = settings.training.stopping.epochs.min(epochs);
        }
        settings
    }

    /// How many points it has.
    pub fn points(&self) -> usize {
        let of_decoder = |kind: &DecoderKind| match kind {
            DecoderKind::Network => self.hidden.len() * [Precision::Double, Precision::Single].len(),
            kind if kind.needs_network() => self.hidden.len(),
            _ => 1,
        };
        let of_preset: usize = self.decoders.iter().map(of_decoder).sum();
        self.noises.len() * self.presets.len() * of_preset
    }
}
