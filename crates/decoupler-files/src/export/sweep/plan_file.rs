use std::path::Path;

use decoupler_core::{
    dataset::Division,
    decoupling::DecoderKind,
    evaluation::experiments::{Axis, AxisKind, Experiment},
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use thiserror::Error;

use super::{TrialId, load, save_new, train_options};
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

/// All trials of a specification, in its order, kept next to the results so that missing ones can be named.
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
            let defect = "trials: there are more or fewer than combinations of the axes' values".to_owned();
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
            values.join(", ")
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
