use eframe::egui::Ui;

use crate::app::{
    action::Action,
    charts,
    state::{BottomTab, State},
    theme::{placeholder_ui, tabs_ui},
};

/// The charts below the surfaces.
pub fn charts_card_ui(ui: &mut Ui, state: &State) -> Vec<Action> {
    let mut actions = Vec::new();
    let tabs = [
        (BottomTab::Loss, "Loss"),
        (BottomTab::TrainingState, "Training state"),
        (BottomTab::ErrorHistogram, "Error histogram"),
        (BottomTab::Regression, "Regression"),
        (BottomTab::Nodes, "Nodes"),
    ];
    if let Some(tab) = tabs_ui(ui, "Charts", &tabs, state.look.tab) {
        actions.push(Action::ShowTab(tab));
    }
    if state.look.tab == BottomTab::Nodes {
        charts::nodes_ui(ui, &state.frames);
        return actions;
    }
    let Some((run, result)) = state.shown_run().and_then(|run| Some((run, run.result.as_ref()?))) else {
        placeholder_ui(ui, "Errors by epoch appear here once a network trains.");
        return actions;
    };
    match state.look.tab {
        BottomTab::Loss => charts::loss_ui(ui, &run.history, result.best_epoch),
        BottomTab::TrainingState => {
            charts::training_state_ui(ui, &run.history, run.settings.training.method.parameter_name());
        }
        BottomTab::ErrorHistogram => charts::error_histogram_ui(ui, &run.test.set, &result.decoupled_mm),
        BottomTab::Regression => charts::regression_ui(ui, &run.test.set, &result.decoupled_mm),
        BottomTab::Nodes => {}
    }
    actions
}
