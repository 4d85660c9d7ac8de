use serde::{Deserialize, Serialize};

use super::Cell;
use crate::{
    dataset::{Seed, Simulation, SplitBy},
    evaluation::RunSettings,
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

    /// Returns the settings of runs with the source of `settings`, in the order offered to the user.
    pub fn of_runs(settings: &RunSettings) -> impl Iterator<Item = Self> + use<> {
        let is_simulated = settings.simulation().is_some();
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
    /// Returns the setting that the axis varies.
    pub fn kind(&self) -> AxisKind {
        match self {
            Self::Hidden(_) => AxisKind::Hidden,
            Self::Array(_) => AxisKind::Array,
            Self::Samples(_) => AxisKind::Samples,
            Self::Noise(_) => AxisKind::Noise,
            Self::Inputs(_) => AxisKind::Inputs,
            Self::Scaling(_) => AxisKind::Scaling,
            Self::Method(_) => AxisKind::Method,
            Self::Epochs(_) => AxisKind::Epochs,
            Self::Starts(_) => AxisKind::Starts,
            Self::Split(_) => AxisKind::Split,
            Self::Seed(_) => AxisKind::Seed,
        }
    }

    /// Returns the name of the setting.
    pub fn name(&self) -> &'static str {
        self.kind().name()
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::Hidden(values) | Self::Samples(values) | Self::Epochs(values) | Self::Starts(values) => values.len(),
            Self::Array(values) => values.len(),
            Self::Noise(values) => values.len(),
            Self::Inputs(values) => values.len(),
            Self::Scaling(values) => values.len(),
            Self::Method(values) => values.len(),
            Self::Split(values) => values.len(),
            Self::Seed(values) => values.len(),
        }
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
        match self {
            Self::Hidden(values) | Self::Samples(values) | Self::Epochs(values) | Self::Starts(values) => {
                values[index].to_string()
            }
            Self::Array(values) => values[index].to_string(),
            Self::Noise(values) => values[index].to_string(),
            Self::Inputs(values) => values[index].to_string(),
            Self::Scaling(values) => values[index].to_string(),
            Self::Method(values) => values[index].short_name().to_owned(),
            Self::Split(values) => values[index].to_string(),
            Self::Seed(values) => values[index].to_string(),
        }
    }

    /// Writes value `index` to `cell`. A validation share that follows from the method is updated for a new method.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub(super) fn apply(&self, index: usize, cell: &mut Cell) {
        let Cell { settings, division, .. } = cell;
        match self {
            Self::Hidden(values) => settings.hidden = values[index],
            Self::Array(_) | Self::Samples(_) | Self::Noise(_) => {
                if let Some(simulation) = settings.simulation_mut() {
                    self.apply_to_simulation(index, simulation);
                }
            }
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

    fn apply_to_simulation(&self, index: usize, simulation: &mut Simulation) {
        match self {
            Self::Array(values) => simulation.sensor.scale = values[index],
            Self::Samples(values) => simulation.samples = values[index],
            Self::Noise(values) => simulation.scene.noise.relative = values[index],
            _ => {}
        }
    }
}
