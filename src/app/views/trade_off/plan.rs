use crate::{
    decoupling::DecoderKind,
    evaluation::{Preset, SimulatedSettings},
    scene::{Noise, Scene},
};

/// A measurement as it is run.
#[derive(Clone, Debug, PartialEq)]
pub struct TradePlan {
    /// Sensor, scene and seed.
    pub base: SimulatedSettings,
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
    pub fn settings(&self, preset: Preset, noise: f64) -> SimulatedSettings {
        let noise = Noise {
            relative: noise,
            ..self.base.source.scene.noise
        };
        let mut settings = preset.settings_in(noise);
        settings.source.sensor = self.base.source.sensor;
        settings.seed = self.base.seed;
        settings.source.scene = Scene {
            rows: settings.source.scene.rows,
            noise,
            ..self.base.source.scene
        };
        settings.source.test_samples = self.test_samples;
        if let Some((samples, epochs)) = self.at_most {
            settings.source.samples = settings.source.samples.min(samples);
            settings.source.validation_samples = settings
                .source
                .validation_samples
                .min(settings.source.samples.div_ceil(5));
            settings.training.stopping.epochs = settings.training.stopping.epochs.min(epochs);
        }
        settings
    }

    /// How many points it has.
    pub fn points(&self) -> usize {
        let of_decoder = |kind: &DecoderKind| {
            let networks = if kind.needs_network() { self.hidden.len() } else { 1 };
            networks * kind.precisions().len()
        };
        let of_preset: usize = self.decoders.iter().map(of_decoder).sum();
        self.noises.len() * self.presets.len() * of_preset
    }
}
