use clap::Args;

use super::{arguments::count, failure::Failure, training_arguments::number};
use crate::{
    evaluation::{DecoderKind, Preset, RunSettings},
    network::{Quantity, ScalingChoice},
    scene::{Loading, Movement, Noise, NoisySets, Rows},
};

// What is read, what moves, how it is loaded, what disturbs it, and how it is decoded. Whatever is not given is as the
// preset has it.
#[derive(Args)]
pub(super) struct SceneArguments {
    /// Where all settings begin, whatever is given beside it: as the paper, or what measurement found best [default: paper]
    #[arg(long, value_name = "paper|best")]
    pub(super) preset: Option<Preset>,
    /// Rows read: all by one network that is not told which; known, one network each; or the number of one
    #[arg(long, value_name = "all|known|N")]
    rows: Option<Rows>,
    /// Axes along which nodes move
    #[arg(long, value_name = "z|xyz")]
    axes: Option<Movement>,
    /// Loading: random nodes, a smooth random field with this correlation length, or an indenter (:sphere, :flat-punch,
    /// :cylinder, :edge)
    #[arg(long, value_name = "random|smooth:MM|indenter")]
    loading: Option<Loading>,
    /// What the network is given of a resistance
    #[arg(long, value_name = "resistance|conductance|log")]
    inputs: Option<Quantity>,
    /// How inputs are scaled: each by its range, or as principal components with regard to noise
    #[arg(long, value_name = "minmax|whiten")]
    scaling: Option<ScalingChoice>,
    /// Noise of each reading (standard deviation), in proportion to it
    #[arg(long, value_name = "REL", value_parser = number, value_delimiter = ',')]
    pub(super) noise: Vec<f64>,
    /// Noise of each reading (standard deviation) in ohm
    #[arg(long, value_name = "OHM", value_parser = number)]
    noise_ohm: Option<f64>,
    /// Bits of the converter that reads resistances
    #[arg(long, value_name = "N", value_parser = count(1..=Noise::MOST_BITS as usize))]
    adc_bits: Option<usize>,
    /// Gain error common to the readings of a moment (standard deviation)
    #[arg(long, value_name = "REL", value_parser = number)]
    drift: Option<f64>,
    /// Which samples noise disturbs [default: both]
    #[arg(long, value_name = "both|training|test", value_parser = noisy_sets)]
    noise_in: Option<NoisySets>,
    /// Decoders to use, separated by commas: mean, ridge, network, rbf, fuzzy, newton, polish
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(super) decoder: Vec<DecoderKind>,
}

fn noisy_sets(text: &str) -> Result<NoisySets, String> {
    match text {
        "both" => Ok(NoisySets::Both),
        "training" => Ok(NoisySets::Training),
        "test" => Ok(NoisySets::Test),
        _ => Err("give both, training or test".to_owned()),
    }
}

impl SceneArguments {
    /// The settings of the preset with the scene and inputs given, at the first noise given.
    pub(super) fn settings(&self) -> Result<RunSettings, Failure> {
        self.settings_at(self.preset.unwrap_or_default(), self.noise.first().copied())
    }

    /// The settings of this preset with the scene and inputs given, at this relative noise.
    pub(super) fn settings_at(&self, preset: Preset, relative_noise: Option<f64>) -> Result<RunSettings, Failure> {
        let noise = self.noise(Noise::default(), relative_noise);
        self.applied(preset.settings_in(noise), relative_noise)
    }

    /// The one noise of commands that take no several.
    pub(super) fn check_one_noise(&self) -> Result<(), Failure> {
        if self.noise.len() > 1 {
            let message = "--noise: give one number here; trade takes several";
            return Err(Failure::Arguments(message.to_owned()));
        }
        Ok(())
    }

    /// `present` with what is given of the noise.
    fn noise(&self, present: Noise, relative: Option<f64>) -> Noise {
        let bits = self.adc_bits.and_then(|bits| u8::try_from(bits).ok());
        Noise {
            relative: relative.unwrap_or(present.relative),
            additive_ohm: self.noise_ohm.unwrap_or(present.additive_ohm),
            converter_bits: bits.or(present.converter_bits),
            drift: self.drift.unwrap_or(present.drift),
            sets: self.noise_in.unwrap_or(present.sets),
        }
    }

    /// `settings` with the scene and inputs given.
    fn applied(&self, mut settings: RunSettings, relative_noise: Option<f64>) -> Result<RunSettings, Failure> {
        let scene = &mut settings.scene;
        scene.rows = self.rows.unwrap_or(scene.rows);
        scene.movement = self.axes.unwrap_or(scene.movement);
        scene.loading = self.loading.unwrap_or(scene.loading);
        scene.noise = self.noise(scene.noise, relative_noise);
        settings.inputs.quantity = self.inputs.unwrap_or(settings.inputs.quantity);
        settings.inputs.scaling = self.scaling.unwrap_or(settings.inputs.scaling);
        scene
            .check()
            .map_err(|impossible| Failure::Arguments(impossible.to_string()))?;
        Ok(settings)
    }

    /// What of the scene is given and is not as in `saved`.
    pub(super) fn difference(&self, saved: &RunSettings) -> Result<Option<&'static str>, Failure> {
        let mut asked = *saved;
        if let Some(preset) = self.preset {
            let of_preset = preset.settings();
            asked.scene.rows = of_preset.scene.rows;
            asked.inputs = of_preset.inputs;
        }
        let asked = self.applied(asked, self.noise.first().copied())?;
        let differs = [
            (asked.scene.rows != saved.scene.rows, "rows"),
            (asked.scene.movement != saved.scene.movement, "axes"),
            (asked.scene.loading != saved.scene.loading, "loading"),
            (asked.scene.noise != saved.scene.noise, "noise"),
            (asked.inputs.quantity != saved.inputs.quantity, "inputs"),
            (asked.inputs.scaling != saved.inputs.scaling, "scaling"),
        ];
        Ok(differs.into_iter().find(|(differs, _)| *differs).map(|(_, what)| what))
    }

    /// The decoders to use: those given, or all.
    pub(super) fn decoders(&self) -> Vec<DecoderKind> {
        if self.decoder.is_empty() {
            DecoderKind::ALL.to_vec()
        } else {
            self.decoder.clone()
        }
    }
}
