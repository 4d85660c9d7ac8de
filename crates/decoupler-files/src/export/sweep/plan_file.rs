use std::path::Path;

use decoupler_core::{
    dataset::Division,
    decoupling::DecoderKind,
    evaluation::{
        RUN_OPTIONS, RunOption, RunSettings,
        experiments::{Axis, AxisKind, Experiment},
    },
    settings,
    text::in_one_line,
    training::Method,
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use thiserror::Error;

use super::{TrialId, TrialOptions, load, save_new};
use crate::{
    export::{
        DocumentError, DocumentKind, WriteError,
        document::PROGRAM,
        report::{CommandGap, train_command},
    },
    import::{FileChecksum, Plan},
};

const KIND: DocumentKind = DocumentKind::SweepPlan;
/// Beginning of the name of a plan file.
pub(super) const PREFIX: &str = "sweep-";

/// All trials of a specification, in its order, kept next to the results to identify missing ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepPlan {
    /// Axes in the order of the specification; the last varies fastest.
    pub axes: Vec<PlanAxis>,
    /// Trials by position.
    pub trials: Vec<TrialId>,
    /// Files of recordings, with paths relative to the folder; none for simulated arrays.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<FileChecksum>,
}

/// An option that varies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanAxis {
    /// Option of the command that is varied.
    pub option: String,
    /// Its values, in order.
    pub values: Vec<Value>,
}

impl SweepPlan {
    /// Writes the plan to its file in `folder`, unless it is there.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_in(&self, folder: &Path) -> Result<(), WriteError> {
        let trials: Vec<String> = self.trials.iter().map(ToString::to_string).collect();
        let id = TrialId::of(&trials.join("\n"));
        save_new(KIND, PROGRAM, self, &folder.join(format!("{PREFIX}{id}.json"))).map(drop)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub(crate) fn load(path: &Path) -> Result<Self, DocumentError> {
        let (_, plan): (_, Self) = load(KIND, path)?;
        let combinations = plan
            .axes
            .iter()
            .map(|axis| axis.values.len())
            .try_fold(1, usize::checked_mul);
        if combinations == Some(plan.trials.len()) {
            Ok(plan)
        } else {
            let defect = "trials: their number is not that of the combinations of the axes' values".to_owned();
            Err(KIND.damaged(path, defect))
        }
    }

    /// Values of the axes at `position`, as in `hidden 8, seed 3`.
    pub fn describe(&self, position: usize) -> String {
        let mut rest = position;
        let mut values: Vec<String> = Vec::new();
        for PlanAxis {
            option,
            values: of_axis,
        } in self.axes.iter().rev()
        {
            let count = of_axis.len().max(1);
            if let Some(value) = of_axis.get(rest % count) {
                values.push(format!("{option} {}", written(value)));
            }
            rest /= count;
        }
        values.reverse();
        if values.is_empty() {
            "the only trial".to_owned()
        } else {
            // Any text may be a value.
            in_one_line(&values.join(", "))
        }
    }
}

/// A value without the quotes of JSON.
fn written(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(values) => values.iter().map(written).collect::<Vec<_>>().join(" "),
        other => other.to_string(),
    }
}

/// Reasons why an experiment of the window cannot be run as a sweep in the terminal.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SpecificationGap {
    /// Settings that have no option in the terminal.
    #[error("{0}: a sweep in the terminal cannot train this")]
    Setting(CommandGap),
    /// Trials that are cross-validations.
    #[error("a sweep in the terminal trains and tests once for each trial: it has no cross-validation")]
    CrossValidation,
}

/// The specification with which `decoupler sweep --spec` trains the trials of `experiment`, on the recording of `plan` or else
/// on a simulated array.
///
/// # Errors
/// The terminal has no options for them.
pub fn sweep_specification(experiment: &Experiment, plan: Option<&Plan>) -> Result<Value, SpecificationGap> {
    if experiment.cross_validation.is_some() {
        return Err(SpecificationGap::CrossValidation);
    }
    if experiment.base.simulation().is_some() {
        train_command(&experiment.base.into(), None).map_err(SpecificationGap::Setting)?;
    }
    let mut train = train_options(&experiment.base, &[DecoderKind::Network]);
    let mut axes = Map::new();
    for axis in experiment.axes() {
        axes.insert(option(axis.kind).to_owned(), values(axis));
        if axis.kind == AxisKind::Method {
            // `set` belongs to one method; here, each method has its own settings.
            train.remove("set");
        }
    }
    let seeds = experiment.seeds_of(&experiment.base).map(|seed| seed.0);
    let seeds = Value::from_iter(seeds);
    axes.entry(option(AxisKind::Seed)).or_insert(seeds);
    if let Some(plan) = plan {
        let division = &plan.division;
        train.insert("split".to_owned(), division.by.to_string().into());
        train.insert("test-fraction".to_owned(), division.test_fraction.into());
        if division.validation_fraction != experiment.base.validation_fraction() {
            train.insert("validation-fraction".to_owned(), division.validation_fraction.into());
        }
    }
    train.retain(|option, value| !axes.contains_key(option) && *value != json!([]));
    let mut specification = json!({"train": train, "axes": axes});
    if let Some(plan) = plan {
        // The division is in the options.
        let division = Division::default();
        specification["recording"] = json!(Plan {
            division,
            ..plan.clone()
        });
    }
    Ok(specification)
}

