use serde::{Deserialize, Serialize};

use super::Cell;
use crate::{
    dataset::{Division, LARGEST_SAMPLES},
    evaluation::{MAX_STARTS, RunSettings},
    network::LARGEST_HIDDEN,
    settings::{EPOCHS, Field, Kind, Setting, SettingError, Value},
    training::Method,
};

/// A setting that an experiment varies, with its values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Setting that it varies.
    pub kind: AxisKind,
    /// Values of the setting.
    pub values: Vec<Value>,
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

const HIDDEN: Kind = Kind::Integer(1, LARGEST_HIDDEN as u64);
const SAMPLES: Kind = Kind::Integer(1, LARGEST_SAMPLES as u64);
const STARTS: Kind = Kind::Integer(1, MAX_STARTS as u64);

/// Settings of a cell that an axis can vary, in the order of [`AxisKind`], which is the one offered to the user.
static ROWS: [(AxisKind, Setting<Cell>); 11] = [
    row(AxisKind::Hidden, "hidden nodes", HIDDEN, |cell| {
        Some(Field::Count(&mut cell.settings.hidden))
    }),
    row(AxisKind::Array, "array", Kind::Text, |cell| {
        let scale = &mut cell.settings.simulation_mut()?.sensor.scale;
        Some(Field::text(scale.to_string(), scale, str::parse))
    }),
    row(AxisKind::Samples, "samples", SAMPLES, |cell| {
        let source = cell.settings.simulation_mut()?;
        Some(Field::Count(&mut source.samples))
    }),
    row(AxisKind::Noise, "noise", Kind::Number(0.0, f64::MAX), |cell| {
        let source = cell.settings.simulation_mut()?;
        Some(Field::Number(&mut source.scene.noise.relative))
    }),
    row(AxisKind::Inputs, "inputs", Kind::Choice, |cell| {
        cell.settings.simulation()?;
        Some(Field::named(&mut cell.settings.inputs.quantity))
    }),
    row(AxisKind::Scaling, "scaling", Kind::Choice, |cell| {
        Some(Field::named(&mut cell.settings.inputs.scaling))
    }),
    row(AxisKind::Method, "method", Kind::Choice, |cell| {
        let method = &mut cell.settings.training.method;
        Some(Field::text(method.short_name().to_owned(), method, Method::named))
    }),
    row(AxisKind::Epochs, EPOCHS.name, EPOCHS.kind, |cell| {
        (EPOCHS.field)(&mut cell.settings.training.stopping)
    }),
    row(AxisKind::Starts, "starts", STARTS, |cell| {
        Some(Field::Count(&mut cell.settings.starts))
    }),
    row(AxisKind::Split, "split", Kind::Choice, |cell| {
        Some(Field::named(&mut cell.division.as_mut()?.by))
    }),
    row(AxisKind::Seed, "seed", Kind::Integer(0, u64::MAX), |cell| {
        Some(Field::Integer(&mut cell.settings.seed.0))
    }),
];

const fn row(
    axis: AxisKind,
    name: &'static str,
    kind: Kind,
    field: fn(&mut Cell) -> Option<Field<'_>>,
) -> (AxisKind, Setting<Cell>) {
    (axis, Setting::new(name, kind, "", field))
}

impl AxisKind {
    /// Returns the row of the table of settings.
    pub fn setting(self) -> &'static Setting<Cell> {
        &ROWS[self as usize].1
    }

    /// Name of the setting.
    pub fn name(self) -> &'static str {
        self.setting().name
    }

    /// Returns the settings of runs with the source of `settings`, in the order offered to the user.
    pub fn of_runs(settings: &RunSettings) -> impl Iterator<Item = Self> + use<> {
        let cell = Cell {
            settings: *settings,
            division: settings.simulation().is_none().then(Division::default),
            ..Cell::default()
        };
        let rows = ROWS.iter().filter(move |(_, setting)| setting.applies(&cell));
        rows.map(|(kind, _)| *kind)
    }
}

impl Axis {
    /// Creates an axis of integers.
    pub fn integers(kind: AxisKind, values: impl IntoIterator<Item = u64>) -> Self {
        let values = values.into_iter().map(Value::Integer).collect();
        Self { kind, values }
    }

    /// Creates an axis of names.
    pub fn names(kind: AxisKind, values: impl IntoIterator<Item: ToString>) -> Self {
        let values = values.into_iter().map(|value| Value::Text(value.to_string())).collect();
        Self { kind, values }
    }

    /// Creates an axis from text.
    ///
    /// # Errors
    /// The first text that is not a value of the setting.
    pub fn parse<'a>(kind: AxisKind, texts: impl IntoIterator<Item = &'a str>) -> Result<Self, SettingError> {
        let setting = kind.setting();
        let mut cell = Cell {
            division: Some(Division::default()),
            ..Cell::default()
        };
        let value = |text: &str| {
            let value = setting.parse(text)?;
            setting.set(&mut cell, &value)?;
            // As the program writes it.
            Ok(setting.get(&cell).unwrap_or(value))
        };
        let values = texts.into_iter().map(value).collect::<Result<_, SettingError>>()?;
        Ok(Self { kind, values })
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
