//! A folder that `decoupler sweep` fills, on this machine or on others, and the growing table of its trials.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};

use decoupler_core::text::counted;
use decoupler_files::export::{Cell, MergedSweep, SweepFiles, Table};
use serde_json::Value;

use super::{Note, Page, Report, Reporter, Row, StudyEvent, Task, Tone};
use crate::window::shared::FileWords;

/// The folder of a sweep.
pub const FOLDER: FileWords = FileWords {
    kind: "sweep folder",
    description: "A folder that decoupler sweep fills. Its finished trials are shown, and new ones as they arrive.",
    extensions: &[],
};

/// Minimum time between two reads of the folder.
const BETWEEN_LOOKS: Duration = Duration::from_secs(1);
/// Interval at which a pause looks whether it is to end.
const WAIT: Duration = Duration::from_millis(50);

/// Returns the task that shows the folder until it is cancelled.
pub fn task(path: PathBuf) -> Task {
    Task::new(String::new(), None::<Report>, move |reporter| watch(&path, reporter))
}

/// Reads the folder whenever its files change.
///
/// # Errors
/// If it cannot be read.
fn watch(path: &Path, reporter: &Reporter) -> Result<(), String> {
    let mut before = None;
    while !reporter.is_cancelled() {
        let begun = Instant::now();
        let files = SweepFiles::list(path).ok();
        if before.as_ref() != Some(&files) {
            let merged = MergedSweep::read(&[path.to_owned()]).map_err(|error| error.to_string())?;
            let text = format!("{} begun. New trials appear here automatically.", merged.missing.len());
            reporter.send(StudyEvent::Report(Box::new(report(path, text, page(&merged)))));
            before = Some(files);
        }
        while begun.elapsed() < BETWEEN_LOOKS && !reporter.is_cancelled() {
            thread::sleep(WAIT);
        }
    }
    Ok(())
}

fn report(path: &Path, conditions: String, page: Page) -> Report {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    Report {
        headline: format!("Sweep folder {name}: {} finished", counted(page.rows.len(), "trial")),
        conditions,
        pages: vec![page],
    }
}

/// Results of a trial, on an array or on a recording: heading, place in its report and, for a list of targets, the field
/// whose mean over the targets is shown.
const RESULTS: [(&str, &str, &str); 7] = [
    ("Z %", "/errors/z_percent", ""),
    ("X %", "/errors/x_percent", ""),
    ("linear map Z %", "/baselines/linear/z_percent", ""),
    ("error %", "/targets", "percent_of_range"),
    ("R²", "/targets", "r2"),
    ("ridge %", "/baselines/ridge", "percent_of_range"),
    ("epochs", "/epochs", ""),
];

/// Returns the table of the trials, with the options that differ and the results that there are, and the problems of the
/// folder.
fn page(merged: &MergedSweep) -> Page {
    let trials = &merged.trials;
    let names: BTreeSet<&String> = trials.iter().flat_map(|row| row.options.keys()).collect();
    let options = names.into_iter().map(|name| {
        let cells = trials.iter().map(|row| cell(row.options.get(name)));
        (name.as_str(), Vec::from_iter(cells))
    });
    let mut columns = Vec::from_iter(options.filter(|(_, cells)| cells.iter().any(|cell| *cell != cells[0])));
    let options = columns.len();
    let results = RESULTS.iter().map(|&(heading, place, field)| {
        let cells = trials.iter().map(|row| match row.result.pointer(place) {
            Some(Value::Array(targets)) => mean(targets, field).into(),
            value => cell(value),
        });
        (heading, Vec::from_iter(cells))
    });
    columns.extend(results.filter(|(_, cells)| cells.iter().any(|cell| cell.number().is_some())));
    columns.push((
        "seconds",
        trials.iter().map(|row| cell(row.time.get("seconds"))).collect(),
    ));
    let row = |item: usize| {
        let named = columns[..options].iter();
        let named = named.map(|(name, cells)| format!("{name} {}", cells[item].rounded()));
        let mut tones = vec![Tone::Usual; columns.len()];
        tones[..options].fill(Tone::Strong);
        tones[options] = Tone::Own;
        Row {
            item,
            name: Vec::from_iter(named).join(", "),
            tones,
            ..Row::default()
        }
    };
    let conflicts = merged.conflicting.iter();
    let conflicts = conflicts.map(|files| format!("same options, different results: {files}; delete the wrong one"));
    let problems = merged.damaged.iter().cloned().chain(conflicts);
    let cells_of = |item: usize| columns.iter().map(|(_, cells)| cells[item].clone()).collect();
    let headings = columns.iter().map(|(heading, _)| *heading);
    Page {
        what: "Trial",
        rows: (0..trials.len()).map(row).collect(),
        table: Table::of_headings(headings, (0..trials.len()).map(cells_of)),
        notes: problems.map(|text| Note::Line(Tone::Warning, text)).collect(),
        ..Page::default()
    }
}

/// Returns the mean of a field over the targets that have it.
fn mean(targets: &[Value], field: &str) -> Option<f64> {
    let values = Vec::from_iter(targets.iter().filter_map(|target| target[field].as_f64()));
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn cell(value: Option<&Value>) -> Cell {
    match value {
        None | Some(Value::Null) => Cell::Number(None),
        Some(Value::String(text)) => Cell::Text(text.clone()),
        Some(Value::Number(number)) => match number.as_u64() {
            Some(count) => Cell::Count(count),
            None => Cell::Number(number.as_f64()),
        },
        Some(value) => Cell::Text(value.to_string()),
    }
}
