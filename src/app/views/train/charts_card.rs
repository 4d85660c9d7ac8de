use eframe::egui::Ui;

use super::{
    chart::{BottomTab, chart_figure},
    state::TrainView,
};
use crate::app::{
    plotting::{Pointer, legend_behind_ui, legend_ui, plots_ui},
    shared::Shared,
    theme::space,
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
    let figure = chart_figure(view, shared);
    let before = (view.tab, view.has_error_bars);
    let has_room = ui.horizontal(|ui| {
        view.tab = tabs_ui(ui, "Charts", &TABS, view.tab).unwrap_or(view.tab);
        if view.tab == BottomTab::Nodes && shared.result().is_some() {
            error_bars_ui(ui, &mut view.has_error_bars);
        }
        figure.as_ref().is_none_or(|figure| legend_behind_ui(ui, &figure.keys))
    });
    match figure {
        Some(figure) => {
            if !has_room.inner {
                legend_ui(ui, &figure.keys);
            }
            // Each tab is zoomed by itself.
            plots_ui(ui, before.0.file_word(), &figure, Pointer::Moves);
        }
        None => placeholder_ui(ui, what_comes(view.tab)),
    }
    if (view.tab, view.has_error_bars) != before {
        ui.request_repaint();
    }
}

/// Whether the nodes have error bars.
fn error_bars_ui(ui: &mut Ui, has_bars: &mut bool) {
    ui.add_space(space(3));
    let hint = "± the root mean square error of each node over all snapshots of the test set";
    ui.checkbox(has_bars, "Error bars").on_hover_text(hint);
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
