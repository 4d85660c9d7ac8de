use eframe::egui::{Align, Label, Layout, RichText, Ui};

use super::{ExperimentFile, Outcome, table::table_ui};
use crate::{
    app::{
        Action,
        file_task::FileTask,
        state::{State, View},
        theme::{Theme, ghost_button, semibold, type_size},
    },
    evaluation::experiments::CellResults,
    export::{ExperimentTable, describe_conditions},
};

/// Title, how it was made, files, and the table.
pub fn results_card_ui(ui: &mut Ui, state: &State, outcome: &Outcome) -> Vec<Action> {
    let mut actions = Vec::new();
    let topic = state.experiments.topic;
    let theme = Theme::of(ui);
    ui.horizontal(|ui| {
        let heading = RichText::new(topic.heading()).font(semibold(type_size().title));
        ui.add(Label::new(heading).truncate());
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            for file in ExperimentFile::ALL.into_iter().rev() {
                let button = ui.add(ghost_button(theme, file.name()));
                if button.on_hover_text(file.description()).clicked() {
                    actions.push(Action::ChooseFile(FileTask::SaveExperiment(topic, file)));
                }
            }
            use_settings_ui(ui, state, outcome, &mut actions);
        });
    });
    let conditions = RichText::new(describe_conditions(&outcome.results.experiment));
    ui.label(conditions.size(type_size().note).color(theme.palette.dim));
    actions.extend(table_ui(ui, state, outcome).into_iter().map(Action::from));
    let note = RichText::new(ExperimentTable::NOTE)
        .size(type_size().small)
        .color(theme.palette.dim);
    ui.label(note);
    actions
}

/// Takes the marked cell to the Train view.
fn use_settings_ui(ui: &mut Ui, state: &State, outcome: &Outcome, actions: &mut Vec<Action>) {
    let marked = state
        .experiments
        .marked
        .and_then(|cell| outcome.results.cells.get(cell));
    let can_use = marked.is_some() && !state.phase.is_busy();
    let button = ui.add_enabled(can_use, ghost_button(Theme::of(ui), "Use these settings"));
    let why_not = if marked.is_some() {
        "A training is under way: its settings cannot change now"
    } else {
        "Click a cell of the table or the picture first"
    };
    let button = button
        .on_hover_text("Take the marked cell's settings to the Train view, with the seed of its median trial")
        .on_disabled_hover_text(why_not);
    if let (true, Some(cell)) = (button.clicked(), marked) {
        actions.push(Action::Configure(Box::new(settings_of(cell))));
        actions.push(Action::ShowView(View::Train));
    }
}

/// Outside a cross-validation, training these gives the network of the median trial again.
fn settings_of(cell: &CellResults) -> crate::evaluation::RunSettings {
    let mut settings = cell.cell.settings;
    if let Some(trial) = cell.median_trial() {
        settings.seed = trial.seed;
    }
    settings
}