/// Option of `train` for a setting.
fn option(kind: AxisKind) -> &'static str {
    match kind {
        AxisKind::Hidden => "hidden",
        AxisKind::Array => "array",
        AxisKind::Samples => "samples",
        AxisKind::Noise => "noise",
        AxisKind::Inputs => "inputs",
        AxisKind::Scaling => "scaling",
        AxisKind::Method => "method",
        AxisKind::Epochs => "epochs",
        AxisKind::Starts => "starts",
        AxisKind::Split => "split",
        AxisKind::Seed => "seed",
    }
}

fn values(axis: &Axis) -> Value {
    let value = |value: &settings::Value| match value {
        settings::Value::Number(value) => Value::from(*value),
        settings::Value::Integer(value) => Value::from(*value),
        settings::Value::Text(value) => Value::from(value.replace('×', "x")),
    };
    axis.values.iter().map(value).collect()
}

/// Returns the decoders in the order in which they are offered, without duplicates: order and duplicates change no
/// result.
pub fn decoders_in_order(decoders: &[DecoderKind]) -> Vec<DecoderKind> {
    let all = DecoderKind::ALL.into_iter();
    all.filter(|kind| decoders.contains(kind)).collect()
}

/// Returns the options for exactly these settings and decoders, with every default written out: the same trial has the
/// same options however it was specified. Options of a recording name no files.
pub fn train_options(settings: &RunSettings, decoders: &[DecoderKind]) -> TrialOptions {
    let defaults = RunSettings::default();
    let option = |option: &RunOption| {
        let setting = &option.setting;
        let value = setting.get(settings)?;
        // Left out at their defaults, so that trials keep the names they had before these options existed.
        let is_left_out = ["combine", "begin", "adc bits"].contains(&setting.name) && setting.get(&defaults)? == value;
        let value = match &value {
            settings::Value::Number(value) => number(*value),
            settings::Value::Integer(value) => Value::from(*value),
            // As a number, which it is.
            settings::Value::Text(bits) if setting.name == "adc bits" => {
                bits.parse::<u64>().map_or(Value::Null, Value::from)
            }
            settings::Value::Text(text) => Value::from(text.as_str()),
        };
        (!is_left_out).then(|| (setting.word("-"), value))
    };
    let mut options = TrialOptions::from_iter(RUN_OPTIONS.iter().filter_map(option));
    options.insert("decoder".to_owned(), decoders.iter().map(ToString::to_string).collect());
    options.insert("set".to_owned(), method_settings(settings.training.method));
    options
}

/// Options that a recording adds: names and checksums of its files, meanings of their columns, and the division of its samples.
/// The folders of the files are left out: a trial is the same wherever they are.
pub fn recording_options(plan: &Plan, crc32: &[String]) -> TrialOptions {
    let named = plan.named();
    let mut import = serde_json::to_value(&named.import).unwrap_or_default();
    let mut taken = |field: &str| {
        let fields = import.as_object_mut();
        fields.and_then(|fields| fields.remove(field)).unwrap_or_default()
    };
    let mut options = TrialOptions::from([
        ("data".to_owned(), taken("data")),
        ("inputs".to_owned(), taken("inputs")),
        ("targets".to_owned(), taken("targets")),
        ("crc32".to_owned(), crc32.iter().cloned().collect()),
        ("split".to_owned(), text(&plan.division.by)),
        ("test-fraction".to_owned(), number(plan.division.test_fraction)),
        (
            "validation-fraction".to_owned(),
            number(plan.division.validation_fraction),
        ),
    ]);
    options.insert("import".to_owned(), import);
    if let Some(test) = &named.test {
        options.insert("test".to_owned(), serde_json::to_value(test).unwrap_or_default());
    }
    options
}

/// Negative zero is written as zero.
fn number(value: f64) -> Value {
    Value::from(value + 0.0)
}

fn text(value: &dyn ToString) -> Value {
    Value::from(value.to_string())
}

fn method_settings(method: Method) -> Value {
    let pairs = method.settings().filter_map(|setting| {
        let value = number(setting.number(&method)?);
        Some(format!("{}={value}", setting.word("-")))
    });
    pairs.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_axis_varies_fastest() {
        let axis = |option: &str, values: Value| PlanAxis {
            option: option.to_owned(),
            values: serde_json::from_value(values).unwrap(),
        };
        let plan = SweepPlan {
            axes: vec![
                axis("hidden", serde_json::json!([6, 8])),
                axis("set", serde_json::json!(["mu=1", ["mu=2", "mu-decrease=0.5"], "mu=3"])),
            ],
            trials: Vec::new(),
            recordings: Vec::new(),
        };
        let positions = [0, 1, 5].map(|position| plan.describe(position));
        assert_eq!(
            positions,
            [
                "hidden 6, set mu=1",
                "hidden 6, set mu=2 mu-decrease=0.5",
                "hidden 8, set mu=3"
            ]
        );
    }
}
