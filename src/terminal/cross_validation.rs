//! Errors on every sample by cross-validation, and the optimism of random test samples.

use std::{collections::BTreeMap, io::Write, iter::once};

use serde::Serialize;

use super::{
    errors_report::{Target, targets},
    failure::Failure,
    inspect::{FileFound, files, write_files, write_warnings},
    interruption::Graceful,
    output::{print, print_object},
    samples::{with_bar, working_folder},
    train::Train,
};
use decoupler_core::{
    dataset::{Folds, SplitBy, Stream},
    evaluation::{
        CrossValidated, ErrorTable, RunSettings, Scores, TestErrors, TrainingSize, Workload,
        recorded::{Determination, Findings, channel_remarks, ridge_remarks},
    },
    job::Job,
    problem::{Channel, Problem},
};
use decoupler_files::{
    export::{describe_determinacy, error_table},
    import::{Dropped, Plan, Recording, Setup},
    machine::memory_budget,
};

/// The object printed by `train --folds --json`.
#[derive(Serialize)]
struct Report<'a> {
    files: Vec<FileFound>,
    inputs: &'a [Channel],
    split: String,
    folds: usize,
    rows: usize,
    samples: usize,
    test_samples: usize,
    dropped: &'a [Dropped],
    hidden: usize,
    method: &'static str,
    seed: u64,
    targets: Vec<Target<'a>>,
    baselines: BTreeMap<&'static str, Vec<Target<'a>>>,
    /// Decoder with the lowest error for each target: mean, ridge or network.
    better: Vec<&'static str>,
    warnings: Vec<String>,
}

const NETWORK: &str = "network";

impl Train {
    /// Trains a network for each fold of the recording of `setup`, and prints their errors on all samples.
    pub(super) fn cross_validate(&self, setup: &Setup, folds: usize) -> Result<(), Failure> {
        for (is_given, argument) in [
            (self.out.is_some(), "--out"),
            (self.checkpoint.checkpoint.is_some(), "--checkpoint"),
            (self.report.is_some(), "--report"),
            (!self.training.scene.decoder.is_empty(), "--decoder"),
        ] {
            if is_given {
                let message =
                    format!("{argument}: --folds trains a network for each fold and keeps none; leave one out");
                return Err(Failure::Arguments(message));
            }
        }
        let (settings, plan) = (setup.settings(), setup.plan().expect("--folds needs a recording"));
        let recording = with_bar(self.json, |watch| plan.recording(working_folder(), watch))?;
        self.import.save_recipe(setup)?;
        let set = &recording.set;
        let by = plan.division.by;
        Workload::of(settings, TrainingSize::of(settings, set)).check_memory(memory_budget())?;
        let assigned = Folds::by(set, folds, by, &mut settings.seed.rng(Stream::Split));
        let assigned = assigned.map_err(|error| Failure::Arguments(error.to_string()))?;
        let validated = CrossValidated::on_folds(settings, set, assigned, &Job::UNINTERRUPTED)?;
        print_folds(plan, &recording, settings, &validated, self.json)
    }
}

/// Describes for each target how optimistic samples drawn at random are. Ctrl-C ends only this measurement.
pub(super) fn optimism(recording: &Recording, settings: &RunSettings, by: SplitBy) -> Vec<String> {
    if by != SplitBy::Random {
        return Vec::new();
    }
    let graceful = Graceful::begin();
    let is_cancelled = || graceful.is_end_requested();
    match recording.findings(settings, by, &Job::new(&is_cancelled)) {
        Ok(Findings { comparison, .. }) => {
            let targets = recording.targets.iter().enumerate();
            targets
                .map(|(index, target)| comparison.sentence(index, &target.name))
                .collect()
        }
        Err(error) => vec![format!(
            "a random split is optimistic when neighbouring rows are similar; by how much cannot be measured here: {error}"
        )],
    }
}

/// Name of the decoder with the lowest error for each target.
fn better(problem: &Problem, scores: &Scores) -> Vec<&'static str> {
    let answers = [
        ("mean", &scores.baselines.mean),
        ("ridge", &scores.baselines.linear),
        (NETWORK, &scores.network),
    ];
    let best = |target: usize| {
        let rmse = |errors: &TestErrors| errors.targets()[target].rmse;
        let best = answers
            .iter()
            .min_by(|(_, one), (_, other)| rmse(one).total_cmp(&rmse(other)));
        best.map_or(NETWORK, |(name, _)| name)
    };
    (0..problem.targets.len()).map(best).collect()
}

/// Prints the report of a cross-validation.
fn print_folds(
    plan: &Plan,
    recording: &Recording,
    settings: &RunSettings,
    validated: &CrossValidated,
    is_json: bool,
) -> Result<(), Failure> {
    let (set, problem, by) = (&recording.set, recording.problem(), plan.division.by);
    let channels = &problem.targets;
    let scores = validated.scores(set);
    let determined = Determination::measure(set, validated.network.view(), by);
    let better = better(&problem, &scores);
    let mut warnings = recording.warnings.clone();
    warnings.extend(channel_remarks(set, by, &recording.inputs, channels));
    warnings.extend(optimism(recording, settings, by));
    warnings.extend(describe_determinacy(channels, &determined, false));
    warnings.extend(ridge_remarks(set, validated, by, channels));
    let report = Report {
        files: files(once(recording)),
        inputs: &recording.inputs,
        split: by.to_string(),
        folds: validated.folds.count(),
        rows: recording.rows,
        samples: set.samples(),
        test_samples: set.samples(),
        dropped: &recording.dropped,
        hidden: settings.hidden,
        method: settings.training.method.short_name(),
        seed: settings.seed.0,
        targets: targets(channels, &scores.network, &determined, &[]),
        baselines: BTreeMap::from([
            ("mean", targets(channels, &scores.baselines.mean, &[], &[])),
            ("ridge", targets(channels, &scores.baselines.linear, &[], &[])),
        ]),
        better,
        warnings,
    };
    if is_json {
        return print_object(&report);
    }
    print(|out| {
        write_files(&report.files, report.rows, report.dropped, out)?;
        writeln!(
            out,
            "{} samples, each tested by a network trained without its fold: {} folds by {}\n",
            report.samples, report.folds, report.split
        )?;
        let tables = ErrorTable::of_scores(&problem, &scores, None);
        write!(out, "{}", error_table(&tables).aligned())?;
        write_warnings(&report.warnings, out)
    })
}
