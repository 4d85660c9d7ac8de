use serde_json::{Map, Value, json};
use thiserror::Error;

use super::train_options;
use crate::{
    export::report::{CommandGap, train_command},
    import::Plan,
};
use decoupler_core::{
    dataset::Division,
    decoupling::DecoderKind,
    evaluation::experiments::{Axis, AxisKind, Experiment},
};

/// Reasons for which an experiment of the window cannot be swept by the terminal.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SpecificationGap {
    /// Settings that the terminal lacks.
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
    if let Some(settings) = experiment.base.simulated() {
        train_command(&settings.into(), None).map_err(SpecificationGap::Setting)?;
    }
    let mut train = train_options(&experiment.base, &[DecoderKind::Network]);
    let mut axes = Map::new();
    for axis in experiment.axes() {
        axes.insert(option(axis.kind()).to_owned(), values(axis));
        if axis.kind() == AxisKind::Method {
            // Settings are those of one method; each has its own here.
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
    match axis {
        Axis::Hidden(values) | Axis::Samples(values) | Axis::Epochs(values) | Axis::Starts(values) => {
            values.iter().copied().collect()
        }
        Axis::Noise(values) => values.iter().copied().collect(),
        Axis::Inputs(values) => texts(values),
        Axis::Scaling(values) => texts(values),
        Axis::Split(values) => texts(values),
        Axis::Array(scales) => scales.iter().map(|scale| scale.to_string().replace('×', "x")).collect(),
        Axis::Method(methods) => methods.iter().map(|method| method.short_name()).collect(),
        Axis::Seed(seeds) => seeds.iter().map(|seed| seed.0).collect(),
    }
}

fn texts(values: &[impl ToString]) -> Value {
    values.iter().map(ToString::to_string).collect()
}
