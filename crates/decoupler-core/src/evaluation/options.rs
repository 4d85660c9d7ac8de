//! The table of settings of a run. Options of the terminal, checks of what is resumed, and printed commands are loops over it.

use super::{MAX_STARTS, RunSettings, Source};
use crate::{
    dataset::{LARGEST_SAMPLES, Simulation},
    network::LARGEST_HIDDEN,
    scene::Noise,
    sensor::{ArrayScale, SensorError, SensorModel},
    settings::{Field, Kind, Method, STOPPING, Setting},
};

/// A setting of a run, as it is offered. Its option, or keyword, is the name with dashes, or underscores, for its spaces.
#[derive(Clone, Copy, Debug)]
pub struct RunOption {
    /// Part of the settings to which it belongs.
    pub part: Part,
    /// Form of the value, for help; empty for a setting that is [rarely](Self::is_rare) changed.
    pub form: &'static str,
    /// Default in words; empty where it follows from a preset.
    pub default: &'static str,
    /// The row: explanation, allowed values, access.
    pub setting: Setting<RunSettings>,
}

impl RunOption {
    /// Returns `true` for a setting that is rarely changed, which has no option of its own: `--set` changes it.
    pub fn is_rare(&self) -> bool {
        self.form.is_empty()
    }
}

/// Part of the settings of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Sensor and numbers of samples of a simulated array.
    Array,
    /// Scene of a simulated array, and inputs of the network.
    Scene,
    /// Network.
    Network,
    /// Method and the rules that end a training, which may change when it is resumed.
    Training,
    /// What is drawn at random.
    Random,
}

pub(super) const SAMPLES: Kind = Kind::Integer(1, LARGEST_SAMPLES as u64);
pub(super) const NOISE: Kind = Kind::Number(0.0, f64::MAX);
pub(super) const HIDDEN: Kind = Kind::Integer(1, LARGEST_HIDDEN as u64);
pub(super) const STARTS: Kind = Kind::Integer(1, MAX_STARTS as u64);

