//! Inspection of the files of a recording, and the division of their samples.

use std::{
    io::{self, Write},
    iter::once,
    path::{Path, PathBuf},
};

use clap::Args;
use decoupler_core::{
    dataset::{Dataset, Seed},
    evaluation::{
        RunSets, RunSettings,
        recorded::{Determinacy, Determination, Findings},
    },
    job::Job,
    problem::{Channel, TargetPosition},
    scene::RowModel,
    text::{capitalised, counted},
};
use decoupler_files::{
    export::{
        Cell, RecipeFile, Table, TableColumn, describe_positions, describe_target, describe_warnings, format_below_one,
        format_number,
    },
    import::{
        ColumnKind, ColumnSummary, FileReport, Format, InspectedFile, Plan, Recording, Recordings, TimeSummary,
        read_table,
    },
};
use serde_json::{Value, json};

use super::{
    failure::Failure,
    import_arguments::{ImportArguments, RecipeArguments},
    output::{check_output, joined, output, print, value, warn},
    samples::{with_bar, working_folder},
    seed,
};

/// List the columns of a recording, and measure how well its readings determine targets
///
/// Reads CSV, Excel, .npy, .npz and .mat. Each column has its name, unit, kind, range, number of missing cells and a histogram
/// over its range. The names are those that train --data takes. With --inputs and --targets (or --recipe), and with the
/// arguments of train --data, it measures on held-out samples how well the readings determine each target, by ridge and kernel
/// ridge regression and with confidence intervals, how optimistic a random split would be, and what may be a leak.
#[derive(Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Inspect {
    #[command(flatten)]
    import: ImportArguments,
    #[command(flatten)]
    rest: RecipeArguments,
    #[command(flatten)]
    study: StudyArguments,
    /// Write a recipe (JSON) of this import and its split instead, with which train --recipe uses the recording
    #[arg(short = 'o', long, value_name = "FILE", value_parser = output)]
    recipe_out: Option<PathBuf>,
}

impl Inspect {
    pub(super) fn run(mut self) -> Result<(), Failure> {
        self.import.rest = self.rest;
        if let Some(path) = &self.recipe_out {
            return write_recipe(&self.import.plan(&self.study.inputs)?, path);
        }
        if self.study.are_given() || self.import.has_roles() {
            return self.study.run(&self.import);
        }
        let (mut objects, mut texts) = (Vec::new(), Vec::new());
        let files = self.import.only_files()?;
        for file in &files {
            let table = with_bar(|watch| read_table(file, self.import.rest.dialect(), watch))?;
            let inspected = InspectedFile::of(&table, file, self.import.time.as_deref())?;
            let format = inspected.format.to_string();
            let dialect = match &inspected.format {
                Format::Text(dialect) => Some(dialect),
                _ => None,
            };
            inspected.warnings.iter().for_each(warn);
            let of_file = json!({"file": file.to_string_lossy(), "format": format, "dialect": dialect});
            objects.push(joined([of_file, value(&inspected)]));
            texts.push((format, inspected));
        }
        let object = || match &mut objects[..] {
            [object] => object.take(),
            objects => json!({"files": objects}),
        };
        print(object, |out| {
            for (number, (format, inspected)) in texts.iter().enumerate() {
                if number > 0 {
                    writeln!(out)?;
                }
                let (rows, columns) = (inspected.rows, inspected.columns.len());
                let size = format!("{} × {}", counted(rows, "row"), counted(columns, "column"));
                writeln!(out, "{}: {size}\n{format}\n", inspected.path.display())?;
                write!(out, "{}", columns_table(&inspected.columns).aligned())?;
                if let Some(time) = &inspected.time {
                    write_time(time, out)?;
                }
            }
            Ok(())
        })
    }
}

