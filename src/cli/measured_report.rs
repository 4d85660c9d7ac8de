use std::{collections::BTreeMap, io, io::Write, path::PathBuf, time::Duration};

use serde::Serialize;

use super::{
    failure::Failure,
    measured_table::{Target, judgements, targets, write_table, write_warnings},
    output::{print as print_with, print_object},
};
use crate::{
    dataset::{Dataset, SplitBy},
    evaluation::{RunFlaw, RunSettings, StartRecord, TargetErrors, TargetRow},
    export::{MeasuredNetworkFile, format_duration, format_number},
    import::{Channel, Dropped, FileReport, Format, JoinReport, Plan, PlannedSets, Recording},
    sensor::counted,
    training::StopReason,
};

/// What is known of the samples.
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
    #[serde(skip)]
    warnings: Vec<String>,
}

/// A file as it was found.
#[derive(Serialize)]
struct FileFound {
    path: PathBuf,
    format: String,
    rows: usize,
    columns: usize,
    join: Option<JoinReport>,
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
    warnings: Vec<String>,
}

impl FileFound {
    fn of(report: &FileReport) -> Self {
        Self {
            path: report.path.clone(),
            format: format_words(&report.format),
            rows: report.rows,
            columns: report.columns,
            join: report.join,
        }
    }
}

/// Says what kind of file it is, and its layout.
pub(super) fn format_words(format: &Format) -> String {
    match format {
        Format::Text(dialect) => format!("text: {dialect}"),
        Format::Npy => "NumPy array".to_owned(),
        Format::Npz => "archive of NumPy arrays".to_owned(),
        Format::Matlab => "MATLAB file".to_owned(),
    }
}

impl Report {
    pub(super) fn new(plan: &Plan, sets: &PlannedSets) -> Self {
        let by = plan.division.by;
        let recordings = || std::iter::once(&sets.recording).chain(&sets.test_recording);
        let mut warnings: Vec<String> = recordings()
            .flat_map(|recording| recording.warnings.iter().cloned())
            .collect();
        warnings.extend(flattery(by, sets.test_recording.is_some()));
        let samples = sets.split.training.samples();
        let validation_samples = sets.split.validation.as_ref().map_or(0, Dataset::samples);
        let test_samples = sets.test.samples();
        Self {
            files: files(recordings()),
            inputs: sets.recording.inputs.clone(),
            split: match sets.test_recording {
                Some(_) => "file".to_owned(),
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
            warnings,
        }
    }
}

fn files<'a>(recordings: impl Iterator<Item = &'a Recording>) -> Vec<FileFound> {
    recordings
        .flat_map(|recording| recording.files.iter().map(FileFound::of))
        .collect()
}

/// Says that a random split flatters.
fn flattery(by: SplitBy, has_test_file: bool) -> Option<String> {
    (by == SplitBy::Random && !has_test_file).then(|| {
        "a random split flatters where neighbouring rows are alike: the test has neighbours of what was trained; compare \
         with --split time"
            .to_owned()
    })
}

/// Prints the report of a trained network.
pub(super) fn print(
    report: &Report,
    file: &MeasuredNetworkFile,
    flaw: Option<&RunFlaw>,
    wall_time: Option<Duration>,
    is_json: bool,
) -> Result<(), Failure> {
    let (settings, training) = (&file.settings, &file.training);
    let epochs = training.history.last().map_or(0, |record| record.epoch);
    let warnings: Vec<String> = report
        .warnings
        .iter()
        .cloned()
        .chain(flaw.map(ToString::to_string))
        .chain(judgements(&file.targets, &file.errors, &file.ridge))
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
            targets: targets(&file.targets, &file.errors),
            baselines: BTreeMap::from([
                ("mean", targets(&file.targets, &file.mean)),
                ("ridge", targets(&file.targets, &file.ridge)),
            ]),
            warnings,
        });
    }
    print_with(|out| {
        write_files(&report.files, report.rows, &report.dropped, out)?;
        writeln!(
            out,
            "{} for training, {} for validation, {} for the test (split by {})",
            counted(report.samples, "sample"),
            report.validation_samples,
            report.test_samples,
            report.split
        )?;
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
    pub(super) fn new(
        plan: &Plan,
        recording: &'a Recording,
        settings: &RunSettings,
        folds: usize,
        table: &[TargetRow],
    ) -> Self {
        let of = |row: usize| targets(&recording.targets, table.get(row).map_or(&[], |row| &row.targets));
        let errors = |row: usize| table.get(row).map_or(&[][..], |row| &row.targets);
        let mut warnings = recording.warnings.clone();
        warnings.extend(flattery(plan.division.by, false));
        warnings.extend(judgements(&recording.targets, errors(2), errors(1)));
        Self {
            files: files(std::iter::once(recording)),
            inputs: &recording.inputs,
            split: plan.division.by.to_string(),
            folds,
            rows: recording.rows,
            samples: recording.set.samples(),
            test_samples: recording.set.samples(),
            dropped: &recording.dropped,
            hidden: settings.hidden,
            method: settings.training.method.short_name(),
            seed: settings.seed.0,
            targets: of(2),
            baselines: BTreeMap::from([("mean", of(0)), ("ridge", of(1))]),
            warnings,
        }
    }
}

/// Prints the report of a cross-validation; `table` has the errors of the mean, of ridge and of the networks.
pub(super) fn print_folds(
    folds: &Folds<'_>,
    channels: &[Channel],
    table: &[TargetRow],
    is_json: bool,
) -> Result<(), Failure> {
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
            .zip(table.iter().map(|row| &row.targets[..]))
            .collect();
        write_table(channels, &rows, out)?;
        write_warnings(&folds.warnings, out)
    })
}

fn write_files(files: &[FileFound], rows: usize, dropped: &[Dropped], out: &mut impl Write) -> io::Result<()> {
    for file in files {
        writeln!(
            out,
            "{}: {} × {}, {}",
            file.path.display(),
            counted(file.rows, "row"),
            counted(file.columns, "column"),
            file.format
        )?;
        if let Some(join) = file.join {
            let offset = join.median_offset.map_or_else(String::new, |offset| {
                format!(", median {} apart", format_number(offset.abs()))
            });
            writeln!(
                out,
                "  joined by time within {}{offset}; {} without partner, {} of its rows unused",
                format_number(join.limit),
                counted(join.without_partner, "row"),
                join.unused
            )?;
        }
    }
    for Dropped {
        reason,
        rows: count,
        first_line,
    } in dropped
    {
        writeln!(
            out,
            "{count} of {rows} rows dropped: {reason} (first on line {first_line})"
        )?;
    }
    Ok(())
}
