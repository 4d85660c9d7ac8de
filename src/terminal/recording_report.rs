//! Files of a recording as they were found, and the division of their samples.

use std::{
    io::{self, Write},
    iter::once,
    path::PathBuf,
};

use serde::Serialize;

use decoupler_core::{
    dataset::Dataset,
    evaluation::{Channel, RunSets, TargetPosition},
    text::counted,
};
use decoupler_files::{
    export::{describe_positions, format_number},
    import::{Dropped, FileReport, JoinReport, Recording, Recordings},
};

/// Everything known of the samples of a recording.
#[derive(Serialize)]
pub(super) struct RecordingReport {
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
}

/// Position of a target on the skin.
#[derive(Serialize)]
struct Position {
    target: String,
    x_mm: f64,
    y_mm: f64,
}

/// A file as it was found.
#[derive(Serialize)]
pub(super) struct FileFound {
    path: PathBuf,
    format: String,
    rows: usize,
    columns: usize,
    join: Option<JoinReport>,
}

impl RecordingReport {
    pub(super) fn new(sets: &RunSets, recordings: &Recordings) -> Self {
        let plan = &recordings.recorded.plan;
        let all = || once(&recordings.training).chain(&recordings.test);
        let recording = &recordings.training;
        let position = |&TargetPosition { target, x_mm, y_mm }: &TargetPosition| Position {
            target: recording.targets[target].name.clone(),
            x_mm,
            y_mm,
        };
        let samples = sets.split.training.samples();
        let validation_samples = sets.split.validation.as_ref().map_or(0, Dataset::samples);
        let test_samples = sets.test.samples();
        Self {
            files: files(all()),
            inputs: recording.inputs.clone(),
            split: match recordings.test {
                Some(_) => "file".to_owned(),
                None => plan.division.by.to_string(),
            },
            test_fraction: test_samples as f64 / (samples + validation_samples + test_samples) as f64,
            rows: all().map(|recording| recording.rows).sum(),
            samples,
            validation_samples,
            test_samples,
            dropped: all().flat_map(|recording| recording.dropped.iter().cloned()).collect(),
            positions: recording.positions.iter().map(position).collect(),
            positions_text: describe_positions(&recording.positions),
        }
    }

    /// Writes the files, and how their samples are divided.
    pub(super) fn write(&self, out: &mut dyn Write) -> io::Result<()> {
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

/// Warnings of the import.
pub(super) fn import_warnings(recordings: &Recordings) -> Vec<String> {
    let all = once(&recordings.training).chain(&recordings.test);
    all.flat_map(|recording| recording.warnings.iter().cloned()).collect()
}

pub(super) fn files<'a>(recordings: impl Iterator<Item = &'a Recording>) -> Vec<FileFound> {
    let found = |report: &FileReport| FileFound {
        path: report.path.clone(),
        format: report.format.to_string(),
        rows: report.rows,
        columns: report.columns,
        join: report.join,
    };
    recordings
        .flat_map(|recording| recording.files.iter().map(found))
        .collect()
}

pub(super) fn write_files(
    files: &[FileFound],
    rows: usize,
    dropped: &[Dropped],
    out: &mut dyn Write,
) -> io::Result<()> {
    for file in files {
        writeln!(
            out,
            "{}: {} rows × {} columns, {}",
            file.path.display(),
            file.rows,
            file.columns,
            file.format
        )?;
        if let Some(join) = file.join {
            let offset = join.median_offset.map_or_else(String::new, |offset| {
                format!(", median {} apart", format_number(offset.abs()))
            });
            writeln!(
                out,
                "  joined by time within {}{offset}; {} rows without partner, {} of its rows unused",
                format_number(join.limit),
                join.without_partner,
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

pub(super) fn write_warnings(warnings: &[String], out: &mut dyn Write) -> io::Result<()> {
    warnings
        .iter()
        .try_for_each(|warning| writeln!(out, "Warning: {warning}"))
}
