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
    export::{
        experiment_tables::axis_word,
        report::{CommandGap, train_command},
    },
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
        axes.insert(axis_word(axis.kind).to_owned(), values(axis));
        if axis.kind == AxisKind::Method {
            // `set` belongs to one method; here, each method has its own settings.
            train.remove("set");
        }
    }
    let seeds = Value::from_iter(experiment.seeds_of(&experiment.base).map(|seed| seed.0));
    axes.entry(axis_word(AxisKind::Seed)).or_insert(seeds);
    let mut specification = json!({});
    if let Some(plan) = plan {
        let usual = experiment.base.validation_fraction();
        let mut division = division_options(&plan.division);
        division.retain(|option, value| option != "validation-fraction" || *value != json!(usual));
        train.append(&mut division);
        // The division is in the options.
        specification["recording"] = json!(Plan {
            division: Division::default(),
            ..plan.clone()
        });
    }
    train.retain(|option, value| !axes.contains_key(option) && *value != json!([]));
    specification["train"] = json!(train);
    specification["axes"] = axes.into();
    Ok(specification)
}

fn values(axis: &Axis) -> Value {
    let value = |value: &settings::Value| match value {
        settings::Value::Text(text) => text.replace('×', "x").into(),
        value => json!(value),
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
        let value = match value {
            // Negative zero is written as zero.
            settings::Value::Number(value) => Value::from(value + 0.0),
            value => json!(value),
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
    let mut options = division_options(&plan.division);
    options.insert("crc32".to_owned(), crc32.into());
    if let Ok(Value::Object(mut import)) = serde_json::to_value(&named.import) {
        for field in ["data", "inputs", "targets"] {
            options.insert(field.to_owned(), import.remove(field).unwrap_or_default());
        }
        options.insert("import".to_owned(), import.into());
    }
    if let Some(test) = &named.test {
        options.insert("test".to_owned(), json!(test));
    }
    options
}

fn division_options(division: &Division) -> TrialOptions {
    let validation_fraction = division.validation_fraction.unwrap_or(0.0);
    let options = [
        ("split", division.by.to_string().into()),
        ("test-fraction", (division.test_fraction + 0.0).into()),
        ("validation-fraction", (validation_fraction + 0.0).into()),
    ];
    options.map(|(option, value)| (option.to_owned(), value)).into()
}

fn method_settings(method: Method) -> Value {
    let pairs = method.settings().filter_map(|setting| {
        let value = Value::from(setting.number(&method)? + 0.0);
        Some(format!("{}={value}", setting.word("-")))
    });
    pairs.collect()
}
