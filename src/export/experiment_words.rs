//! Sentences beside the table of an experiment.

use crate::{
    evaluation::{
        CrossValidation,
        experiments::{Axis, CellResults, Experiment, ExperimentResults, Trial},
    },
    network::HiddenSuggestions,
    sensor::counted,
};

/// Describes the conditions of an experiment in one or two sentences.
pub fn describe_conditions(experiment: &Experiment) -> String {
    let base = &experiment.base;
    let mut said = vec![base.training.method.name().to_owned()];
    if !matches!(experiment.axis, Axis::Array(_)) {
        said.push(base.source.sensor.scale.to_string());
    }
    if !matches!(experiment.axis, Axis::Hidden(_)) {
        said.push(counted(base.hidden, "hidden node"));
    }
    said.push(counted(base.training.stopping.epochs, "epoch"));
    said.push(match base.starts {
        1 => "one start".to_owned(),
        starts => format!("best of {starts} starts by validation error"),
    });
    said.push(match experiment.seeds {
        1 => format!("seed {}", base.seed),
        seeds => format!("{seeds} seeds from {}", base.seed),
    });
    said.push(match experiment.cross_validation {
        None => format!(
            "{}, {} more for validation, {} for test",
            counted(base.source.samples, "training sample"),
            base.source.validation_samples,
            base.source.test_samples
        ),
        Some(CrossValidation { folds, repeats, unit }) => {
            let validation = match folds {
                2 => "nothing held out for validation",
                _ => "of the folds not tested one is held out for validation",
            };
            format!("{folds} folds by {unit}, {validation}, {}", counted(repeats, "repeat"))
        }
    });
    let mut conditions = said.join(", ");
    if matches!(experiment.axis, Axis::Hidden(_)) {
        let scale = base.source.sensor.scale;
        let suggested = HiddenSuggestions::new(scale.columns(), scale.coordinates_per_row());
        let (root, logarithm) = (suggested.square_root, suggested.logarithm);
        let (fewest, most) = (root.start(), root.end());
        conditions += &format!(". Eq. (12) suggests {fewest} to {most} hidden nodes, Eq. (13) {logarithm}");
    }
    conditions
}

/// Describes every failed trial in a sentence.
pub fn describe_failures(results: &ExperimentResults) -> Vec<String> {
    let of_cell = |cell| {
        let label = results.cell_labels(cell).join(", ");
        cell.failures
            .iter()
            .map(move |failure| format!("Failed at {label}, {failure}"))
    };
    results.cells.iter().flat_map(of_cell).collect()
}

/// Describes in a sentence every cell some of whose networks are worse than always answering the training mean.
pub fn describe_worse_than_mean(results: &ExperimentResults) -> Vec<String> {
    let of_cell = |cell: &CellResults| {
        let is_worse = |trial: &&Trial| trial.errors.z_mm > trial.baselines.mean.z_mm;
        let (worse, trials) = (cell.trials.iter().filter(is_worse).count(), cell.trials.len());
        (worse > 0).then(|| {
            format!(
                "At {}, {worse} of {trials} are worse than always answering the training mean: run more epochs, or take \
                 more samples, other hidden nodes or another method",
                results.cell_labels(cell).join(", ")
            )
        })
    };
    results.cells.iter().filter_map(of_cell).collect()
}
