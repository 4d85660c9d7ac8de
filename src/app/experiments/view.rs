use eframe::egui::{Sense, Ui};

use super::{Outcome, Topic, heat_map::heat_map_ui, plots, results_card::results_card_ui, verdict_list::verdicts_ui};
use crate::{
    app::{
        Action,
        state::State,
        theme::{card_ui, placeholder_ui, scrolled_ui, section_heading_ui, space},
    },
    evaluation::experiments::PaperTable,
};

/// The middle of the Experiments view: the table above, picture and verdicts below.
pub fn experiments_ui(ui: &mut Ui, state: &State) -> Vec<Action> {
    let mut actions = Vec::new();
    let whole = ui.available_rect_before_wrap();
    let Some(outcome) = state.experiments.outcome() else {
        card_ui(ui, whole, |ui| {
            placeholder_ui(
                ui,
                "Press Run: the figures appear here as they come, beside the published ones.",
            );
        });
        return actions;
    };
    let gap = space(2);
    let (upper, lower) = whole.split_top_bottom_at_y(whole.top() + table_height(outcome, whole.height()));
    card_ui(ui, upper, |ui| actions.extend(results_card_ui(ui, state, outcome)));
    let lower = lower.with_min_y(lower.min.y + gap);
    let (left, right) = lower.split_left_right_at_x(lower.left() + (0.6 * lower.width()).round());
    card_ui(ui, left, |ui| actions.extend(picture_ui(ui, state, outcome)));
    card_ui(ui, right.with_min_x(right.min.x + gap), |ui| {
        section_heading_ui(ui, "What this run says");
        scrolled_ui(ui, "verdicts", |ui| verdicts_ui(ui, outcome));
    });
    ui.allocate_rect(whole, Sense::hover());
    actions
}

/// As high as its rows, but leaves more than half to the picture.
fn table_height(outcome: &Outcome, whole: f32) -> f32 {
    let rows = space(6) * (outcome.table.rows.len() as f32 + 1.0);
    // Title, conditions, note, and the margins of the card.
    let rest = space(34);
    (rows + rest).min(0.48 * whole)
}

fn picture_ui(ui: &mut Ui, state: &State, outcome: &Outcome) -> Vec<Action> {
    match state.experiments.topic {
        Topic::Table(PaperTable::HiddenNodes) => plots::hidden_nodes_ui(ui, outcome),
        Topic::Table(PaperTable::CrossValidation) => plots::repeats_ui(ui, outcome),
        Topic::Table(PaperTable::ArrayScales) => plots::side_by_side_ui(ui, outcome),
        Topic::Sweep => {
            let marked = state.experiments.marked;
            let actions = heat_map_ui(ui, outcome, marked).into_iter();
            return actions.map(Action::from).collect();
        }
    }
    Vec::new()
}
