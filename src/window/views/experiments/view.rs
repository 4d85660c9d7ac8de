//! The results of an experiment: table, figure and remarks.

use std::time::Instant;

use decoupler_core::text::counted;
use decoupler_files::{
    export::{
        Cell, ExperimentColumnKind, ExperimentTable, describe_conditions, describe_failures, describe_worse_than_mean,
    },
    figure::{Figure, HeatMap},
};
use eframe::egui::{Align, FontId, Label, Layout, RichText, Sense, Ui, Vec2, vec2};

use super::{
    ExperimentLook, ExperimentsView, Outcome, Topic,
    panel::{self, open_cell},
    state::ExperimentEvent,
    sweep_folder::folder_card_ui,
};
use crate::window::{
    plotting::{CellPointed, Pointer, heat_map_ui, plots_ui},
    shared::{Command, Effect, Holdings, Matter, Notice, Offers, Shared, Shown, Status, Unfinished, View},
    theme::{Theme, semibold, space, type_size},
    widgets::{
        ColumnWidth, TableCell, TableClick, TableColumn, TableRow, TableView, card_ui, ghost_button, invitation_ui,
        placeholder_ui, scrolled_ui, section_heading_ui,
    },
};

impl View for ExperimentsView {
    fn take_events(&mut self, _shared: &Shared, effects: &mut Vec<Effect>) {
        let mut finished = Vec::new();
        while let Some(event) = self.job.next_event() {
            match event {
                ExperimentEvent::Read(problem) => self.describe(problem),
                ExperimentEvent::Finished(trial) => finished.push(*trial),
                ExperimentEvent::Ended(result) => {
                    self.record(std::mem::take(&mut finished));
                    self.end(Instant::now());
                    effects.extend(
                        result
                            .err()
                            .map(|reason| Effect::Notify(Matter::Experiments, Notice::Failed(reason))),
                    );
                }
            }
        }
        if !finished.is_empty() {
            self.record(finished);
        }
        self.folder.take_events();
    }

    fn holdings(&self, _shared: &Shared) -> Holdings {
        let running = self.running.iter();
        let unfinished = running.map(|running| {
            let (name, done) = (running.topic.name(), running.done);
            let progress = format!("{name}, {done} of {} finished", counted(running.trials, "trial"));
            Unfinished::new("Experiment", progress)
        });
        let unsaved = self.unsaved().map(|(topic, trials)| {
            let progress = format!("{} finished, not exported as a table", counted(trials, "trial"));
            Unfinished::new(topic.name(), progress)
        });
        Holdings {
            is_computing: self.running.is_some(),
            unfinished: unfinished.chain(unsaved).collect(),
            files: Vec::new(),
        }
    }

    fn take_commands(&mut self, offers: &mut Offers<'_>, _shared: &Shared, effects: &mut Vec<Effect>) {
        if offers.offer(Command::Begin("Run experiment"), self.can_run()) {
            self.run(effects);
        }
        if offers.offer(Command::Cancel("Cancel experiment"), self.running.is_some()) {
            self.cancel();
        }
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        panel::shown(self, shared.look.colours)
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        panel::form_ui(ui, self, shared, effects);
    }

    /// Shows the table above, figure and remarks below.
    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        self.results_ui(ui, shared, effects);
        Some(panel::status(self))
    }
}

impl ExperimentsView {
    fn results_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        let whole = ui.available_rect_before_wrap();
        if self.shown_folder().is_some() {
            card_ui(ui, whole, |ui| folder_card_ui(ui, &mut self.folder));
            ui.allocate_rect(whole, Sense::hover());
            return;
        }
        let mut look = self.look;
        let Some(outcome) = self.shown() else {
            card_ui(ui, whole, |ui| {
                placeholder_ui(ui, "The values on the left cannot be run yet: the note there says why.");
            });
            return;
        };
        let gap = space(2);
        let height = results_card_height(ui, outcome, whole.width()).min((0.53 * whole.height()).round());
        let (upper, lower) = whole.split_top_bottom_at_y(whole.top() + height);
        card_ui(ui, upper, |ui| {
            results_card_ui(ui, self.topic, outcome, &mut look, shared, effects);
        });
        let lower = lower.with_min_y(lower.min.y + gap);
        let failures = describe_failures(&outcome.results);
        let remarks = describe_worse_than_mean(&outcome.results);
        let is_empty = outcome.trials().0 == 0;
        let share = match is_empty || !failures.is_empty() || !remarks.is_empty() {
            true => 0.6,
            false => 1.0,
        };
        let (left, right) = lower.split_left_right_at_x(lower.left() + (share * lower.width()).round());
        card_ui(ui, left, |ui| {
            picture_ui(ui, self.topic, outcome, &mut look, shared, effects);
        });
        let mut is_wanted = false;
        if share < 1.0 {
            card_ui(ui, right.with_min_x(right.min.x + gap), |ui| match hint(self) {
                Some(hint) if is_empty => placeholder_ui(ui, hint),
                None if is_empty => is_wanted = invitation_ui(ui, INVITATION, "Run now", self.can_run()),
                _ => {
                    section_heading_ui(ui, "Remarks");
                    scrolled_ui(ui, "remarks", |ui| remarks_ui(ui, &failures, &remarks));
                }
            });
        }
        ui.allocate_rect(whole, Sense::hover());
        self.look = look;
        if is_wanted {
            self.run(effects);
        }
    }
}

