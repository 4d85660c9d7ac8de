use std::{
    collections::BTreeMap,
    io::{self, Write},
    time::Duration,
};

use serde::Serialize;

use super::{
    failure::Failure,
    measured_files::{FileFound, files, write_files},
    measured_table::{Target, targets, write_table, write_warnings},
    output::{print as print_with, print_object},
};
use crate::{
    dataset::Dataset,
    evaluation::{Channel, TargetPosition},
    evaluation::{
        CrossValidated, RunFlaw, RunSettings, StartRecord, TargetErrors, TargetRow,
        recorded::{Determination, NonlinearGain, Undetermined},
    },
    export::{MeasuredNetworkFile, describe_positions, describe_standings, describe_worse_than_ridge, format_duration},
    import::{Dropped, Plan, PlannedSets, Recording},
    sensor::counted,
    training::StopReason,
};

/// Everything known of the samples.
#[derive(Serialize)]
pub(super) struct Report {
    files: Vec<FileFound>,
    inputs: Vec<Channel>,
    /// Rule of the split: time, group, random or file.
    split: String,
    test_fraction: f64,
    /// Number of rows of the files, dropped ones included.
    rows: usize,
    /// Number of samples that the training fits.
    samples: usize,
    validation_samples: usize,
    test_samples: usize,
    dropped: Vec<Dropped>,
    /// Positions of targets, for those that have one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    positions: Vec<Position>,
    #[serde(skip)]
    positions_text: Option<String>,
    #[serde(skip)]
    warnings: Vec<String>,
}

/// Position of a target on the skin.
#[derive(Serialize)]
struct Position {
    target: String,
    x_mm: f64,
    y_mm: f64,
}

/// The object printed by `train --data --json`.
#[derive(Serialize)]
struct Trained<'a> {
    #[serde(flatten)]
    report: &'a Report,
    hidden: usize,
    method: &'static str,
    seed: u64,
    starts: &'a [StartRecord],
    epochs: usize,
    best_epoch: usize,
    stop_reason: Option<StopReason>,
    seconds: Option<f64>,
    networks: usize,
    weights: usize,
    targets: Vec<Target<'a>>,
    baselines: BTreeMap<&'static str, Vec<Target<'a>>>,
    warnings: Vec<String>,
}

/// The object printed by `train --data --folds --json`.
#[derive(Serialize)]
pub(super) struct Folds<'a> {
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
    /// Of mean, ridge and network the one with the lowest error, target by target.
    better: Vec<&'static str>,
    warnings: Vec<String>,
    #[serde(skip)]
    table: Vec<TargetRow>,
}

const NETWORK: &str = "network";
/// The split by a file of test samples.
const TEST_FILE: &str = "file";

/// Name of the row of `table` with the lowest error for a target.
fn best(table: &[TargetRow], target: usize) -> &'static str {
    let rows = table.iter().min_by(|one, other| {
        let rmse = |row: &TargetRow| row.targets[target].rmse;
        rmse(one).total_cmp(&rmse(other))
    });
    rows.map_or(NETWORK, |row| row.name)
}

impl Report {
    pub(super) fn new(plan: &Plan, sets: &PlannedSets) -> Self {
        let by = plan.division.by;
        let recordings = || std::iter::once(&sets.recording).chain(&sets.test_recording);
        let warnings: Vec<String> = recordings()
            .flat_map(|recording| recording.warnings.iter().cloned())
            .collect();
        let recording = &sets.recording;
        let position = |&TargetPosition { target, x_mm, y_mm }: &TargetPosition| Position {
            target: recording.targets[target].name.clone(),
            x_mm,
            y_mm,
        };
        let samples = sets.split.training.samples();
        let validation_samples = sets.split.validation.as_ref().map_or(0, Dataset::samples);
        let test_samples = sets.test.samples();
        Self {
            files: files(recordings()),
            inputs: sets.recording.inputs.clone(),
            split: match sets.test_recording {
                Some(_) => TEST_FILE.to_owned(),
                None => by.to_string(),
            },
            test_fraction: test_samples as f64 / (samples + validation_samples + test_samples) as f64,
            rows: recordings().map(|recording| recording.rows).sum(),
            samples,
            validation_samples,
            test_samples,
            dropped: recordings()
                .flat_map(|recording| recording.dropped.iter().cloned())
                .collect(),
            positions: recording.positions.iter().map(position).collect(),
            positions_text: describe_positions(&recording.positions),
            warnings,
        }
    }

    /// Warnings of the import.
    pub(super) fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns `true` if the test samples have files of their own.
    pub(super) fn has_test_file(&self) -> bool {
        self.split == TEST_FILE
    }

    /// Writes the files, and how their samples are divided.
    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        write_files(&self.files, self.rows, &self.dropped, out)?;
        writeln!(
            out,
            "{} for training, {} for validation, {} for the test (split by {})",
            counted(self.samples, "sample"),
            self.validation_samples,
            self.test_samples,
            self.split
        )?;
        self.positions_text.iter().try_for_each(|text| writeln!(out, "{text}"))
    }
}

/// The judgement of a trained network.
pub(super) struct Judged<'a> {
    pub(super) flaw: Option<&'a RunFlaw>,
    pub(super) wall_time: Option<Duration>,
    /// R² of each target on the test samples, with its interval.
    pub(super) told: Vec<Result<Determination, Undetermined>>,
    /// Errors that a random split hides, in words.
    pub(super) flattery: Vec<String>,
}

