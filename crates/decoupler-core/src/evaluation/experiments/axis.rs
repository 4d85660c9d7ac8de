use serde::{Deserialize, Serialize};

use super::Cell;
use crate::{
    dataset::{Seed, SplitBy},
    evaluation::{Simulation, Source},
    network::{Quantity, ScalingChoice},
    sensor::ArrayScale,
    training::Method,
};

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
    /// Relative noise of the resistances.
    Noise(Vec<f64>),
    /// Quantities computed from the resistances.
    Inputs(Vec<Quantity>),
    /// Scalings of the inputs.
    Scaling(Vec<ScalingChoice>),
    /// Training methods with their settings.
    Method(Vec<Method>),
    /// Maximum numbers of epochs.
    Epochs(Vec<usize>),
    /// Numbers of starts.
    Starts(Vec<usize>),
    /// Rules by which a recording is divided.
    Split(Vec<SplitBy>),
    /// Seeds of the run.
    Seed(Vec<Seed>),
}

/// Setting that an axis varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AxisKind {
    /// Number of hidden nodes.
    Hidden,
    /// Array scale.
    Array,
    /// Number of training samples.
    Samples,
    /// Relative noise of the resistances.
    Noise,
    /// Quantity computed from the resistances.
    Inputs,
    /// Scaling of the inputs.
    Scaling,
    /// Training method.
    Method,
    /// Maximum number of epochs.
    Epochs,
    /// Number of starts.
    Starts,
    /// Rule by which a recording is divided.
    Split,
    /// Seed.
    Seed,
}

impl AxisKind {
    /// All settings, in the order offered to the user.
    pub const ALL: [Self; 11] = [
        Self::Hidden,
        Self::Array,
        Self::Samples,
        Self::Noise,
        Self::Inputs,
        Self::Scaling,
        Self::Method,
        Self::Epochs,
        Self::Starts,
        Self::Split,
        Self::Seed,
    ];

    /// Returns the settings of runs on `source`, in the order offered to the user.
    pub fn of_source(source: &Source) -> impl Iterator<Item = Self> + use<> {
        let is_simulated = source.simulation().is_some();
        Self::ALL.into_iter().filter(move |kind| match kind {
            Self::Array | Self::Samples | Self::Noise | Self::Inputs => is_simulated,
            Self::Split => !is_simulated,
            Self::Hidden | Self::Scaling | Self::Method | Self::Epochs | Self::Starts | Self::Seed => true,
        })
    }

    /// Name of the setting.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hidden => "hidden nodes",
            Self::Array => "array",
            Self::Samples => "samples",
            Self::Noise => "noise",
            Self::Inputs => "inputs",
            Self::Scaling => "scaling",
            Self::Method => "method",
            Self::Epochs => "epochs",
            Self::Starts => "starts",
            Self::Split => "split",
            Self::Seed => "seed",
        }
    }
}

impl Axis {
    /// The setting that the axis varies, and its values as text.
    fn described(&self) -> (AxisKind, Vec<String>) {
        fn texts<T: ToString>(values: &[T]) -> Vec<String> {
            values.iter().map(ToString::to_string).collect()
        }
        match self {
            Self::Hidden(values) => (AxisKind::Hidden, texts(values)),
            Self::Array(values) => (AxisKind::Array, texts(values)),
            Self::Samples(values) => (AxisKind::Samples, texts(values)),
            Self::Noise(values) => (AxisKind::Noise, texts(values)),
            Self::Inputs(values) => (AxisKind::Inputs, texts(values)),
            Self::Scaling(values) => (AxisKind::Scaling, texts(values)),
            Self::Method(values) => {
                let names = values.iter().map(|method| method.short_name().to_owned());
                (AxisKind::Method, names.collect())
            }
            Self::Epochs(values) => (AxisKind::Epochs, texts(values)),
            Self::Starts(values) => (AxisKind::Starts, texts(values)),
            Self::Split(values) => (AxisKind::Split, texts(values)),
            Self::Seed(values) => (AxisKind::Seed, texts(values)),
        }
    }

    /// Returns the setting that the axis varies.
    pub fn kind(&self) -> AxisKind {
        self.described().0
    }

    /// Returns the name of the setting.
    pub fn name(&self) -> &'static str {
        self.kind().name()
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.described().1.len()
    }

    /// Returns `true` if there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns value `index` as text.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn label(&self, index: usize) -> String {
        self.described().1.swap_remove(index)
    }

    /// Writes value `index` to `cell`. A validation share that follows from the method is updated for a new method.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub(super) fn apply(&self, index: usize, cell: &mut Cell) {
        let Cell { settings, division, .. } = cell;
        let simulate = |source: &mut Source, change: &dyn Fn(&mut Simulation)| {
            if let Source::Simulated(simulation) = source {
                change(simulation);
            }
        };
        match self {
            Self::Hidden(values) => settings.hidden = values[index],
            Self::Array(values) => simulate(&mut settings.source, &|source| source.sensor.scale = values[index]),
            Self::Samples(values) => simulate(&mut settings.source, &|source| source.samples = values[index]),
            Self::Noise(values) => simulate(&mut settings.source, &|source| {
                source.scene.noise.relative = values[index];
            }),
            Self::Inputs(values) => settings.inputs.quantity = values[index],
            Self::Scaling(values) => settings.inputs.scaling = values[index],
            Self::Method(values) => {
                let usual = settings.validation_fraction();
                settings.training.method = values[index];
                if let Some(division) = division
                    .as_mut()
                    .filter(|division| division.validation_fraction == usual)
                {
                    division.validation_fraction = settings.validation_fraction();
                }
            }
            Self::Epochs(values) => settings.training.stopping.epochs = values[index],
            Self::Starts(values) => settings.starts = values[index],
            Self::Split(values) => {
                if let Some(division) = division {
                    division.by = values[index];
                }
            }
            Self::Seed(values) => settings.seed = values[index],
        }
    }
}
