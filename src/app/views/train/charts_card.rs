use eframe::egui::{Key, Modifiers, Ui, UiBuilder};

use super::{
    bottom_tab::BottomTab,
    chart::chart_figure,
    inspect::{Along, bar_nodes_ui, section_bar_ui, take_pointed},
    press::readings_ui,
    scrub::{self, scrub_bar_ui},
    state::TrainView,
};
use crate::{
    app::{
        plotting::{Pointer, legend_behind_ui, legend_ui, plots_ui},
        shared::{Effect, Offers, Phase, Shared},
        theme::space,
        widgets::{invitation_ui, tabs_ui},
    },
    figure::ErrorBins,
};

const TABS: [(BottomTab, &str); 7] = [
    (BottomTab::Loss, "Loss"),
    (BottomTab::TrainingState, "Training state"),
    (BottomTab::ErrorHistogram, "Histogram"),
    (BottomTab::Regression, "Regression"),
    (BottomTab::Nodes, "Nodes"),
    (BottomTab::Section, "Section"),
    (BottomTab::Readings, "Readings"),
];

/// Width of the list of nodes beside the histogram.
const LIST_WIDTH: f32 = space(57);

/// Width of a card below which the longest name of a tab is cut.
const NARROW: f32 = space(106);

/// The tabs with their names.
fn tabs(is_narrow: bool, has_readings: bool) -> Vec<(BottomTab, &'static str)> {
    let tabs = TABS
        .into_iter()
        .filter(|(tab, _)| has_readings || *tab != BottomTab::Readings);
    let short = |(tab, name)| match tab {
        BottomTab::TrainingState if is_narrow => (tab, "State"),
        _ => (tab, name),
    };
    tabs.map(short).collect()
}

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
    let has_choice = view.tab == BottomTab::Nodes && shared.result().is_some();
    let has_room = ui.horizontal(|ui| {
        let tabs = tabs(ui.available_width() < NARROW, has_readings);
        view.tab = tabs_ui(ui, "Charts", &tabs, view.tab).unwrap_or(view.tab);
        // The choice takes the legend's place.
        !has_choice && figure.as_ref().is_none_or(|figure| legend_behind_ui(ui, &figure.keys))
    });
    let has_room = if has_choice {
        ui.horizontal(|ui| {
            error_bars_ui(ui, &mut view.has_error_bars);
            figure.as_ref().is_none_or(|figure| legend_behind_ui(ui, &figure.keys))
        })
    } else {
        has_room
    };
    if let (BottomTab::Section, Some(test)) = (view.tab, shared.test()) {
        section_bar_ui(ui, &mut view.section, test);
    }
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
            let has_list = before.0 == BottomTab::ErrorHistogram && view.lights.bar.is_some();
            let list = plots.split_left_right_at_x(plots.right() - LIST_WIDTH).1;
            if has_list {
                plots.max.x = list.left() - space(3);
            }
            let lights = (view.lights.node, view.lights.bar);
            // Each tab is zoomed by itself.
            ui.scope_builder(UiBuilder::new().max_rect(plots), |ui| {
                let drawn = plots_ui(ui, before.0.file_word(), &figure, Pointer::Moves);
                take_pointed(view, before.0, &drawn, shared);
            });
            if has_list {
                ui.scope_builder(UiBuilder::new().max_rect(list), |ui| bar_nodes_ui(ui, view, shared));
            }
            if (view.lights.node, view.lights.bar) != lights {
                ui.request_repaint();
            }
            if let Some(past) = past {
                scrub_bar_ui(ui, &mut view.scrub, past);
            }
        }
        None if view.tab == BottomTab::Readings => readings_of_view_ui(ui, view, shared),
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

/// Readings of the surface on show. The one under the pointer lights up its nodes; a click cuts the surfaces along its
/// wires.
pub fn readings_of_view_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let per_row = shared.test().map_or(1, |test| test.sensor.scale.nodes_per_row());
    let row = view.lights.row.or(view.lights.node.map(|node| node / per_row));
    let pointed = readings_ui(ui, view.drops_percent(), shared.test(), row, shared.look.colours);
    let lit = pointed.as_ref().map(|pointed| pointed.cell[0]);
    if lit != view.lights.row {
        view.lights.row = lit;
        ui.request_repaint();
    }
    if let Some(pointed) = pointed.filter(|pointed| pointed.is_clicked) {
        view.section.choose_wires(pointed.cell[0], pointed.cell[1]);
        view.tab = BottomTab::Section;
        ui.request_repaint();
    }
}

impl TrainView {
    /// Offers each chart, and the steps through what one of them shows.
    pub(super) fn offer_charts(&mut self, offers: &mut Offers<'_>, shared: &Shared) {
        for (tab, name) in TABS {
            // Readings have a card of their own where there is room.
            if tab != BottomTab::Readings && offers.offer(format!("Chart: {name}"), tab != self.tab) {
                self.tab = tab;
            }
        }
        let Some(test) = shared.test() else { return };
        let steps = [(-1, "Previous", Key::OpenBracket), (1, "Next", Key::CloseBracket)];
        match self.tab {
            BottomTab::Section => {
                for (by, word, key) in steps {
                    let is_possible = self.section.can_step(by, test);
                    if offers.offer_keys(format!("{word} section"), Modifiers::NONE, key, is_possible) {
                        self.section.step(by, test);
                    }
                }
                let (name, other) = match self.section.along {
                    Along::RowWires => ("Section along a column-wire", Along::ColumnWires),
                    Along::ColumnWires => ("Section along a row-wire", Along::RowWires),
                };
                if offers.offer_keys(name, Modifiers::NONE, Key::Backslash, true) {
                    self.section.along = other;
                }
            }
            BottomTab::ErrorHistogram => {
                let bar = self.lights.bar.unwrap_or(ErrorBins::COUNT / 2);
                for (by, word, key) in steps {
                    let next = bar.checked_add_signed(by).filter(|bar| *bar < ErrorBins::COUNT);
                    let is_possible = next.is_some() && shared.result().is_some();
                    if offers.offer_keys(
                        format!("{word} bar of the histogram"),
                        Modifiers::NONE,
                        key,
                        is_possible,
                    ) {
                        self.lights.bar = next;
                    }
                }
            }
            _ => {}
        }
    }
}

/// Shows the choice of error bars on the nodes.
fn error_bars_ui(ui: &mut Ui, has_bars: &mut bool) {
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
        BottomTab::Nodes | BottomTab::Section | BottomTab::Readings => "",
    }
}
