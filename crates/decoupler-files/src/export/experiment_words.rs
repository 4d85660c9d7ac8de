//! Sentences next to the table of an experiment.

use decoupler_core::{
    dataset::SplitBy,
    evaluation::{
        CrossValidation, Simulation,
        experiments::{AxisKind, CellResults, Experiment, ExperimentRecording, ExperimentResults, Trial},
    },
    network::HiddenSuggestions,
    text::counted,
};

/// Describes the conditions of an experiment in one or two sentences.
pub fn describe_conditions(experiment: &Experiment) -> String {
    let base = &experiment.base;
    let simulation = base.source.simulation();
    let varies = |kind| experiment.axes().any(|axis| axis.kind() == kind);
    let mut said = vec![base.training.method.name().to_owned()];
    if let Some(recording) = &experiment.recording {
        said.insert(0, recording.name.clone());
        if varies(AxisKind::Method) {
            said.pop();
        }
    }
    if let Some(source) = simulation.filter(|_| experiment.axis.kind() != AxisKind::Array) {
        said.push(source.sensor.scale.to_string());
    }
    if experiment.axis.kind() != AxisKind::Hidden {
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
    let division = experiment.recording.as_ref();
    said.extend(simulation.map(|source| describe_samples(source, experiment.cross_validation)));
    said.extend(division.map(|recording| describe_division(recording, varies(AxisKind::Split))));
    let mut conditions = said.join(", ");
    if let Some(source) = simulation.filter(|_| experiment.axis.kind() == AxisKind::Hidden) {
        let scale = source.sensor.scale;
        let suggested = HiddenSuggestions::new(scale.columns(), scale.coordinates_per_row());
        let (root, logarithm) = (suggested.square_root, suggested.logarithm);
        let (fewest, most) = (root.start(), root.end());
        conditions += &format!(". Eq. (12) suggests {fewest} to {most} hidden nodes, Eq. (13) {logarithm}");
    }
    conditions
}

fn describe_samples(source: &Simulation, cross_validation: Option<CrossValidation>) -> String {
    match cross_validation {
        None => format!(
            "{}, {} more for validation, {} for test",
            counted(source.samples, "training sample"),
            source.validation_samples,
            source.test_samples
        ),
        Some(CrossValidation { folds, repeats, unit }) => {
            let validation = match folds {
                2 => "nothing held out for validation",
                _ => "of the folds not tested one is held out for validation",
            };
            format!("{folds} folds by {unit}, {validation}, {}", counted(repeats, "repeat"))
        }
    }
}

/// Describes the test samples, and those held out for validation; `varies` if the rule is an axis.
fn describe_division(recording: &ExperimentRecording, varies: bool) -> String {
    let percent = |share: f64| (1000.0 * share).round() / 10.0;
    let division = &recording.division;
    let share = percent(division.test_fraction);
    let test = match (recording.has_test_files, varies, division.by) {
        (true, ..) => "tested on files of their own".to_owned(),
        (false, true, _) => format!("{share} % of the samples for test"),
        (false, false, SplitBy::Time) => format!("the last {share} % of the samples for test"),
        (false, false, SplitBy::Group) => format!("groups with {share} % of the samples for test"),
        (false, false, SplitBy::Random) => format!("a random {share} % of the samples for test"),
    };
    match division.validation_fraction {
        0.0 => test,
        fraction => format!("{test}, {} % of the others for validation", percent(fraction)),
    }
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
        let is_worse = |trial: &&Trial| is_worse_than_mean(trial);
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

fn is_worse_than_mean(trial: &Trial) -> bool {
    let mean = &trial.baselines.mean;
    match (trial.errors.nodes(), mean.nodes()) {
        (Some(errors), Some(mean)) => errors.z_mm > mean.z_mm,
        // An error that is not finite is worse than any.
        _ => mean
            .percent()
            .is_some_and(|mean| trial.errors.percent().is_none_or(|percent| percent > mean)),
    }
}
