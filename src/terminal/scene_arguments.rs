use clap::Args;

use super::{count, failure::Failure, interruption::check_same, number};
use decoupler_core::{
    dataset::Simulation,
    decoupling::DecoderKind,
    evaluation::{Preset, RunSettings},
    network::{InputChoice, Quantity, ScalingChoice},
    scene::{Loading, Movement, Noise, NoisySets, RowModel, Rows, Scene},
    text::Named,
};

// Rows, movement, loading and noise of the scene, and its decoders. Arguments that are not given have the values of the
// preset.
#[derive(Args)]
pub(super) struct SceneArguments {
    /// Settings that other arguments start from: those of the paper, or the best ones measured [default: paper]
    #[arg(long, value_name = "paper|best", value_parser = Preset::parse)]
    pub(super) preset: Option<Preset>,
    /// all: one network for every row; known: one network per row; N: only row N
    #[arg(long, value_name = "all|known|N")]
    rows: Option<Rows>,
    /// Axes along which nodes move
    #[arg(long, value_name = "z|xyz", value_parser = Movement::parse)]
    axes: Option<Movement>,
    /// Loading: random nodes, a smooth random field with this correlation length, or an indenter (:sphere, :flat-punch,
    /// :cylinder, :edge)
    #[arg(long, value_name = "random|smooth:MM|indenter")]
    loading: Option<Loading>,
    /// Quantity that the network reads; for a recording (--data) the columns, separated by commas
    #[arg(long, value_name = "resistance|conductance|log", value_delimiter = ',')]
    inputs: Vec<String>,
    /// Scaling of the inputs: each to its range, or whitened principal components
    #[arg(long, value_name = "minmax|whiten", value_parser = ScalingChoice::parse)]
    pub(super) scaling: Option<ScalingChoice>,
    /// Noise of each reading (standard deviation), relative to the reading
    #[arg(long, value_name = "REL", value_parser = number, value_delimiter = ',')]
    pub(super) noise: Vec<f64>,
    /// Noise of each reading (standard deviation) in ohm
    #[arg(long, value_name = "OHM", value_parser = number)]
    noise_ohm: Option<f64>,
    /// Resolution of the analogue-to-digital converter, in bits
    #[arg(long, value_name = "N", value_parser = count(1..=Noise::MAX_BITS as usize))]
    adc_bits: Option<usize>,
    /// Gain error shared by all readings of a snapshot, e.g. from temperature (standard deviation, relative)
    #[arg(long, value_name = "REL", value_parser = number)]
    drift: Option<f64>,
    /// Samples to which noise is added [default: both]
    #[arg(long, value_name = "both|training|test", value_parser = noisy_sets)]
    noise_in: Option<NoisySets>,
    /// Decoders to use, separated by commas: mean, ridge, network, rbf, fuzzy, newton, polish
    #[arg(long, value_name = "NAME", value_delimiter = ',', value_parser = DecoderKind::parse)]
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
    /// Settings of the preset with the given scene and inputs, at the first given noise.
    pub(super) fn settings(&self) -> Result<RunSettings, Failure> {
        self.settings_at(self.preset.unwrap_or_default(), self.noise.first().copied())
    }

    /// Settings of the preset on this simulated array, with the given scene and inputs.
    pub(super) fn settings_on(&self, source: Simulation) -> Result<RunSettings, Failure> {
        let settings = RunSettings {
            source: source.into(),
            ..self.preset.unwrap_or_default().settings()
        };
        self.applied(settings, self.noise.first().copied())
    }

    /// Settings of this preset with the given scene and inputs, at this relative noise.
    pub(super) fn settings_at(&self, preset: Preset, relative_noise: Option<f64>) -> Result<RunSettings, Failure> {
        let noise = self.noise(Noise::default(), relative_noise);
        self.applied(preset.settings_in(noise), relative_noise)
    }

    /// Checks that at most one noise is given, for commands that take only one.
    pub(super) fn check_one_noise(&self) -> Result<(), Failure> {
        if self.noise.len() > 1 {
            let message = "--noise: give one number here; trade takes several";
            return Err(Failure::Arguments(message.to_owned()));
        }
        Ok(())
    }

    /// Quantity that the network reads, if it is given.
    fn quantity(&self) -> Result<Option<Quantity>, Failure> {
        match &self.inputs[..] {
            [] => Ok(None),
            [name] => {
                let quantity = Quantity::parse(name).map_err(|error| Failure::Arguments(format!("--inputs: {error}")));
                quantity.map(Some)
            }
            _ => {
                let message =
                    "--inputs: columns need --data; give resistance, conductance or log for a simulated sensor";
                Err(Failure::Arguments(message.to_owned()))
            }
        }
    }

    /// Columns read by the network of a recording.
    pub(super) fn columns(&self) -> &[String] {
        &self.inputs
    }

