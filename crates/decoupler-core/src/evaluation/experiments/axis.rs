use serde::{Deserialize, Serialize};

use super::Cell;
use crate::{
    dataset::{Division, LARGEST_SAMPLES, Simulation},
    evaluation::{MAX_STARTS, RunSettings, Source},
    network::LARGEST_HIDDEN,
    settings::{EPOCHS, Field, Kind, Setting, SettingError, Value},
    training::Method,
};

/// A setting that an experiment varies, with its values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    kind: AxisKind,
    values: Vec<Value>,
}

/// Setting that an axis varies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AxisKind {
    /// Number of hidden nodes.
    Hidden,
    /// Array scale.
    Array,
    /// Number of training samples; in a cross-validation, of all samples.
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

/// Rows of the settings of a cell, in the order of [`AxisKind::ALL`].
static ROWS: [Setting<Cell>; 11] = [
    row("hidden nodes", Kind::Integer(1, LARGEST_HIDDEN as u64), |cell| {
        Some(Field::Count(&mut cell.settings.hidden))
    }),
    row("array", Kind::Text, |cell| {
        simulation(cell).map(|source| Field::Text(&mut source.sensor.scale))
    }),
    row("samples", Kind::Integer(1, LARGEST_SAMPLES as u64), |cell| {
        simulation(cell).map(|source| Field::Count(&mut source.samples))
    }),
    row("noise", Kind::Number(0.0, f64::MAX), |cell| {
        simulation(cell).map(|source| Field::Number(&mut source.scene.noise.relative))
    }),
    row("inputs", Kind::Choice, |cell| {
        let is_simulated = simulation(cell).is_some();
        is_simulated.then_some(Field::Text(&mut cell.settings.inputs.quantity))
    }),
    row("scaling", Kind::Choice, |cell| {
        Some(Field::Text(&mut cell.settings.inputs.scaling))
    }),
    row("method", Kind::Choice, |cell| {
        Some(Field::Text(&mut cell.settings.training.method))
    }),
    row(EPOCHS.name, EPOCHS.kind, |cell| {
        (EPOCHS.field)(&mut cell.settings.training.stopping)
    }),
    row("starts", Kind::Integer(1, MAX_STARTS as u64), |cell| {
        Some(Field::Count(&mut cell.settings.starts))
    }),
    row("split", Kind::Choice, |cell| {
        cell.division.as_mut().map(|division| Field::Text(&mut division.by))
    }),
    row("seed", Kind::Integer(0, u64::MAX), |cell| {
        Some(Field::Integer(&mut cell.settings.seed.0))
    }),
];

const fn row(name: &'static str, kind: Kind, field: fn(&mut Cell) -> Option<Field<'_>>) -> Setting<Cell> {
    Setting::new(name, kind, "", field)
}

fn simulation(cell: &mut Cell) -> Option<&mut Simulation> {
    match &mut cell.settings.source {
        Source::Simulated(simulation) => Some(simulation),
        Source::Measured(_) => None,
    }
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

    /// Returns the row of the table of settings.
    pub fn setting(self) -> &'static Setting<Cell> {
        &ROWS[self as usize]
    }

    /// Name of the setting.
    pub fn name(self) -> &'static str {
        self.setting().name
    }

    /// Returns the settings of runs with the source of `settings`, in the order offered to the user.
    pub fn of_runs(settings: &RunSettings) -> impl Iterator<Item = Self> + use<> {
        let mut cell = any_cell();
        cell.settings.source = settings.source;
        cell.division = settings.simulation().is_none().then(Division::default);
        Self::ALL.into_iter().filter(move |kind| kind.setting().applies(&cell))
    }
}

/// Returns a cell that has every setting.
fn any_cell() -> Cell {
    Cell {
        column: 0,
        row: 0,
        settings: RunSettings::default(),
        division: Some(Division::default()),
        published: None,
    }
}

impl Axis {
    /// Creates an axis of integers.
    pub fn integers(kind: AxisKind, values: impl IntoIterator<Item = u64>) -> Self {
        let values = values.into_iter().map(Value::Integer).collect();
        Self { kind, values }
    }

    /// Creates an axis of numbers.
    pub fn numbers(kind: AxisKind, values: impl IntoIterator<Item = f64>) -> Self {
        let values = values.into_iter().map(Value::Number).collect();
        Self { kind, values }
    }

    /// Creates an axis of names.
    pub fn names(kind: AxisKind, values: impl IntoIterator<Item: ToString>) -> Self {
        let values = values.into_iter().map(|value| Value::Text(value.to_string()));
        Self {
            kind,
            values: values.collect(),
        }
    }

    /// Creates an axis from text.
    ///
    /// # Errors
    /// The first text that is not a value of the setting.
    pub fn parse<'a>(kind: AxisKind, texts: impl IntoIterator<Item = &'a str>) -> Result<Self, SettingError> {
        let (setting, mut cell) = (kind.setting(), any_cell());
        let value = |text: &str| {
            let value = setting.parse(text)?;
            setting.set(&mut cell, &value)?;
            // As the program writes it.
            Ok(setting.get(&cell).unwrap_or(value))
        };
        let values = texts.into_iter().map(value).collect::<Result<_, SettingError>>()?;
        Ok(Self { kind, values })
    }

    /// Returns the setting that the axis varies.
    pub fn kind(&self) -> AxisKind {
        self.kind
    }

    /// Returns the name of the setting.
    pub fn name(&self) -> &'static str {
        self.kind.name()
    }

    /// Returns the values.
    pub fn values(&self) -> &[Value] {
        &self.values
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Returns `true` if there are no values.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Returns value `index` as text.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn label(&self, index: usize) -> String {
        self.values[index].to_string()
    }

    /// Writes value `index` to `cell`. A method has its usual settings for the source, and a validation share that
    /// follows from the method is updated for a new one.
    ///
    /// # Errors
    /// If the value is none of the setting.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub(super) fn apply(&self, index: usize, cell: &mut Cell) -> Result<(), SettingError> {
        let usual = cell.settings.validation_fraction();
        self.kind.setting().set(cell, &self.values[index])?;
        if let Some(division) = cell.division.as_mut().filter(|_| self.kind == AxisKind::Method) {
            let method = &mut cell.settings.training.method;
            if *method == Method::bayesian_regularization() {
                *method = Method::recorded_regularization();
            }
            if division.validation_fraction == usual {
                division.validation_fraction = cell.settings.validation_fraction();
            }
        }
        Ok(())
    }
}
