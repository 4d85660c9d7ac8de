//! Analysis of a recording in the terminal.

use std::io::{self, Write};

use clap::Args;
use decoupler_core::{
    dataset::{Seed, SplitBy},
    evaluation::{
        RunSettings,
        auto::TriedModel,
        recorded::{Determinacy, Determination, Findings, Interval},
    },
    job::Job,
    problem::Channel,
    scene::RowModel,
    text::capitalised,
};
use decoupler_files::{
    export::{describe_target, describe_warnings, format_below_one},
    import::{Dropped, Recording},
};
use serde::Serialize;

use super::{
    failure::Failure,
    import_arguments::ImportArguments,
    inspect::{FileFound, files, write_files, write_warnings},
    output::{print, print_object},
    samples::{with_bar, working_folder},
    seed,
};

// How well the readings determine the targets.
#[derive(Args)]
pub(super) struct StudyArguments {
    /// Columns of the sensor readings; with --targets, measure how well they determine the targets
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    pub(super) inputs: Vec<String>,
    /// Seed of all random numbers [default: 0]
    #[arg(long, value_parser = seed)]
    seed: Option<u64>,
}

impl StudyArguments {
    /// Returns `true` if any of them is given.
    pub(super) fn are_given(&self) -> bool {
        !self.inputs.is_empty() || self.seed.is_some()
    }

    /// Measures and prints how well the readings of a recording determine its targets.
    pub(super) fn run(&self, import: &ImportArguments, is_json: bool) -> Result<(), Failure> {
        let plan = import.plan(&self.inputs)?;
        import.refuse_unused_shares()?;
        if plan.test.is_some() {
            let message = "--test-data: a recording is analysed by cross-validation; leave the test files out";
            return Err(Failure::Arguments(message.to_owned()));
        }
        if import.folds.is_some() {
            let message =
                "--folds: a recording is analysed in five folds; leave it out, or cross-validate networks with train";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let recording = with_bar(is_json, |watch| plan.recording(working_folder(), watch))?;
        import.save_recipe(&plan)?;
        let mut settings = RunSettings::measured(RowModel::Shared);
        settings.seed = self.seed.map_or(settings.seed, Seed);
        let by = plan.division.by;
        let findings = recording.findings(&settings, by, &Job::UNINTERRUPTED)?;
        Report::new(by, &recording, settings.seed, &findings).print(is_json)
    }
}

/// The object printed by `inspect --targets --json`.
#[derive(Serialize)]
pub(super) struct Report<'a> {
    files: Vec<FileFound>,
    rows: usize,
    samples: usize,
    dropped: &'a [Dropped],
    split: String,
    folds: usize,
    seed: u64,
    targets: Vec<Target<'a>>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct Target<'a> {
    name: &'a str,
    unit: Option<&'a str>,
    /// R² of the better of ridge and kernel ridge regression.
    r2: Option<Interval>,
    better: Option<&'static str>,
    /// `determined`, `weakly determined`, `uncertain` or `not determined`.
    standing: Option<&'static str>,
    sentence: String,
    r2_ridge: Option<Interval>,
    r2_kernel: Option<Interval>,
    split: Split,
}

/// RMSE of a model with honest and with random folds.
#[derive(Serialize)]
struct Split {
    by: String,
    model: TriedModel,
    rmse: f64,
    random_rmse: f64,
    sentence: String,
}

impl<'a> Report<'a> {
    fn new(by: SplitBy, recording: &'a Recording, seed: Seed, findings: &Findings) -> Self {
        let mut warnings = recording.warnings.clone();
        warnings.extend(describe_warnings(recording, by, findings));
        let targets = recording.targets.iter().enumerate();
        Self {
            files: files(std::iter::once(recording)),
            rows: recording.rows,
            samples: recording.set.samples(),
            dropped: &recording.dropped,
            split: by.to_string(),
            folds: findings.record.folds,
            seed: seed.0,
            targets: targets
                .map(|(index, channel)| Target::new(index, channel, findings))
                .collect(),
            warnings,
        }
    }

    pub(super) fn print(&self, is_json: bool) -> Result<(), Failure> {
        if is_json {
            return print_object(self);
        }
        print(|out| {
            write_files(&self.files, self.rows, self.dropped, out)?;
            writeln!(
                out,
                "{} samples, {} folds by {}; 95 % confidence intervals from blocks or groups of samples\n",
                self.samples, self.folds, self.split
            )?;
            self.write_targets(out)?;
            write_warnings(&self.warnings, out)
        })
    }

    fn write_targets(&self, out: &mut impl Write) -> io::Result<()> {
        for target in &self.targets {
            write!(out, "{}", capitalised(&target.sentence))?;
            if let (Some(ridge), Some(kernel)) = (target.r2_ridge, target.r2_kernel) {
                let [ridge, kernel] = [ridge, kernel].map(|r2| format_below_one(r2.value, 2));
                write!(out, " (ridge {ridge}, kernel ridge {kernel})")?;
            }
            writeln!(out)?;
        }
        writeln!(out)?;
        for target in &self.targets {
            writeln!(out, "{}", capitalised(&target.split.sentence))?;
        }
        writeln!(out)
    }
}

impl<'a> Target<'a> {
    fn new(index: usize, channel: &'a Channel, findings: &Findings) -> Self {
        let of = &findings.targets[index];
        let (best, name, comparison) = (of.best(), &channel.name, &findings.comparison);
        let r2 = |determination: Option<Determination>| determination.map(|of| of.r2);
        let [rmse, random_rmse] = comparison.rmse[index];
        Self {
            name,
            unit: channel.unit.as_deref(),
            r2: r2(best.map(|(determination, _)| determination)),
            better: best.map(|(_, is_kernel)| if is_kernel { "kernel" } else { "ridge" }),
            standing: best.map(|(determination, _)| match determination.determinacy() {
                Determinacy::Determined => "determined",
                Determinacy::WeaklyDetermined => "weakly determined",
                Determinacy::Uncertain => "uncertain",
                Determinacy::NotDetermined => "not determined",
            }),
            sentence: describe_target(name, of),
            r2_ridge: r2(of.ridge.ok()),
            r2_kernel: r2(of.kernel),
            split: Split {
                by: comparison.by.to_string(),
                model: comparison.model,
                rmse,
                random_rmse,
                sentence: comparison.sentence(index, name),
            },
        }
    }
}