    /// Default settings for a recording, with the given row model and scaling.
    ///
    /// # Errors
    /// Names the first given argument that is only for a simulated array.
    pub(super) fn recorded(&self, has_row_wires: bool) -> Result<RunSettings, Failure> {
        let refuse = |argument: &str, reason: &str| Err(Failure::Arguments(format!("{argument}: {reason}")));
        let scene = "a recording (--data) has no scene; leave it out";
        let noise = "a recording (--data) has its own noise; leave it out";
        let given = [
            (self.preset.is_some(), "--preset", scene),
            (self.axes.is_some(), "--axes", scene),
            (self.loading.is_some(), "--loading", scene),
            (!self.noise.is_empty(), "--noise", noise),
            (self.noise_ohm.is_some(), "--noise-ohm", noise),
            (self.adc_bits.is_some(), "--adc-bits", noise),
            (self.drift.is_some(), "--drift", noise),
            (self.noise_in.is_some(), "--noise-in", noise),
        ];
        if let Some((_, argument, reason)) = given.into_iter().find(|(is_given, ..)| *is_given) {
            return refuse(argument, reason);
        }
        if let Some(kind) = self.decoder.iter().find(|kind| kind.needs_sensor()) {
            let reason =
                "it solves the equations of a simulated array, which a recording (--data) does not have; leave it out";
            return refuse(&format!("--decoder {kind}"), reason);
        }
        let rows = match self.rows {
            None | Some(Rows::All) => RowModel::Shared,
            Some(Rows::Known) if has_row_wires => RowModel::Each,
            Some(Rows::Known) => return refuse("--rows known", "name the column of row-wires with --row-wire"),
            Some(Rows::One(_)) => {
                return refuse(
                    "--rows",
                    "choose one row of a recording with --where, for example \"row=3\"",
                );
            }
        };
        let mut settings = RunSettings::measured(rows);
        settings.inputs.scaling = self.scaling.unwrap_or(settings.inputs.scaling);
        Ok(settings)
    }

    /// Refuses a row model or scaling that differs from `saved`, the settings of a run on a recording.
    pub(super) fn check_resumed(&self, saved: &RunSettings) -> Result<(), Failure> {
        let rows = match saved.source.row_model() {
            RowModel::Shared => Rows::All,
            RowModel::Each => Rows::Known,
        };
        check_same("rows", self.rows, rows)?;
        check_same("scaling", self.scaling, saved.inputs.scaling)
    }

    /// `current` with the given parts of the noise.
    fn noise(&self, current: Noise, relative: Option<f64>) -> Noise {
        let bits = self.adc_bits.and_then(|bits| u8::try_from(bits).ok());
        Noise {
            relative: relative.unwrap_or(current.relative),
            additive_ohm: self.noise_ohm.unwrap_or(current.additive_ohm),
            converter_bits: bits.or(current.converter_bits),
            drift: self.drift.unwrap_or(current.drift),
            sets: self.noise_in.unwrap_or(current.sets),
        }
    }

    /// `current` with the given parts of the scene.
    fn scene(&self, current: &Scene, relative_noise: Option<f64>) -> Result<Scene, Failure> {
        let scene = Scene {
            rows: self.rows.unwrap_or(current.rows),
            movement: self.axes.unwrap_or(current.movement),
            loading: self.loading.unwrap_or(current.loading),
            noise: self.noise(current.noise, relative_noise),
            ..*current
        };
        scene
            .check()
            .map_err(|impossible| Failure::Arguments(impossible.to_string()))?;
        Ok(scene)
    }

    /// `settings` with the given scene and inputs.
    fn applied(&self, mut settings: RunSettings, relative_noise: Option<f64>) -> Result<RunSettings, Failure> {
        settings.inputs.quantity = self.quantity()?.unwrap_or(settings.inputs.quantity);
        settings.inputs.scaling = self.scaling.unwrap_or(settings.inputs.scaling);
        if let Some(Simulation { scene, .. }) = settings.simulation_mut() {
            *scene = self.scene(scene, relative_noise)?;
        }
        Ok(settings)
    }

    /// Names the first given part of the scene or of the inputs that differs from those of a saved run.
    pub(super) fn difference(&self, scene: &Scene, inputs: InputChoice) -> Result<Option<&'static str>, Failure> {
        let (mut asked, mut asked_inputs) = (*scene, inputs);
        if let Some(preset) = self.preset {
            asked.rows = preset.simulation_in(Noise::default()).scene.rows;
            asked_inputs = preset.settings().inputs;
        }
        let asked = self.scene(&asked, self.noise.first().copied())?;
        let quantity = self.quantity()?.unwrap_or(asked_inputs.quantity);
        let differs = [
            (asked.rows != scene.rows, "rows"),
            (asked.movement != scene.movement, "axes"),
            (asked.loading != scene.loading, "loading"),
            (asked.noise != scene.noise, "noise"),
            (quantity != inputs.quantity, "inputs"),
            (
                self.scaling.unwrap_or(asked_inputs.scaling) != inputs.scaling,
                "scaling",
            ),
        ];
        Ok(differs.into_iter().find(|(differs, _)| *differs).map(|(_, what)| what))
    }

    /// The given decoders, or all.
    pub(super) fn decoders(&self) -> Vec<DecoderKind> {
        if self.decoder.is_empty() {
            DecoderKind::ALL.to_vec()
        } else {
            self.decoder.clone()
        }
    }
}
