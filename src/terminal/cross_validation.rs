//! Errors on every sample by cross-validation, and the optimism of random test samples.

use std::{collections::BTreeMap, io::Write, iter::once};

use serde::Serialize;

use super::{
    errors_report::{Target, targets},
    failure::Failure,
    inspect::{FileFound, files, write_files, write_warnings},
    interruption::Graceful,
    output::{messages, print, print_object, progress_bar},
    samples::{with_bar, working_folder},
    train::Train,
};
use decoupler_core::{
    dataset::{Division, Folds, SplitBy, Stream},
    evaluation::{
        CrossValidated, ErrorTable, Run, RunError, RunSets, RunSettings, Scores, TestErrors, TrainingSize, Workload,
        recorded::{Determination, SplitComparison, channel_remarks, nonlinear_gains, ridge_remark},
    },
    job::Job,
    problem::{Channel, Problem},
};
use decoupler_files::{
    export::{describe_determinacy, error_table},
    import::{Dropped, Plan, Recording, Setup, SetupSets},
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
        let (mut optimism, mut end) = (Vec::new(), Ok(()));
        if by == SplitBy::Random {
            let honest = SplitBy::honest(set);
            let graceful = Graceful::begin();
            announce_comparison(honest);
            let is_cancelled = || graceful.is_end_requested();
            match SplitComparison::complete(settings, set, folds, (by, &validated), &Job::new(&is_cancelled)) {
                Ok(comparison) => optimism = sentences(&comparison, &recording.targets),
                Err(RunError::Cancelled(_)) => end = Err(Failure::InterruptedComparison { by: honest }),
                Err(error) => return Err(error.into()),
            }
        }
        print_folds(plan, &recording, settings, &validated, optimism, self.json)?;
        end
    }

    /// Measures how optimistic random test samples of a recording are for each target, by training again on a split by
    /// group (by time without groups). Ctrl-C ends only this comparison.
    pub(super) fn optimism(&self, run: &Run, sets: &SetupSets) -> Result<Vec<String>, Failure> {
        let Some(recordings) = &sets.recordings else {
            return Ok(Vec::new());
        };
        let plan = &recordings.recorded.plan;
        if plan.division.by != SplitBy::Random || plan.test.is_some() {
            return Ok(Vec::new());
        }
        let set = &recordings.training.set;
        let by = SplitBy::honest(set);
        let graceful = Graceful::begin();
        announce_comparison(by);
        let settings = *run.settings();
        let honest = || -> Result<Run, RunError> {
            let division = Division { by, ..plan.division };
            let (split, test) = division.sets(set, None, settings.seed)?;
            let sets = RunSets::new(split, test);
            Run::with_baselines(settings, sets, None, &Job::UNINTERRUPTED)
        };
        let mut honest = match honest() {
            Ok(honest) => honest,
            Err(error) => {
                return Ok(vec![format!(
                    "a random split is optimistic when neighbouring rows are similar; by how much cannot be measured here: \
                     split by {by}, {error}"
                )]);
            }
        };
        let bar = progress_bar(
            self.json,
            settings.training.stopping.epochs,
            "{bar:30} second training for comparison",
        );
        while !graceful.is_end_requested() && honest.step().is_none() {
            bar.inc(1);
        }
        bar.finish_and_clear();
        if honest.stop_reason().is_none() {
            return Err(Failure::InterruptedComparison { by });
        }
        let comparison = SplitComparison::of_runs(set, by, [&honest, run]).expect("a run without folds has baselines");
        Ok(sentences(&comparison, &recordings.training.targets))
    }
}

/// Reports on standard error that the same settings are trained again.
fn announce_comparison(by: SplitBy) {
    // There is no one to report to if this fails.
    let _ = writeln!(
        messages(),
        "training again on a split by {by}, to measure how optimistic random test samples are; Ctrl-C skips this"
    );
}

/// Describes for each target how optimistic random test samples are.
fn sentences(comparison: &SplitComparison, targets: &[Channel]) -> Vec<String> {
    let targets = targets.iter().enumerate();
    targets
        .map(|(index, target)| comparison.sentence(index, &target.name))
        .collect()
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

/// Prints the report of a cross-validation; `optimism` has the warnings about random folds.
fn print_folds(
    plan: &Plan,
    recording: &Recording,
    settings: &RunSettings,
    validated: &CrossValidated,
    optimism: Vec<String>,
    is_json: bool,
) -> Result<(), Failure> {
    let (set, problem, by) = (&recording.set, recording.problem(), plan.division.by);
    let channels = &problem.targets;
    let scores = validated.scores(set);
    let determined = Determination::measure(set, validated.network.view(), by);
    let gains = nonlinear_gains(set, validated, by);
    let better = better(&problem, &scores);
    let mut warnings = recording.warnings.clone();
    warnings.extend(channel_remarks(set, by, &recording.inputs, channels));
    warnings.extend(optimism);
    warnings.extend(describe_determinacy(channels, &determined, false));
    let remarks = channels.iter().zip(gains);
    warnings.extend(remarks.filter_map(|(channel, gain)| ridge_remark(gain?, &channel.name)));
    let fallbacks = channels.iter().zip(&better).filter(|(_, better)| **better != NETWORK);
    warnings.extend(fallbacks.map(|(channel, better)| {
        format!(
            "the held-out error of the {better} is lower than that of the network for {}",
            channel.name
        )
    }));
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