/// Prints the report of a trained network.
pub(super) fn print(
    report: &Report,
    file: &MeasuredNetworkFile,
    judged: &Judged<'_>,
    is_json: bool,
) -> Result<(), Failure> {
    let Judged {
        flaw,
        wall_time,
        told,
        flattery,
    } = judged;
    let (settings, training) = (&file.settings, &file.training);
    let epochs = training.history.last().map_or(0, |record| record.epoch);
    let warnings: Vec<String> = report
        .warnings
        .iter()
        .cloned()
        .chain(flattery.iter().cloned())
        .chain(flaw.map(ToString::to_string))
        .chain(describe_standings(&file.targets, told))
        .chain(describe_worse_than_ridge(file))
        .collect();
    if is_json {
        return print_object(&Trained {
            report,
            hidden: settings.hidden,
            method: settings.training.method.short_name(),
            seed: settings.seed.0,
            starts: &training.starts,
            epochs,
            best_epoch: training.best_epoch,
            stop_reason: training.stop_reason,
            seconds: wall_time.map(|time| time.as_secs_f64()),
            networks: file.network.values().len(),
            weights: file.network.weights(),
            targets: targets(&file.targets, &file.errors, told),
            baselines: BTreeMap::from([
                ("mean", targets(&file.targets, &file.mean, &[])),
                ("ridge", targets(&file.targets, &file.ridge, &[])),
            ]),
            warnings,
        });
    }
    print_with(|out| {
        report.write(out)?;
        writeln!(
            out,
            "{}, {}, {}, {}, seed {}",
            counted(file.inputs.len(), "input"),
            counted(settings.hidden, "hidden node"),
            settings.training.method,
            counted(settings.starts, "start"),
            settings.seed
        )?;
        let reason = training
            .stop_reason
            .map_or("not ended".to_owned(), |reason| reason.to_string());
        let time = wall_time.map_or_else(String::new, |time| format!(", {}", format_duration(time)));
        writeln!(out, "Ended after {}{time}: {reason}", counted(epochs, "epoch"))?;
        writeln!(out, "Weights kept from epoch {}\n", training.best_epoch)?;
        let rows = [
            ("mean", &file.mean[..]),
            ("ridge", &file.ridge),
            ("network", &file.errors),
        ];
        write_table(&file.targets, &rows, out)?;
        write_warnings(&warnings, out)
    })
}

impl<'a> Folds<'a> {
    /// Reports a cross-validation; `flattery` is what random folds hide.
    pub(super) fn new(
        plan: &Plan,
        recording: &'a Recording,
        settings: &RunSettings,
        validated: &CrossValidated,
        flattery: Vec<String>,
    ) -> Self {
        let (set, channels, by) = (&recording.set, &recording.targets, plan.division.by);
        let table = validated.target_table(set);
        let told = Determination::measure(set, validated.network.view(), by);
        let gains = NonlinearGain::of_validated(set, validated, by);
        let better: Vec<&'static str> = (0..channels.len()).map(|target| best(&table, target)).collect();
        let mut warnings = recording.warnings.clone();
        warnings.extend(flattery);
        warnings.extend(describe_standings(channels, &told));
        let remarks = channels.iter().zip(gains);
        warnings.extend(remarks.filter_map(|(channel, gain)| gain?.remark(&channel.name)));
        let fallbacks = channels.iter().zip(&better).filter(|(_, better)| **better != NETWORK);
        warnings.extend(fallbacks.map(|(channel, better)| {
            format!(
                "the better answer for {} is the {better}: its held-out error is the lowest",
                channel.name
            )
        }));
        let of =
            |row: usize, told: &[Result<Determination, Undetermined>]| targets(channels, &table[row].targets, told);
        Self {
            files: files(std::iter::once(recording)),
            inputs: &recording.inputs,
            split: plan.division.by.to_string(),
            folds: validated.folds.count(),
            rows: recording.rows,
            samples: recording.set.samples(),
            test_samples: recording.set.samples(),
            dropped: &recording.dropped,
            hidden: settings.hidden,
            method: settings.training.method.short_name(),
            seed: settings.seed.0,
            targets: of(2, &told),
            baselines: BTreeMap::from([("mean", of(0, &[])), ("ridge", of(1, &[]))]),
            better,
            warnings,
            table,
        }
    }
}

/// Prints the report of a cross-validation.
pub(super) fn print_folds(folds: &Folds<'_>, channels: &[Channel], is_json: bool) -> Result<(), Failure> {
    if is_json {
        return print_object(folds);
    }
    print_with(|out| {
        write_files(&folds.files, folds.rows, folds.dropped, out)?;
        writeln!(
            out,
            "{} samples, each tested by a network that has not seen its fold: {} folds by {}\n",
            folds.samples, folds.folds, folds.split
        )?;
        let rows: Vec<(&str, &[TargetErrors])> = ["mean", "ridge", "network"]
            .into_iter()
            .zip(folds.table.iter().map(|row| &row.targets[..]))
            .collect();
        write_table(channels, &rows, out)?;
        write_warnings(&folds.warnings, out)
    })
}