/// Text shown before an experiment is run.
const INVITATION: &str = "Our figures appear next to the published ones as the trials finish.";

/// Returns the hint shown while there is no figure yet, unless that is an invitation to run.
fn hint(experiments: &ExperimentsView) -> Option<&'static str> {
    match (&experiments.running, experiments.outcome()) {
        (Some(running), _) if running.topic == experiments.topic => Some("The figures appear as the trials finish."),
        (_, Some(_)) => Some("The experiment ended before its first trial finished."),
        _ => None,
    }
}

fn picture_ui(
    ui: &mut Ui,
    topic: Topic,
    outcome: &Outcome,
    look: &mut ExperimentLook,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    match &outcome.figure {
        Figure::HeatMap(map) => {
            let map = (**map).clone().coloured(shared.look.colours);
            sweep_ui(ui, outcome, &map, look, shared, effects);
        }
        Figure::Plots(plots) => {
            plots_ui(ui, topic.name(), plots, Pointer::Moves);
        }
        // Experiments have no surfaces.
        Figure::Surfaces(_) => {}
    }
}

/// The map of a sweep. A click marks a cell, a double click opens it in the Train view.
pub fn sweep_ui(
    ui: &mut Ui,
    outcome: &Outcome,
    map: &HeatMap,
    look: &mut ExperimentLook,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    let columns = map.columns.len().max(1);
    let marked = look.marked.map(|cell| [cell / columns, cell % columns]);
    if let Some(([row, column], pointed)) = heat_map_ui(ui, map, marked) {
        let cell = row * columns + column;
        look.marked = Some(cell);
        if pointed == CellPointed::Twice {
            open_cell(shared, outcome, cell, effects);
        }
    }
}

/// Shows failed trials and other remarks.
fn remarks_ui(ui: &mut Ui, failures: &[String], remarks: &[String]) {
    let palette = Theme::of(ui).palette;
    for (texts, colour) in [(failures, palette.bad), (remarks, palette.warning)] {
        for text in texts {
            ui.label(RichText::new(text).size(type_size().note).color(colour));
        }
    }
}

/// Margins of a card, both sides together.
const MARGINS: f32 = 24.0;

/// Shows the title, the conditions and the table.
pub fn results_card_ui(
    ui: &mut Ui,
    topic: Topic,
    outcome: &Outcome,
    look: &mut ExperimentLook,
    shared: &Shared,
    effects: &mut Vec<Effect>,
) {
    let dim = Theme::of(ui).palette.dim;
    ui.horizontal(|ui| {
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            open_ui(ui, outcome, look.marked, shared, effects);
            let heading = RichText::new(topic.heading()).font(semibold(type_size().title));
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                ui.add(Label::new(heading).truncate());
            });
        });
    });
    let conditions = RichText::new(describe_conditions(&outcome.results.experiment));
    ui.label(conditions.size(type_size().note).color(dim));
    let note_height = note_size(ui, &outcome.table, ui.available_width()).y + space(1);
    let table = vec2(ui.available_width(), ui.available_height() - note_height);
    ui.allocate_ui(table, |ui| table_ui(ui, outcome, look, shared, effects));
    let note = RichText::new(outcome.table.note).size(type_size().small);
    ui.label(note.color(dim));
}

/// Returns the height at which a card of this width shows every row, in points.
pub fn results_card_height(ui: &Ui, outcome: &Outcome, width: f32) -> f32 {
    let width = width - MARGINS;
    let conditions = describe_conditions(&outcome.results.experiment);
    let texts = text_size(ui, conditions, type_size().note, width).y + note_size(ui, &outcome.table, width).y;
    let title = space(7);
    let rows = space(6) * (outcome.table.table.rows.len() as f32 + 1.0);
    // Gaps between the four.
    (MARGINS + title + texts + rows + space(5)).ceil()
}

