use decoupler_core::{
    dataset::Division,
    decoupling::DecoderKind,
    evaluation::{
        RUN_OPTIONS, RunOption, RunSettings,
        experiments::{Axis, AxisKind, Experiment},
    },
    settings,
    training::Method,
};
use serde_json::{Map, Value, json};
use thiserror::Error;

use super::TrialOptions;
use crate::{
    export::report::{CommandGap, train_command},
    import::Plan,
};

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
        let is_left_out = ["combine", "begin"].contains(&setting.name) && setting.get(&defaults)? == value;
        let value = match &value {
            settings::Value::Number(value) => number(*value),
            settings::Value::Integer(value) => Value::from(*value),
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
