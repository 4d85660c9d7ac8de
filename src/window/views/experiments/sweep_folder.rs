//! A folder that `decoupler sweep` fills, on this machine or on others, and the growing table of its trials.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    time::{Duration, Instant},
};

use decoupler_core::text::counted;
use decoupler_files::export::{MergedSweep, SweepFiles, SweepRow, atomic_write, format_number};
use eframe::egui::{Align, Label, Layout, RichText, Ui, vec2};
use serde_json::Value;

use crate::window::{
    job::{Background, Report, Wake},
    shared::{Effect, FileTask, FileWords},
    theme::{Theme, semibold, space, type_size},
    widgets::{
        ColumnWidth, SortBy, TableCell, TableClick, TableColumn, TableRow, TableView, dim_ui, ghost_button, note_ui,
        placeholder_ui, section_heading_ui,
    },
};

/// The folder of a sweep.
const FOLDER: FileWords = FileWords {
    kind: "sweep folder",
    description: "A folder that decoupler sweep fills. Its finished trials are shown, and new ones as they arrive.",
    extensions: &[],
};

/// The current folder, if any, and the dialogs that ask for one.
#[derive(Debug)]
pub(in crate::window::views::experiments) struct SweepFolder {
    pub(super) open: Option<OpenFolder>,
    job: Background<FolderEvent>,
    choices: Sender<PathBuf>,
    chosen: Receiver<PathBuf>,
}

/// A displayed folder.
#[derive(Debug)]
pub(in crate::window::views::experiments) struct OpenFolder {
    pub(super) path: PathBuf,
    /// Its table, or the error; `None` until it is read.
    pub(super) table: Option<Result<Box<SweepTable>, String>>,
    pub(super) sort: SortBy,
    /// Ends the watch when dropped.
    _watched: Sender<()>,
}

impl SweepFolder {
    /// Creates the card without a folder; `wake` is called when a folder has events.
    pub(in crate::window::views::experiments) fn new(wake: Wake) -> Self {
        let (choices, chosen) = channel();
        Self {
            open: None,
            job: Background::new("sweep folder", wake),
            choices,
            chosen,
        }
    }

    /// Asks for a folder.
    pub(in crate::window::views::experiments) fn choose(&self) -> FileTask {
        FileTask::choose(FOLDER, "", self.choices.clone())
    }

    /// The current folder.
    pub(in crate::window::views::experiments) fn shown(&self) -> Option<&OpenFolder> {
        self.open.as_ref()
    }

    pub(in crate::window::views::experiments) fn close(&mut self) {
        self.open = None;
        self.job.abandon();
    }

    pub(in crate::window::views::experiments) fn take_events(&mut self) {
        while let Ok(path) = self.chosen.try_recv() {
            self.show(path);
        }
        while let Some(event) = self.job.next_event() {
            let table = match event {
                FolderEvent::Read(table) => table,
                FolderEvent::Ended(Err(reason)) => Err(reason),
                FolderEvent::Ended(Ok(())) => continue,
            };
            if let Some(open) = &mut self.open {
                open.table = Some(table);
            }
        }
    }

    fn show(&mut self, path: PathBuf) {
        let (watched, open) = channel();
        let of_job = path.clone();
        self.open = Some(OpenFolder {
            path,
            table: None,
            sort: SortBy::default(),
            _watched: watched,
        });
        self.job.start(
            move |report| watch(&of_job, &open, report),
            |ended| FolderEvent::Ended(ended.map_err(|error| error.to_string())),
        );
    }
}

impl OpenFolder {
    /// Returns the name of the folder.
    pub(in crate::window::views::experiments) fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or(Path::new("").as_os_str());
        name.to_string_lossy().into_owned()
    }

    /// Returns the number of finished trials, once they are read.
    pub(in crate::window::views::experiments) fn trials(&self) -> Option<usize> {
        let table = self.table.as_ref()?.as_ref().ok()?;
        Some(table.rows.len())
    }
}

/// Minimum time between two reads of the folder.
const BETWEEN_LOOKS: Duration = Duration::from_secs(1);
/// Ratio of the pause between reads to the time of a read, so that a large folder does not keep the disk busy.
const REST: u32 = 10;

/// Event of a folder.
#[derive(Debug)]
pub(in crate::window::views::experiments) enum FolderEvent {
    /// The table of a changed folder, or the reason why it cannot be read.
    Read(Result<Box<SweepTable>, String>),
    /// Watching has ended, with the reason if it failed.
    Ended(Result<(), String>),
}

