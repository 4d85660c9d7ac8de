use eframe::egui::{Ui, UiBuilder};

use super::{
    chart::{BottomTab, chart_figure},
    press::readings_ui,
    scrub::{self, scrub_bar_ui},
    state::TrainView,
};
use crate::app::{
    plotting::{Pointer, legend_behind_ui, legend_ui, plots_ui},
    shared::{Effect, Phase, Shared},
    theme::space,
    widgets::{invitation_ui, tabs_ui},
};

const TABS: [(BottomTab, &str); 6] = [
    (BottomTab::Loss, "Loss"),
    (BottomTab::TrainingState, "Training state"),
    (BottomTab::ErrorHistogram, "Histogram"),
    (BottomTab::Regression, "Regression"),
    (BottomTab::Nodes, "Nodes"),
    (BottomTab::Readings, "Readings"),
];

/// The charts below the surfaces; the readings are one of them where they have no card of their own.
pub fn charts_card_ui(
    ui: &mut Ui,
    view: &mut TrainView,
    shared: &Shared,
    has_readings: bool,
    effects: &mut Vec<Effect>,
) {
    if view.tab == BottomTab::Readings && !has_readings {
        view.tab = BottomTab::default();
    }
    let figure = chart_figure(view, shared);
    let before = (view.tab, view.has_error_bars);
    let tabs = if has_readings {
        &TABS[..]
    } else {
        &TABS[..TABS.len() - 1]
    };
    let has_room = ui.horizontal(|ui| {
        let has_choice = view.tab == BottomTab::Nodes && shared.result().is_some();
        let picked = ui.scope(|ui| {
            // The choice beside them keeps its place.
            let kept = if has_choice { space(27) } else { 0.0 };
            ui.set_max_width(ui.available_width() - kept);
            tabs_ui(ui, "Charts", tabs, view.tab)
        });
        view.tab = picked.inner.unwrap_or(view.tab);
        if has_choice {
            error_bars_ui(ui, &mut view.has_error_bars);
        }
        figure.as_ref().is_none_or(|figure| legend_behind_ui(ui, &figure.keys))
    });
    match figure {
        Some(figure) => {
            if !has_room.inner {
                legend_ui(ui, &figure.keys);
            }
            let past = shared.shown_run().map(|run| &run.past);
            let past = past.filter(|past| before.0 == BottomTab::Loss && past.epochs().len() > 1);
            let mut plots = ui.available_rect_before_wrap();
            if past.is_some() {
                plots.max.y -= scrub::HEIGHT;
            }
            // Each tab is zoomed by itself.
            ui.scope_builder(UiBuilder::new().max_rect(plots), |ui| {
                plots_ui(ui, before.0.file_word(), &figure, Pointer::Moves);
            });
            if let Some(past) = past {
                scrub_bar_ui(ui, &mut view.scrub, past);
            }
        }
        None if view.tab == BottomTab::Readings => readings_ui(ui, view.drops_percent(), shared.test()),
        None => {
            let is_possible = !shared.phase.is_busy() && shared.phase != Phase::Died;
            if invitation_ui(ui, hint_of_empty_chart(view.tab), "Train now", is_possible) {
                effects.push(Effect::Train);
            }
        }
    }
    if (view.tab, view.has_error_bars) != before {
        ui.request_repaint();
    }
}

/// Shows the choice of error bars on the nodes.
fn error_bars_ui(ui: &mut Ui, has_bars: &mut bool) {
    ui.add_space(space(3));
    let hint = "± the root mean square error of each node over all snapshots of the test set, in mm.";
    ui.checkbox(has_bars, "Error bars").on_hover_text(hint);
}

/// Returns the hint shown in an empty chart.
fn hint_of_empty_chart(tab: BottomTab) -> &'static str {
    match tab {
        BottomTab::Loss => "The error of each epoch appears here while the network trains.",
        BottomTab::TrainingState => {
            "The gradient and the method's own quantities appear here while the network trains."
        }
        BottomTab::ErrorHistogram => "The distribution of the z errors in the test set appears here.",
        BottomTab::Regression => "Decoupled against actual z of every node in the test set appears here.",
        BottomTab::Nodes | BottomTab::Readings => "",
    }
}
