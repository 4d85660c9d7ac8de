use eframe::egui::Ui;

use super::{
    charts::{self, BottomTab},
    state::TrainView,
};
use crate::app::{
    plotting::{Key, legend_ui, legend_width},
    shared::{RunResult, RunView, Shared},
    theme::{Theme, space},
    widgets::{placeholder_ui, tabs_ui},
};

const TABS: [(BottomTab, &str); 5] = [
    (BottomTab::Loss, "Loss"),
    (BottomTab::TrainingState, "Training state"),
    (BottomTab::ErrorHistogram, "Histogram"),
    (BottomTab::Regression, "Regression"),
    (BottomTab::Nodes, "Nodes"),
];

/// The charts below the surfaces.
pub fn charts_card_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let keys = keys(ui, view, shared);
    let has_room = ui
        .horizontal(|ui| {
            view.tab = tabs_ui(ui, "Charts", &TABS, view.tab).unwrap_or(view.tab);
            if view.tab == BottomTab::Nodes && shared.result().is_some() {
                error_bars_ui(ui, &mut view.has_error_bars);
            }
            let spare = ui.available_width() - ui.spacing().item_spacing.x - legend_width(ui, &keys);
            let has_room = spare >= space(3);
            if has_room {
                ui.add_space(spare);
                legend_ui(ui, &keys);
            }
            has_room
        })
        .inner;
    if !has_room {
        legend_ui(ui, &keys);
    }
    match (view.tab, trained(shared)) {
        (BottomTab::Nodes, _) => {
            let nodes_per_row = shared.test().map_or(1, |test| test.sensor.scale.nodes_per_row());
            charts::nodes_ui(ui, &view.drawn.frames, view.error_bars_mm(), nodes_per_row);
        }
        (tab, None) => placeholder_ui(ui, what_comes(tab)),
        (BottomTab::Loss, Some((run, result))) => charts::loss_ui(ui, &run.history, &run.stages, result.best_epoch),
        (BottomTab::TrainingState, Some((run, _))) => {
            charts::training_state_ui(ui, &run.history, &run.stages);
        }
        (BottomTab::ErrorHistogram, Some(_)) => {
            charts::error_histogram_ui(ui, view.drawn.pairs_mm().unwrap_or_default());
        }
        (BottomTab::Regression, Some(_)) => {
            charts::regression_ui(ui, view.drawn.pairs_mm().unwrap_or_default());
        }
    }
}

/// Whether the nodes have error bars.
fn error_bars_ui(ui: &mut Ui, has_bars: &mut bool) {
    ui.add_space(space(3));
    let hint = "± the root mean square error of each node over all snapshots of the test set";
    ui.checkbox(has_bars, "Error bars").on_hover_text(hint);
}

fn trained(shared: &Shared) -> Option<(&RunView, &RunResult)> {
    shared.shown_run().and_then(|run| Some((run, run.result.as_ref()?)))
}

/// What the marks of the chart on show stand for.
fn keys(ui: &Ui, view: &TrainView, shared: &Shared) -> Vec<Key> {
    let palette = &Theme::of(ui).palette;
    match (view.tab, trained(shared)) {
        (BottomTab::Nodes, _) => charts::nodes_keys(palette, &view.drawn.frames),
        (BottomTab::Loss, Some((run, _))) => charts::loss_keys(palette, &run.history),
        (BottomTab::TrainingState, Some((run, _))) => {
            charts::training_state_keys(palette, charts::parameter_name(&run.stages))
        }
        (BottomTab::Regression, Some(_)) => charts::regression_keys(palette),
        (BottomTab::ErrorHistogram, Some(_)) | (_, None) => Vec::new(),
    }
}

/// What an empty chart is there for.
fn what_comes(tab: BottomTab) -> &'static str {
    match tab {
        BottomTab::Loss => "The error of each epoch appears here while the network trains.",
        BottomTab::TrainingState => {
            "The gradient and the method's own quantities appear here while the network trains."
        }
        BottomTab::ErrorHistogram => "How often each error of z occurs in the test set appears here.",
        BottomTab::Regression => "Decoupled against actual z of every node in the test set appears here.",
        BottomTab::Nodes => "",
    }
}