/// Reads the folder at `path` whenever its files change, until the other end of `open` is gone.
pub(super) fn watch(path: &Path, open: &Receiver<()>, report: &Report<FolderEvent>) {
    let mut before = None;
    loop {
        let begun = Instant::now();
        let files = SweepFiles::list(path).map_err(|error| error.to_string());
        if before.as_ref() != Some(&files) {
            let table = match &files {
                Ok(_) => read(path),
                Err(error) => Err(error.clone()),
            };
            // Only the newest of the tables not yet received is needed.
            report.progress(FolderEvent::Read(table), |_, _| ());
            before = Some(files);
        }
        match open.recv_timeout(BETWEEN_LOOKS.max(REST * begun.elapsed())) {
            Err(RecvTimeoutError::Timeout) if !report.is_cancelled() => {}
            _ => return,
        }
    }
}

fn read(path: &Path) -> Result<Box<SweepTable>, String> {
    let merged = MergedSweep::read(&[PathBuf::from(path)]).map_err(|error| error.to_string())?;
    Ok(Box::new(SweepTable::of(&merged)))
}

/// Table of the trials of a folder.
#[derive(Debug)]
pub(in crate::window::views::experiments) struct SweepTable {
    pub(super) headings: Vec<String>,
    /// Number of headings that name options.
    pub(super) options: usize,
    pub(super) rows: Vec<Vec<SweepCell>>,
    /// Number of trials begun and not finished.
    pub(super) unfinished: usize,
    /// Problems with files of the folder.
    pub(super) problems: Vec<String>,
}

#[derive(Clone, Debug)]
pub(super) struct SweepCell {
    pub(super) text: String,
    pub(super) value: Option<f64>,
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
    let is_recorded = |row: &SweepRow| row.result.get("targets").is_some();
    let (recorded, simulated): (Vec<_>, Vec<_>) = merged.trials.iter().partition(|row| is_recorded(row));
    match (recorded.is_empty(), simulated.is_empty()) {
        (true, _) => ON_NODES.to_vec(),
        (false, true) => ON_TARGETS.to_vec(),
        (false, false) => ON_NODES[..3].iter().chain(&ON_TARGETS).copied().collect(),
    }
}

impl SweepTable {
    pub(super) fn of(merged: &MergedSweep) -> Self {
        let options = varying(merged);
        let results = results_of(merged);
        let of_results = results.iter().map(|(heading, ..)| (*heading).to_owned());
        let headings = options.iter().cloned().chain(of_results).chain(["seconds".to_owned()]);
        let mut problems = merged.damaged.clone();
        let conflicts = merged.conflicting.iter();
        problems
            .extend(conflicts.map(|files| format!("same options, different results: {files}; delete the wrong one")));
        Self {
            headings: headings.collect(),
            options: options.len(),
            rows: merged.trials.iter().map(|row| cells(row, &options, &results)).collect(),
            unfinished: merged.missing.len(),
            problems,
        }
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

fn cells(row: &SweepRow, options: &[String], results: &[ResultColumn]) -> Vec<SweepCell> {
    let of_options = options.iter().map(|option| SweepCell::of(row.options.get(option)));
    let of_results = results
        .iter()
        .map(|(_, place, field)| match (row.result.pointer(place), field) {
            (Some(Value::Array(targets)), Some(field)) => SweepCell::of(mean(targets, field).as_ref()),
            (value, _) => SweepCell::of(value),
        });
    let seconds = SweepCell::of(row.time.get("seconds"));
    of_options.chain(of_results).chain([seconds]).collect()
}

/// Returns the mean of a field over the targets that have it.
fn mean(targets: &[Value], field: &str) -> Option<Value> {
    let values = Vec::from_iter(targets.iter().filter_map(|target| target[field].as_f64()));
    (!values.is_empty()).then(|| Value::from(values.iter().sum::<f64>() / values.len() as f64))
}

impl SweepCell {
    fn of(value: Option<&Value>) -> Self {
        let text = match value {
            None | Some(Value::Null) => "–".to_owned(),
            Some(Value::String(text)) => text.clone(),
            Some(Value::Array(values)) => {
                let texts: Vec<_> = values.iter().map(|value| Self::of(Some(value)).text).collect();
                texts.join(" ")
            }
            Some(value) if value.is_f64() => format_number(value.as_f64()),
            Some(value) => value.to_string(),
        };
        Self {
            text,
            value: value.and_then(Value::as_f64),
        }
    }
}

/// Maximum number of problems listed.
const MAX_PROBLEMS: usize = 3;

/// Shows the folder: its progress and the table of its trials.
pub(in crate::window::views::experiments) fn folder_card_ui(ui: &mut Ui, folder: &mut SweepFolder) {
    let Some(open) = &mut folder.open else { return };
    let mut is_closed = false;
    ui.horizontal(|ui| {
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            is_closed = ui.add(ghost_button("Close folder")).clicked();
            let heading = RichText::new(format!("Sweep folder {}", open.name())).font(semibold(type_size().title));
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                let heading = ui.add(Label::new(heading).truncate());
                heading.on_hover_text(open.path.display().to_string());
            });
        });
    });
    let OpenFolder { table, sort, .. } = open;
    match table {
        None => placeholder_ui(ui, "Reading the folder…"),
        Some(Err(reason)) => {
            note_ui(ui, reason);
        }
        Some(Ok(table)) => trials_ui(ui, table, sort),
    }
    if is_closed {
        folder.close();
    }
}