fn note_size(ui: &Ui, table: &ExperimentTable, width: f32) -> Vec2 {
    text_size(ui, table.note.to_owned(), type_size().small, width)
}

fn text_size(ui: &Ui, text: String, size: f32, width: f32) -> Vec2 {
    let colour = Theme::of(ui).palette.dim;
    ui.painter()
        .layout(text, FontId::proportional(size), colour, width)
        .size()
}

/// Shows the button that opens the marked cell in the Train view.
fn open_ui(ui: &mut Ui, outcome: &Outcome, marked: Option<usize>, shared: &Shared, effects: &mut Vec<Effect>) {
    let can_open = marked.is_some() && !shared.phase.is_busy();
    let button = ui.add_enabled(can_open, ghost_button("Open in Train view"));
    let why_not = if marked.is_some() {
        "A training is running in the Train view: its settings cannot be changed now"
    } else {
        "Click a cell of the table or the figure first"
    };
    let button = button
        .on_hover_text("Shows the network of the median trial of the marked cell, with its settings and surfaces.")
        .on_disabled_hover_text(why_not);
    if let (true, Some(cell)) = (button.clicked(), marked) {
        open_cell(shared, outcome, cell, effects);
    }
}

/// Lays out the table over the available space; it scrolls where it is larger.
pub fn table_ui(ui: &mut Ui, outcome: &Outcome, look: &mut ExperimentLook, shared: &Shared, effects: &mut Vec<Effect>) {
    let palette = &Theme::of(ui).palette;
    let axes = outcome.results.experiment.axes().count();
    let (headings, kinds) = (&outcome.table.table.columns, &outcome.table.kinds);
    let rounded = |row: &Vec<Cell>| Vec::from_iter(row.iter().map(Cell::rounded));
    let texts = Vec::from_iter(outcome.table.table.rows.iter().map(rounded));
    let column = |place: usize| {
        let heading = &headings[place].heading;
        let texts = texts.iter().map(|row| row[place].as_str());
        let column = if place < axes {
            TableColumn::text(heading)
        } else {
            TableColumn::figure(heading)
        };
        column.width(ColumnWidth::of_longest(texts))
    };
    let columns: Vec<TableColumn<'_>> = (0..headings.len()).map(column).collect();
    // An axis is sorted by the places in its list.
    let figure = |cell: usize, column: usize| {
        let of_results = &outcome.results.cells[cell];
        let value = match column {
            0 => Some(of_results.column as f64),
            1 if axes > 1 => Some(of_results.row as f64),
            _ => outcome.table.table.rows[cell].get(column).and_then(Cell::number),
        };
        (value, "")
    };
    let order = look.sort.order(outcome.table.table.rows.len(), figure);
    let row = |place: usize| {
        let number = order[place];
        let texts = &texts[number];
        let name = texts[..axes].join(", ");
        let loses = loses_to_linear_map(outcome, number);
        let cells = kinds.iter().zip(texts).enumerate().map(|(column, (&kind, text))| {
            let is_median = kind == ExperimentColumnKind::Ranking;
            let is_beaten = loses && kind == ExperimentColumnKind::Linear;
            let colour = match kind {
                ExperimentColumnKind::Ranking => palette.accent,
                ExperimentColumnKind::Published => palette.dim,
                _ if is_beaten => palette.warning,
                _ => palette.text,
            };
            let meaning = if is_beaten {
                "The linear baseline is more accurate here than the network."
            } else {
                ""
            };
            TableCell::new(text)
                .colour(colour)
                .strong(is_median || column < axes)
                .meaning(meaning)
        });
        TableRow::new(cells)
            .labelled(format!("Cell {name}"))
            .named(name)
            .selected(look.marked == Some(number))
    };
    let table = TableView::new("experiment table", &columns)
        .sorted(look.sort)
        .clickable();
    match table.show(ui, order.len(), row) {
        Some(TableClick::Sort(sort)) => look.sort = sort,
        Some(TableClick::Select(place)) => look.marked = Some(order[place]),
        Some(TableClick::Open(place)) => {
            look.marked = Some(order[place]);
            open_cell(shared, outcome, order[place], effects);
        }
        Some(TableClick::Point(_)) | None => {}
    }
}

fn loses_to_linear_map(outcome: &Outcome, cell: usize) -> bool {
    let cell = &outcome.results.cells[cell];
    let both = cell.percent().median.zip(cell.linear_percent());
    both.is_some_and(|(network, linear)| network > linear)
}
