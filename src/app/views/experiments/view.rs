use eframe::egui::{Sense, Ui};

use super::{
    Outcome, Topic,
    heat_map::heat_map_ui,
    plots,
    results_card::{results_card_height, results_card_ui},
    verdict_list::verdicts_ui,
};
use crate::{
    app::{
        shared::State,
        theme::space,
        widgets::{card_ui, placeholder_ui, scrolled_ui, section_heading_ui},
        window::Action,
    },
    evaluation::experiments::PaperTable,
};

/// The middle of the Experiments view: the table above, picture and verdicts below.
pub fn experiments_ui(ui: &mut Ui, state: &State) -> Vec<Action> {
    let mut actions = Vec::new();
    let whole = ui.available_rect_before_wrap();
    let Some(outcome) = state.experiments.shown() else {
        card_ui(ui, whole, |ui| {
            placeholder_ui(ui, "The values on the left cannot be run yet: the note there says why.");
        });
        return actions;
    };
    let gap = space(2);
    let height = results_card_height(ui, outcome, whole.width()).min((0.53 * whole.height()).round());
    let (upper, lower) = whole.split_top_bottom_at_y(whole.top() + height);
    card_ui(ui, upper, |ui| actions.extend(results_card_ui(ui, state, outcome)));
    let lower = lower.with_min_y(lower.min.y + gap);
    let (left, right) = lower.split_left_right_at_x(lower.left() + (0.6 * lower.width()).round());
    card_ui(ui, left, |ui| actions.extend(picture_ui(ui, state, outcome)));
    card_ui(ui, right.with_min_x(right.min.x + gap), |ui| {
        if outcome.trials().0 == 0 {
            placeholder_ui(ui, hint(state));
            return;
        }
        section_heading_ui(ui, "What this run says");
        scrolled_ui(ui, "verdicts", |ui| verdicts_ui(ui, outcome));
    });
    ui.allocate_rect(whole, Sense::hover());
    actions
}

/// Why there is no figure yet.
fn hint(state: &State) -> &'static str {
    let experiments = &state.experiments;
    match (&experiments.running, experiments.outcome()) {
        (Some(running), _) if running.topic == experiments.topic => "The figures appear as the trials finish.",
        (_, Some(_)) => "It ended before the first trial was finished.",
        _ => "Press Run: our figures appear beside the published ones as they come.",
    }
}

fn picture_ui(ui: &mut Ui, state: &State, outcome: &Outcome) -> Vec<Action> {
    match state.experiments.topic {
        Topic::Table(PaperTable::HiddenNodes) => plots::hidden_nodes_ui(ui, outcome),
        Topic::Table(PaperTable::CrossValidation) => plots::repeats_ui(ui, outcome),
        Topic::Table(PaperTable::ArrayScales) => plots::side_by_side_ui(ui, outcome),
        Topic::Sweep => {
            return heat_map_ui(ui, state, outcome);
        }
    }
    Vec::new()
}
