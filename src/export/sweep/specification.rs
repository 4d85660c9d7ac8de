use serde_json::{Map, Value, json};
use thiserror::Error;

use super::train_options;
use crate::{
    decoupling::DecoderKind,
    evaluation::experiments::{Axis, Experiment},
    export::report::{CommandGap, train_command},
};

/// Reasons for which an experiment of the window cannot be swept by the terminal.
#[derive(Debug, Error)]
#[non_exhaustive]
pub(crate) enum SpecificationGap {
    /// Settings that the terminal lacks.
    #[error("{0}: a sweep in the terminal cannot train this")]
    Setting(CommandGap),
    /// Trials that are cross-validations.
    #[error("a sweep in the terminal trains and tests once for each trial: it has no cross-validation")]
    CrossValidation,
}

/// The specification with which `decoupler sweep --spec` trains the trials of `experiment`.
///
/// # Errors
/// The terminal has no options for them.
pub(crate) fn sweep_specification(experiment: &Experiment) -> Result<Value, SpecificationGap> {
    if experiment.cross_validation.is_some() {
        return Err(SpecificationGap::CrossValidation);
    }
    train_command(&experiment.base.into(), None).map_err(SpecificationGap::Setting)?;
    let mut train = train_options(&experiment.base, &[DecoderKind::Network]);
    let mut axes = Map::new();
    for axis in experiment.axes() {
        axes.insert(option(axis).to_owned(), values(axis));
        if let Axis::Method(_) = axis {
            // Settings are those of one method; each has its own here.
            train.remove("set");
        }
    }
    let seeds = experiment.seeds_of(&experiment.base).map(|seed| seed.0);
    let seeds = Value::from_iter(seeds);
    axes.entry(option(&Axis::Seed(Vec::new()))).or_insert(seeds);
    train.retain(|option, value| !axes.contains_key(option) && *value != json!([]));
    Ok(json!({"train": train, "axes": axes}))
}

/// Option of `train` that an axis varies.
fn option(axis: &Axis) -> &'static str {
    match axis {
        Axis::Hidden(_) => "hidden",
        Axis::Array(_) => "array",
        Axis::Samples(_) => "samples",
        Axis::Method(_) => "method",
        Axis::Epochs(_) => "epochs",
        Axis::Seed(_) => "seed",
    }
}

fn values(axis: &Axis) -> Value {
    match axis {
        Axis::Hidden(values) | Axis::Samples(values) | Axis::Epochs(values) => values.iter().copied().collect(),
        Axis::Array(scales) => scales.iter().map(|scale| scale.to_string().replace('×', "x")).collect(),
        Axis::Method(methods) => methods.iter().map(|method| method.short_name()).collect(),
        Axis::Seed(seeds) => seeds.iter().map(|seed| seed.0).collect(),
    }
}
