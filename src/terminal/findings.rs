//! Analysis of a recording in the terminal.

use clap::Args;
use decoupler_core::{
    dataset::Seed,
    evaluation::{
        RunSettings,
        recorded::{Determinacy, Determination, Findings},
    },
    job::Job,
    problem::Channel,
    scene::RowModel,
    text::capitalised,
};
use decoupler_files::export::{describe_target, describe_warnings, format_below_one};
use serde_json::{Value, json};

use super::{
    failure::Failure,
    import_arguments::ImportArguments,
    inspect::{files, write_files},
    output::{print, warn},
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
    pub(super) fn run(&self, import: &ImportArguments) -> Result<(), Failure> {
        let plan = import.plan(&self.inputs)?;
        import.refuse_held_out()?;
        let recording = with_bar(|watch| plan.recording(working_folder(), watch))?;
        let mut settings = RunSettings::measured(RowModel::Shared);
        settings.seed = self.seed.map_or(settings.seed, Seed);
        let by = plan.division.by;
        let findings = recording.findings(&settings, by, &Job::UNINTERRUPTED)?;
        recording.warnings.iter().for_each(warn);
        describe_warnings(&recording, by, &findings).iter().for_each(warn);
        let (samples, folds) = (recording.set.samples(), findings.record.folds);
        let object = || {
            let targets = recording.targets.iter().enumerate();
            json!({
                "files": files([&recording]),
                "rows": recording.rows,
                "samples": samples,
                "dropped": recording.dropped,
                "split": by.to_string(),
                "folds": folds,
                "seed": settings.seed.0,
                "targets": Vec::from_iter(targets.map(|(index, channel)| target(index, channel, &findings))),
            })
        };
        print(object, |out| {
            write_files([&recording], out)?;
            writeln!(
                out,
                "{samples} samples, {folds} folds by {by}; 95 % confidence intervals from blocks or groups of samples\n"
            )?;
            for (channel, of) in recording.targets.iter().zip(&findings.targets) {
                write!(out, "{}", capitalised(&describe_target(&channel.name, of)))?;
                if let (Ok(ridge), Some(kernel)) = (of.ridge, of.kernel) {
                    let [ridge, kernel] = [ridge, kernel].map(|of| format_below_one(of.r2.value, 2));
                    write!(out, " (ridge {ridge}, kernel ridge {kernel})")?;
                }
                writeln!(out)?;
            }
            writeln!(out)?;
            for (index, channel) in recording.targets.iter().enumerate() {
                writeln!(
                    out,
                    "{}",
                    capitalised(&findings.comparison.sentence(index, &channel.name))
                )?;
            }
            writeln!(out)
        })
    }
}

/// Findings on a target; `r2` is that of the better of ridge and kernel ridge regression, and `split` has the RMSE of a model
/// with honest and with random folds.
fn target(index: usize, channel: &Channel, findings: &Findings) -> Value {
    let of = &findings.targets[index];
    let (best, comparison) = (of.best(), &findings.comparison);
    let r2 = |determination: Option<Determination>| determination.map(|of| of.r2);
    let [rmse, random_rmse] = comparison.rmse[index];
    json!({
        "name": channel.name,
        "unit": channel.unit,
        "r2": r2(best.map(|(determination, _)| determination)),
        "better": best.map(|(_, is_kernel)| if is_kernel { "kernel" } else { "ridge" }),
        "standing": best.map(|(determination, _)| match determination.determinacy() {
            Determinacy::Determined => "determined",
            Determinacy::WeaklyDetermined => "weakly determined",
            Determinacy::Uncertain => "uncertain",
            Determinacy::NotDetermined => "not determined",
        }),
        "sentence": describe_target(&channel.name, of),
        "r2_ridge": r2(of.ridge.ok()),
        "r2_kernel": r2(of.kernel),
        "split": {
            "by": comparison.by.to_string(),
            "model": comparison.model,
            "rmse": rmse,
            "random_rmse": random_rmse,
            "sentence": comparison.sentence(index, &channel.name),
        },
    })
}