/// Writes the recipe of a plan that can be imported, and prints what it reads.
fn write_recipe(plan: &Plan, path: &Path) -> Result<(), Failure> {
    check_output("--recipe-out", path)?;
    let recording = with_bar(|watch| plan.recording(working_folder(), watch))?;
    RecipeFile::Recording(plan.clone()).save(path)?;
    recording.warnings.iter().for_each(warn);
    let object = || {
        let samples = json!({"rows": recording.rows, "samples": recording.set.samples()});
        joined([
            samples,
            json!({"files": files([&recording]), "dropped": recording.dropped}),
        ])
    };
    print(object, |out| {
        write_files([&recording], out)?;
        writeln!(out, "{}", counted(recording.set.samples(), "sample"))
    })
}

/// Table of the columns of a file.
fn columns_table(columns: &[ColumnSummary]) -> Table {
    let row = |column: &ColumnSummary| -> Vec<Cell> {
        let kind = match column.kind {
            ColumnKind::Number => "number",
            ColumnKind::Integer => "integer",
            ColumnKind::Text => "text",
            ColumnKind::Empty => "empty",
        };
        let number = |number: Option<f64>| number.map_or("–".to_owned(), plain);
        let notes = [
            column
                .original
                .as_deref()
                .map(|original| format!("in the file: {}", beginning(original))),
            column.is_constant.then(|| "constant".to_owned()),
            column.is_rounding.then(|| "constant except for rounding".to_owned()),
            column
                .sentinel
                .map(|found| format!("{} × {}: none?", found.cells, found.value)),
            column.duplicate_of.as_ref().map(|other| format!("the same as {other}")),
            column.first_text.as_ref().map(|(line, text)| {
                format!(
                    "{} not a number, the first is '{text}' on line {line}",
                    counted(column.texts, "cell")
                )
            }),
        ];
        vec![
            column.name.as_str().into(),
            column.unit.as_deref().unwrap_or("").into(),
            kind.into(),
            number(column.min).into(),
            number(column.max).into(),
            column.missing.into(),
            bars(&column.histogram).into(),
            Vec::from_iter(notes.into_iter().flatten()).join("; ").into(),
        ]
    };
    let names = ["column", "unit", "kind", "min", "max", "missing", "histogram", ""];
    Table {
        columns: names.map(TableColumn::field).into(),
        rows: columns.iter().map(row).collect(),
    }
}

/// Returns the first characters of a name.
fn beginning(name: &str) -> String {
    const LONGEST: usize = 60;
    match name.char_indices().nth(LONGEST) {
        None => name.to_owned(),
        Some((end, _)) => format!("{}…", &name[..end]),
    }
}

/// Formats a number as briefly as possible in at most 13 characters.
fn plain(number: f64) -> String {
    let short = format!("{number}");
    if short.len() <= 13 {
        short
    } else {
        format!("{number:.6e}")
    }
}

fn bars(histogram: &[usize]) -> String {
    const HEIGHTS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let most = histogram.iter().copied().max().unwrap_or(0).max(1);
    // A nonzero count is always visible.
    let height = |&count: &usize| (count * (HEIGHTS.len() - 1)).div_ceil(most);
    histogram.iter().map(|count| HEIGHTS[height(count)]).collect()
}

fn write_time(time: &TimeSummary, out: &mut dyn Write) -> io::Result<()> {
    let guessed = if time.is_guessed {
        " (assumed to be the time)"
    } else {
        ""
    };
    write!(out, "\nTime {}{guessed}: ", time.column)?;
    match time.median_interval {
        Some(median) => write!(
            out,
            "median interval {}, {} of more than 5 times that",
            format_number(median),
            counted(time.gaps, "gap")
        )?,
        None => write!(out, "all times are equal")?,
    }
    if let (Some(longest), Some(line)) = (time.longest, time.longest_after_line) {
        write!(out, ", the longest {} after line {line}", format_number(longest))?;
    }
    if time.backwards > 0 {
        write!(out, "; it runs backwards {}", counted(time.backwards, "time"))?;
    }
    writeln!(out)
}

