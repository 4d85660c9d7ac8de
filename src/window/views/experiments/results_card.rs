use eframe::egui::{Align, FontId, Label, Layout, RichText, Ui, Vec2, vec2};

use super::{ExperimentLook, Outcome, Topic, open_cell::open_cell, table::table_ui};
use crate::window::{
    shared::{Effect, Shared},
    theme::{Theme, semibold, space, type_size},
    widgets::ghost_button,
};
use decoupler_files::export::{ExperimentTable, describe_conditions};

/// Margins of a card, both sides together.
const MARGINS: f32 = 24.0;

/// Title, how it was made, and the table.
pub fn results_card_ui(
    ui: &mut Ui,
    (topic, outcome): (Topic, &Outcome),
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
    let rows = space(6) * (outcome.table.rows.len() as f32 + 1.0);
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

/// Takes the marked cell to the Train view.
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
