//! Errors on every sample by cross-validation, and the optimism of random test samples.

use serde_json::json;

use super::{
    failure::Failure,
    inspect::{files, write_files},
    interruption::Graceful,
    output::{print, warn},
    samples::{with_bar, working_folder},
    train::Train,
    train_report::targets,
};
use decoupler_core::{
    dataset::{Folds, SplitBy, Stream},
    evaluation::{
        CrossValidated, ErrorTable, RunSettings, Scores, TestErrors, TrainingSize, Workload,
        recorded::{Determination, Findings, channel_remarks, ridge_remarks},
    },
    job::Job,
    problem::Problem,
};
use decoupler_files::{
    export::{describe_determinacy, error_table},
    import::{Plan, Recording, Setup},
    machine::memory_budget,
};

const NETWORK: &str = "network";

impl Train {
    /// Trains a network for each fold of the recording of `setup`, and prints their errors on all samples.
    pub(super) fn cross_validate(&self, setup: &Setup, folds: usize) -> Result<(), Failure> {
        let given = [
            (self.out.is_some(), "--out"),
            (self.checkpoint.checkpoint.is_some(), "--checkpoint"),
            (self.report.is_some(), "--report"),
            (!self.training.scene.decoder.is_empty(), "--decoder"),
        ];
        if let Some((_, argument)) = given.into_iter().find(|(is_given, _)| *is_given) {
            let message = format!("{argument}: --folds trains a network for each fold and keeps none; leave one out");
            return Err(Failure::Arguments(message));
        }
        let settings = setup.settings();
        let Some(plan) = setup.plan() else {
            return Err(Failure::Arguments("--folds: it needs --data or --recipe".to_owned()));
        };
        let recording = with_bar(|watch| plan.recording(working_folder(), watch))?;
        let set = &recording.set;
        let by = plan.division.by;
        Workload::of(settings, TrainingSize::of(settings, set)).check_memory(memory_budget())?;
        let assigned = Folds::by(set, folds, by, &mut settings.seed.rng(Stream::Split));
        let assigned = assigned.map_err(|error| Failure::Arguments(error.to_string()))?;
        let validated = CrossValidated::on_folds(settings, set, assigned, &Job::UNINTERRUPTED)?;
        print_folds(plan, &recording, settings, &validated)
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
            let targets = recording.problem.targets.iter().enumerate();
            targets
                .map(|(index, target)| comparison.sentence(index, &target.name))
                .collect()
        }
        Err(error) => vec![format!(
            "a random split is optimistic when neighbouring samples are similar; by how much cannot be measured here: {error}"
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
) -> Result<(), Failure> {
    let (set, problem, by) = (&recording.set, &recording.problem, plan.division.by);
    let channels = &problem.targets;
    let scores = validated.scores(set);
    let determined = Determination::measure(set, validated.network.view(), by);
    recording.warnings.iter().for_each(warn);
    let remarks = channel_remarks(set, by, &recording.problem.features(), channels).into_iter();
    let remarks = remarks.chain(optimism(recording, settings, by));
    let remarks = remarks.chain(describe_determinacy(channels, &determined, false));
    remarks
        .chain(ridge_remarks(set, validated, by, channels))
        .for_each(warn);
    let object = || {
        json!({
            "files": files([recording]),
            "inputs": recording.problem.features(),
            "split": by.to_string(),
            "folds": validated.folds.count(),
            "rows": recording.rows,
            "samples": set.samples(),
            "test_samples": set.samples(),
            "dropped": recording.dropped,
            "hidden": settings.hidden,
            "method": settings.training.method.short_name(),
            "seed": settings.seed.0,
            "targets": targets(channels, &scores.network, &determined, &[]),
            "baselines": {
                "mean": targets(channels, &scores.baselines.mean, &[], &[]),
                "ridge": targets(channels, &scores.baselines.linear, &[], &[]),
            },
            "better": better(problem, &scores),
        })
    };
    print(object, |out| {
        write_files([recording], out)?;
        writeln!(
            out,
            "{} samples, each tested by a network trained without its fold: {} folds by {by}\n",
            set.samples(),
            validated.folds.count()
        )?;
        let tables = ErrorTable::of_scores(problem, &scores, None);
        write!(out, "{}", error_table(&tables).aligned())
    })
}
