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
use decoupler_files::export::{Cell, MergedSweep, SweepFiles, Table};
use serde_json::Value;

use super::{Note, Page, Report, Row, Tone};
use crate::window::{
    job::{self, Background, Wake},
    shared::{FileTask, FileWords},
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

/// The report of a changed folder, or the reason why the folder is no longer read.
type FolderEvent = Result<Option<Report>, String>;

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
        FileTask::choose(FOLDER, "", self.choices.clone())
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
            self.shown = Some(report(&path, "Reading the folder…", Page::default()));
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

fn report(path: &Path, conditions: &str, page: Page) -> Report {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    Report {
        headline: format!("Sweep folder {name}"),
        conditions: conditions.to_owned(),
        pages: vec![page],
    }
}

/// Minimum time between two reads of the folder.
const BETWEEN_LOOKS: Duration = Duration::from_secs(1);
/// Ratio of the pause between reads to the time of a read, so that a large folder does not keep the disk busy.
const REST: u32 = 10;

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
                Ok(merged) => {
                    let (finished, begun) = (counted(merged.trials.len(), "trial"), merged.missing.len());
                    let text = format!("{finished} finished, {begun} begun. New trials appear here automatically.");
                    report(path, &text, page(&merged))
                }
                Err(reason) => report(path, "", failed(reason)),
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

/// Maximum number of problems listed.
const MAX_PROBLEMS: usize = 3;

/// Returns the table of the trials, with the options that differ and the results that there are, and the problems of the
/// folder.
fn page(merged: &MergedSweep) -> Page {
    let trials = &merged.trials;
    let names: BTreeSet<&String> = trials.iter().flat_map(|row| row.options.keys()).collect();
    let options = names.into_iter().map(|name| {
        let cells = trials.iter().map(|row| cell(row.options.get(name)));
        (name.as_str(), Vec::from_iter(cells))
    });
    let options = Vec::from_iter(options.filter(|(_, cells)| cells.iter().any(|cell| *cell != cells[0])));
    let results = RESULTS.iter().map(|&(heading, place, field)| {
        let cells = trials.iter().map(|row| match row.result.pointer(place) {
            Some(Value::Array(targets)) => mean(targets, field).into(),
            value => cell(value),
        });
        (heading, Vec::from_iter(cells))
    });
    let results = results.filter(|(_, cells)| cells.iter().any(|cell| cell.number().is_some()));
    let seconds = trials.iter().map(|row| cell(row.time.get("seconds"))).collect();
    let columns = options.iter().cloned().chain(results).chain([("seconds", seconds)]);
    let columns = Vec::from_iter(columns);
    let row = |item: usize| {
        let named = options
            .iter()
            .map(|(name, cells)| format!("{name} {}", cells[item].rounded()));
        let mut tones = vec![Tone::Usual; columns.len()];
        tones[..options.len()].fill(Tone::Strong);
        tones[options.len()] = Tone::Own;
        Row {
            item,
            name: Vec::from_iter(named).join(", "),
            tones,
            ..Row::default()
        }
    };
    let conflicts = merged.conflicting.iter();
    let conflicts = conflicts.map(|files| format!("same options, different results: {files}; delete the wrong one"));
    let problems = Vec::from_iter(merged.damaged.iter().cloned().chain(conflicts));
    let more = problems.len().saturating_sub(MAX_PROBLEMS);
    let mut notes = Vec::from_iter(problems.into_iter().take(MAX_PROBLEMS).map(Note::Warning));
    if more > 0 {
        notes.push(Note::Warning(format!("and {} more", counted(more, "problem"))));
    }
    let cells_of = |item: usize| columns.iter().map(|(_, cells)| cells[item].clone()).collect();
    Page {
        what: "Trial",
        rows: (0..trials.len()).map(row).collect(),
        table: Table::of_headings(
            columns.iter().map(|(heading, _)| *heading),
            (0..trials.len()).map(cells_of),
        ),
        notes,
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