fn trials_ui(ui: &mut Ui, table: &SweepTable, sort: &mut SortBy) {
    let finished = counted(table.rows.len(), "trial");
    dim_ui(
        ui,
        &format!(
            "{finished} finished, {} begun. New trials appear here automatically.",
            table.unfinished
        ),
    );
    ui.add_space(space(1));
    for problem in table.problems.iter().take(MAX_PROBLEMS) {
        note_ui(ui, problem);
    }
    if table.problems.len() > MAX_PROBLEMS {
        let rest = table.problems.len() - MAX_PROBLEMS;
        note_ui(ui, &format!("and {} more", counted(rest, "problem")));
    }
    if table.rows.is_empty() {
        return placeholder_ui(ui, "No trial has finished yet.");
    }
    ui.allocate_ui(vec2(ui.available_width(), ui.available_height()), |ui| {
        table_ui(ui, table, sort);
    });
}

fn table_ui<'a>(ui: &mut Ui, table: &'a SweepTable, sort: &mut SortBy) {
    let palette = &Theme::of(ui).palette;
    let column = |(place, heading): (usize, &'a String)| {
        let is_figure = table.rows.iter().any(|row| row[place].value.is_some());
        let column = if is_figure {
            TableColumn::figure(heading)
        } else {
            TableColumn::text(heading)
        };
        column.width(ColumnWidth::of_longest(
            table.rows.iter().map(|row| row[place].text.as_str()),
        ))
    };
    let columns: Vec<TableColumn<'_>> = table.headings.iter().enumerate().map(column).collect();
    let cell = |row: usize, column: usize| {
        let cell = &table.rows[row][column];
        (cell.value, cell.text.as_str())
    };
    let order = sort.order(table.rows.len(), cell);
    let row = |place: usize| {
        let cells = &table.rows[order[place]];
        let options: Vec<String> = (cells[..table.options].iter().zip(&table.headings))
            .map(|(cell, option)| format!("{option} {}", cell.text))
            .collect();
        let name = options.join(", ");
        let cells = cells.iter().enumerate().map(|(column, cell)| {
            let colour = if column == table.options {
                palette.accent
            } else {
                palette.text
            };
            TableCell::new(&cell.text)
                .colour(colour)
                .strong(column <= table.options)
        });
        TableRow::new(cells).labelled(format!("Trial {name}")).named(name)
    };
    let view = TableView::new("sweep folder", &columns).sorted(*sort);
    if let Some(TableClick::Sort(chosen)) = view.show(ui, order.len(), row) {
        *sort = chosen;
    }
}

/// The specification of a sweep.
const SPECIFICATION: FileWords = FileWords {
    kind: "specification",
    description: "This sweep for the terminal, on one machine or many: decoupler sweep --spec FILE --out FOLDER trains it, \
                  and --shard I/N a part of it.",
    extensions: &["json"],
};

fn specification_task(specification: Value) -> FileTask {
    FileTask::save(SPECIFICATION, "sweep", move |path| {
        atomic_write(path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, &specification)?;
            writeln!(writer)
        })
    })
}

/// Sweeps on other machines: saves the sweep of the form as a specification, opens a folder that is being filled.
pub(in crate::window::views::experiments) fn folder_form_ui(
    ui: &mut Ui,
    folder: &SweepFolder,
    specification: &Result<Value, String>,
    effects: &mut Vec<Effect>,
) {
    section_heading_ui(ui, "On many machines");
    dim_ui(
        ui,
        "The command decoupler sweep trains a specification on any number of machines and fills a folder, which is shown here.",
    );
    let refusal = specification.as_ref().err().map_or("", String::as_str);
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.y = space(1);
        let save = ui.add_enabled(refusal.is_empty(), ghost_button("Save specification…"));
        let save = save
            .on_hover_text(SPECIFICATION.description)
            .on_disabled_hover_text(refusal);
        if let (true, Ok(specification)) = (save.clicked(), specification) {
            effects.push(Effect::ChooseFile(specification_task(specification.clone())));
        }
        let open = ui.add(ghost_button("Open sweep folder…"));
        let open = open.on_hover_text("Shows the trials of a folder that decoupler sweep fills, as they finish.");
        if open.clicked() {
            effects.push(Effect::ChooseFile(folder.choose()));
        }
    });
}
