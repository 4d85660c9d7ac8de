//! A folder that `decoupler sweep` fills, on this machine or on others, and the growing table of its trials.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    time::{Duration, Instant},
};

use decoupler_core::text::counted;
use decoupler_files::export::{Cell, MergedSweep, SweepFiles, SweepRow, Table};
use serde_json::Value;

use super::{Note, Page, Report, Row, Tone};
use crate::window::{
    job::{self, Background, Wake},
    shared::{FileTask, FileWords, Purpose},
};

const FOLDER: FileWords = FileWords {
    kind: "sweep folder",
    description: "A folder that decoupler sweep fills. Its finished trials are shown, and new ones as they arrive.",
    extensions: &[],
};

/// The folder that is shown, if any, and the dialogs that ask for one.
#[derive(Debug)]
pub struct SweepFolder {
    /// The folder, with its trials so far.
    pub shown: Option<Report>,
    job: Background<FolderEvent>,
    /// Ends the watch when dropped.
    watched: Option<Sender<()>>,
    choices: Sender<PathBuf>,
    chosen: Receiver<PathBuf>,
}

impl SweepFolder {
    /// Shows no folder; `wake` is called when a folder has changed.
    pub fn new(wake: &Wake) -> Self {
        let (choices, chosen) = channel();
        Self {
            shown: None,
            job: Background::new("sweep folder", Arc::clone(wake)),
            watched: None,
            choices,
            chosen,
        }
    }

    /// Asks for a folder.
    pub fn choose(&self) -> FileTask {
        FileTask {
            words: FOLDER,
            suggestion: String::new(),
            purpose: Purpose::Choose(self.choices.clone()),
        }
    }

    /// Shows no folder any more.
    pub fn close(&mut self) {
        (self.shown, self.watched) = (None, None);
        self.job.abandon();
    }

    /// Shows a folder that was chosen, and what has changed in it.
    pub fn take_events(&mut self) {
        while let Ok(path) = self.chosen.try_recv() {
            let (watched, open) = channel();
            self.watched = Some(watched);
            self.shown = Some(report(&path, "Reading the folder…".to_owned(), Page::default()));
            self.job.start(
                move |reporter| watch(&path, &open, reporter),
                |ended| ended.map(|()| None).map_err(|error| error.to_string()),
            );
        }
        while let Some(event) = self.job.next_event() {
            match (event, &mut self.shown) {
                (Ok(Some(report)), shown) => *shown = Some(report),
                (Err(reason), Some(shown)) => shown.pages = vec![failed(reason)],
                _ => {}
            }
        }
    }
}

fn failed(reason: String) -> Page {
    Page {
        notes: vec![Note::Warning(reason)],
        ..Page::default()
    }
}

fn report(path: &Path, conditions: String, page: Page) -> Report {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    Report {
        headline: format!("Sweep folder {name}"),
        conditions,
        pages: vec![page],
    }
}

/// Minimum time between two reads of the folder.
const BETWEEN_LOOKS: Duration = Duration::from_secs(1);
/// Ratio of the pause between reads to the time of a read, so that a large folder does not keep the disk busy.
const REST: u32 = 10;

/// The report of a changed folder, or the reason why the folder is no longer read.
type FolderEvent = Result<Option<Report>, String>;

/// Reads the folder at `path` whenever its files change, until the other end of `open` is gone.
fn watch(path: &Path, open: &Receiver<()>, reporter: &job::Report<FolderEvent>) {
    let mut before = None;
    loop {
        let begun = Instant::now();
        let files = SweepFiles::list(path).map_err(|error| error.to_string());
        if before.as_ref() != Some(&files) {
            let merged = files.as_ref().map_err(String::clone).and_then(|_| {
                let merged = MergedSweep::read(&[path.to_owned()]);
                merged.map_err(|error| error.to_string())
            });
            let shown = match merged {
                Ok(merged) => report(path, conditions(&merged), page(&merged)),
                Err(reason) => report(path, String::new(), failed(reason)),
            };
            // Only the newest of the reports not yet received is needed.
            reporter.progress(Ok(Some(shown)), |_, _| ());
            before = Some(files);
        }
        match open.recv_timeout(BETWEEN_LOOKS.max(REST * begun.elapsed())) {
            Err(RecvTimeoutError::Timeout) if !reporter.is_cancelled() => {}
            _ => return,
        }
    }
}

fn conditions(merged: &MergedSweep) -> String {
    format!(
        "{} finished, {} begun. New trials appear here automatically.",
        counted(merged.trials.len(), "trial"),
        merged.missing.len()
    )
}