/// Samples of a recording, and how they are divided, as JSON and as text.
#[derive(Default)]
pub(super) struct RecordingReport {
    pub(super) object: Value,
    pub(super) text: Vec<u8>,
}

impl RecordingReport {
    pub(super) fn new(sets: &RunSets, recordings: &Recordings) -> io::Result<Self> {
        let all = || once(&recordings.training).chain(&recordings.test);
        let recording = &recordings.training;
        let training = sets.split.training.samples();
        let validation = sets.split.validation.as_ref().map_or(0, Dataset::samples);
        let test = sets.test.samples();
        let split = match recordings.test {
            Some(_) => "file".to_owned(),
            None => recordings.recorded.plan.division.by.to_string(),
        };
        let mut object = json!({
            "files": files(all()),
            "inputs": recording.problem.features(),
            "split": split,
            "test_fraction": test as f64 / (training + validation + test) as f64,
            "rows": all().map(|recording| recording.rows).sum::<usize>(),
            "samples": training,
            "validation_samples": validation,
            "test_samples": test,
            "dropped": Vec::from_iter(all().flat_map(|recording| &recording.dropped)),
        });
        let position = |&TargetPosition { target, x_mm, y_mm }: &TargetPosition| json!({"target": recording.problem.targets[target].name, "x_mm": x_mm, "y_mm": y_mm});
        if !recording.problem.positions.is_empty() {
            object["positions"] = recording.problem.positions.iter().map(position).collect();
        }
        let mut text = Vec::new();
        write_files(all(), &mut text)?;
        let samples = counted(training, "sample");
        writeln!(
            text,
            "{samples} for training, {validation} for validation, {test} for testing (split by {split})"
        )?;
        if let Some(positions) = describe_positions(&recording.problem.positions) {
            writeln!(text, "{positions}")?;
        }
        Ok(Self { object, text })
    }
}

/// Warnings of the import.
pub(super) fn import_warnings(recordings: &Recordings) -> Vec<String> {
    Recording::warnings_of(once(&recordings.training).chain(&recordings.test))
}

/// The files of recordings, with their formats.
pub(super) fn files<'a>(recordings: impl IntoIterator<Item = &'a Recording>) -> Value {
    let found = |file: &FileReport| {
        json!({
            "path": file.path.to_string_lossy(),
            "format": file.format.to_string(),
            "rows": file.rows,
            "columns": file.columns,
            "join": file.join,
        })
    };
    let files = recordings.into_iter().flat_map(|recording| &recording.files);
    files.map(found).collect()
}

/// Writes the files of recordings, and the rows that were dropped.
pub(super) fn write_files<'a>(
    recordings: impl IntoIterator<Item = &'a Recording>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let recordings = Vec::from_iter(recordings);
    for file in recordings.iter().flat_map(|recording| &recording.files) {
        let size = format!("{} × {}", counted(file.rows, "row"), counted(file.columns, "column"));
        writeln!(out, "{}: {size}, {}", file.path.display(), file.format)?;
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
    let rows: usize = recordings.iter().map(|recording| recording.rows).sum();
    for dropped in recordings.iter().flat_map(|recording| &recording.dropped) {
        let (count, reason, line) = (dropped.rows, &dropped.reason, dropped.first_line);
        writeln!(out, "{count} of {rows} rows dropped: {reason} (first on line {line})")?;
    }
    Ok(())
}

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
            let targets = recording.problem.targets.iter().enumerate();
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
            for (channel, of) in recording.problem.targets.iter().zip(&findings.targets) {
                write!(out, "{}", capitalised(&describe_target(&channel.name, of)))?;
                if let (Ok(ridge), Some(kernel)) = (of.ridge, of.kernel) {
                    let [ridge, kernel] = [ridge, kernel].map(|of| format_below_one(of.r2.value, 2));
                    write!(out, " (ridge {ridge}, kernel ridge {kernel})")?;
                }
                writeln!(out)?;
            }
            writeln!(out)?;
            for (index, channel) in recording.problem.targets.iter().enumerate() {
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