/// Settings of a run except those of its method, in the order in which they are offered and set.
pub static RUN_OPTIONS: [RunOption; 24] = [
    option(
        Part::Array,
        ("array", "SCALE", "10x10_5x30"),
        Kind::Text,
        "Array scale M1xM2_M3xM4: rows x nodes on each, nodes on each column x columns.",
        |run| {
            let sensor = &mut run.simulation_mut()?.sensor;
            let parse = |text: &str| Ok::<_, SensorError>(SensorModel::new(text.parse::<ArrayScale>()?));
            Some(Field::text(sensor.scale.to_string().replace('×', "x"), sensor, parse))
        },
    ),
    option(
        Part::Scene,
        ("rows", "all|known|N", ""),
        Kind::Text,
        "all: one network for every row; known: one network per row; N: only row N.",
        rows,
    ),
    option(
        Part::Scene,
        ("axes", "z|xyz", ""),
        Kind::Choice,
        "Axes along which nodes move.",
        |run| Some(Field::named(&mut run.simulation_mut()?.scene.movement)),
    ),
    option(
        Part::Scene,
        ("loading", "random|smooth:MM|indenter", ""),
        Kind::Text,
        "Loading: random nodes, a smooth random field with this correlation length, or an indenter (:sphere, :flat-punch, \
         :cylinder, :edge).",
        |run| {
            let loading = &mut run.simulation_mut()?.scene.loading;
            Some(Field::text(loading.to_string(), loading, str::parse))
        },
    ),
    option(
        Part::Scene,
        ("inputs", "resistance|conductance|log", ""),
        Kind::Choice,
        "Quantity that the network reads; for a recording the columns, separated by commas.",
        |run| {
            run.simulation()?;
            Some(Field::named(&mut run.inputs.quantity))
        },
    ),
    option(
        Part::Scene,
        ("scaling", "minmax|whiten", ""),
        Kind::Choice,
        "Scaling of the inputs: each to its range, or whitened principal components.",
        |run| Some(Field::named(&mut run.inputs.scaling)),
    ),
    option(
        Part::Scene,
        ("noise", "REL", "0"),
        NOISE,
        "Noise of each reading (standard deviation), relative to the reading.",
        |run| Some(Field::Number(&mut noise(run)?.relative)),
    ),
    option(
        Part::Scene,
        ("noise ohm", "", "0"),
        NOISE,
        "Noise of each reading (standard deviation) in ohm.",
        |run| Some(Field::Number(&mut noise(run)?.additive_ohm)),
    ),
    option(
        Part::Scene,
        ("adc bits", "", "no rounding"),
        Kind::Integer(1, Noise::MAX_BITS as u64),
        "Resolution of the analogue-to-digital converter, in bits.",
        |run| Some(Field::Optional(&mut noise(run)?.converter_bits)),
    ),
    option(
        Part::Scene,
        ("drift", "", "0"),
        NOISE,
        "Gain error shared by all readings of a snapshot, e.g. from temperature (standard deviation, relative).",
        |run| Some(Field::Number(&mut noise(run)?.drift)),
    ),
    option(
        Part::Scene,
        ("noise in", "", "both"),
        Kind::Choice,
        "Samples to which noise is added.",
        |run| Some(Field::named(&mut noise(run)?.sets)),
    ),
    option(
        Part::Array,
        ("samples", "N", "1000"),
        SAMPLES,
        "Training samples; this and the next two are rounded up to whole snapshots of all rows.",
        |run| Some(Field::Count(&mut run.simulation_mut()?.samples)),
    ),
    option(
        Part::Array,
        ("test samples", "", "100"),
        SAMPLES,
        "Test samples, on which the printed errors are measured.",
        |run| Some(Field::Count(&mut run.simulation_mut()?.test_samples)),
    ),
    option(
        Part::Array,
        ("validation samples", "", "200"),
        Kind::Integer(0, LARGEST_SAMPLES as u64),
        "Validation samples, which select the best weights and end the training; 0 for none.",
        |run| Some(Field::Count(&mut run.simulation_mut()?.validation_samples)),
    ),
    option(Part::Network, ("hidden", "N", "12"), HIDDEN, "Hidden nodes.", |run| {
        Some(Field::Count(&mut run.hidden))
    }),
    option(
        Part::Network,
        ("starts", "N", "1"),
        STARTS,
        "Number of trainings from different random weights, which the setting combine makes one network.",
        |run| Some(Field::Count(&mut run.starts)),
    ),
    option(
        Part::Network,
        ("combine", "", "best"),
        Kind::Choice,
        "How several starts become one network: best keeps the one with the lowest validation error, mean averages their \
         answers.",
        |run| Some(Field::named(&mut run.combine)),
    ),
    option(
        Part::Network,
        ("begin", "", "random"),
        Kind::Choice,
        "Weights with which a training begins: random, or ridge regression with random weights added.",
        |run| Some(Field::named(&mut run.initialization)),
    ),
    option(
        Part::Training,
        ("method", "METHOD", "lm; br for a recording"),
        Kind::Choice,
        "Training method.",
        |run| {
            let current = run.training.method.short_name();
            Some(Field::Text(
                current.to_owned(),
                Box::new(move |text| {
                    let method = Method::named(text).map_err(|error| error.to_string())?;
                    // The current settings of the method are those that suit the samples.
                    if method.short_name() != current {
                        run.choose_method(method);
                    }
                    Ok(())
                }),
            ))
        },
    ),
    stopping::<0>((
        "epochs",
        "N",
        "1000; for a recording 300, or 2000 with a method that follows gradients (scg, rp, gd…)",
    )),
    stopping::<1>(("goal", "", "0")),
    stopping::<2>(("min gradient", "", "1e-7")),
    stopping::<3>((
        "max fail",
        "",
        "6; 100 for a recording with a method that follows gradients",
    )),
    option(
        Part::Random,
        ("seed", "N", "0"),
        Kind::Integer(0, u64::MAX),
        "Seed of all random numbers.",
        |run| Some(Field::Integer(&mut run.seed.0)),
    ),
];

const fn option(
    part: Part,
    (name, form, default): (&'static str, &'static str, &'static str),
    kind: Kind,
    help: &'static str,
    field: fn(&mut RunSettings) -> Option<Field<'_>>,
) -> RunOption {
    RunOption {
        part,
        form,
        default,
        setting: Setting::new(name, kind, help, field),
    }
}

/// Rule number `RULE`, from 0, of those that end a training.
const fn stopping<const RULE: usize>(texts: (&'static str, &'static str, &'static str)) -> RunOption {
    let Setting { kind, help, .. } = STOPPING[RULE];
    option(Part::Training, texts, kind, help, |run| {
        (STOPPING[RULE].field)(&mut run.training.stopping)
    })
}

fn noise(run: &mut RunSettings) -> Option<&mut Noise> {
    Some(&mut run.simulation_mut()?.scene.noise)
}

/// Rows that are read; of a recording, one network for all or one for each.
fn rows(run: &mut RunSettings) -> Option<Field<'_>> {
    Some(match &mut run.source {
        Source::Simulated(Simulation { scene, .. }) => Field::text(scene.rows.to_string(), &mut scene.rows, str::parse),
        Source::Measured { rows } => Field::named(rows),
    })
}