/// Results of a trial: heading, place in its report and, for a list of targets, the field whose mean over the targets
/// is shown.
type ResultColumn = (&'static str, &'static str, Option<&'static str>);

/// Results on an array.
const ON_NODES: [ResultColumn; 4] = [
    ("Z %", "/errors/z_percent", None),
    ("X %", "/errors/x_percent", None),
    ("linear map Z %", "/baselines/linear/z_percent", None),
    ("epochs", "/epochs", None),
];

/// Results on a recording; the error is the mean absolute one in percent of the range.
const ON_TARGETS: [ResultColumn; 4] = [
    ("error %", "/targets", Some("percent_of_range")),
    ("R²", "/targets", Some("r2")),
    ("ridge %", "/baselines/ridge", Some("percent_of_range")),
    ("epochs", "/epochs", None),
];

fn results_of(merged: &MergedSweep) -> Vec<ResultColumn> {
    let is_recorded = |row: &&SweepRow| row.result.get("targets").is_some();
    let recorded = merged.trials.iter().filter(is_recorded).count();
    match recorded {
        0 => ON_NODES.to_vec(),
        _ if recorded == merged.trials.len() => ON_TARGETS.to_vec(),
        _ => ON_NODES[..3].iter().chain(&ON_TARGETS).copied().collect(),
    }
}

/// Maximum number of problems listed.
const MAX_PROBLEMS: usize = 3;

/// Returns the table of the trials, with the problems of the folder.
fn page(merged: &MergedSweep) -> Page {
    let options = varying(merged);
    let results = results_of(merged);
    let cells = |row: &SweepRow| {
        let of_options = options.iter().map(|option| cell(row.options.get(option)));
        let of_results = results.iter().map(|(_, place, field)| {
            match (row.result.pointer(place), field) {
                (Some(Value::Array(targets)), Some(field)) => mean(targets, field).into(),
                (value, _) => cell(value),
            }
        });
        let seconds = cell(row.time.get("seconds"));
        Vec::from_iter(of_options.chain(of_results).chain([seconds]))
    };
    let headings = options.iter().map(String::as_str);
    let headings = headings.chain(results.iter().map(|(heading, ..)| *heading)).chain(["seconds"]);
    let table = Table::of_headings(headings, merged.trials.iter().map(cells));
    let row = |(item, cells): (usize, &Vec<Cell>)| {
        let named = options.iter().zip(cells);
        let names = named.map(|(option, value)| format!("{option} {}", value.rounded()));
        let mut tones = vec![Tone::Usual; cells.len()];
        tones[..options.len()].fill(Tone::Strong);
        tones[options.len()] = Tone::Own;
        Row {
            tones,
            ..Row::new(item, Vec::from_iter(names).join(", "))
        }
    };
    let conflicts = merged.conflicting.iter();
    let conflicts =
        conflicts.map(|files| format!("same options, different results: {files}; delete the wrong one"));
    let problems = Vec::from_iter(merged.damaged.iter().cloned().chain(conflicts));
    let more = problems.len().saturating_sub(MAX_PROBLEMS);
    let mut notes = Vec::from_iter(problems.into_iter().take(MAX_PROBLEMS).map(Note::Warning));
    if more > 0 {
        notes.push(Note::Warning(format!("and {} more", counted(more, "problem"))));
    }
    if merged.trials.is_empty() {
        notes.push(Note::Dim("No trial has finished yet.".to_owned()));
    }
    Page {
        what: "Trial",
        rows: table.rows.iter().enumerate().map(row).collect(),
        table,
        notes,
        ..Page::default()
    }
}

/// Returns the options that differ between trials.
fn varying(merged: &MergedSweep) -> Vec<String> {
    let names: BTreeSet<&String> = merged.trials.iter().flat_map(|row| row.options.keys()).collect();
    let differs = |name: &&String| {
        let mut values = merged.trials.iter().map(|row| row.options.get(*name));
        values.next().is_some_and(|first| values.any(|value| value != first))
    };
    names.into_iter().filter(differs).cloned().collect()
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
        Some(Value::Array(values)) => {
            let texts = values.iter().map(|value| cell(Some(value)).rounded());
            Cell::Text(Vec::from_iter(texts).join(" "))
        }
        Some(value) => match value.as_u64() {
            Some(count) => Cell::Count(count),
            None => Cell::Number(value.as_f64()),
        },
    }
}
