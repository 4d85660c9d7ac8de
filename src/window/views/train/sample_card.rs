//! What takes the place of the surfaces where a recording has none: all displayed targets of the sample.

use eframe::egui::{RichText, Ui};

use super::{
    chart::all_targets_figure,
    inspect::{take_pointed_target, with_lit_targets},
    state::TrainView,
};
use crate::window::{
    plotting::{Pointer, legend_behind_ui, legend_ui, plots_ui},
    shared::{Phase, Shared},
    test_view::Positions,
    theme::{semibold, space, type_size},
    widgets::{dim_ui, placeholder_ui},
};

/// All displayed targets of the sample, actual next to decoded.
pub fn sample_card_ui(ui: &mut Ui, view: &mut TrainView, shared: &Shared) {
    let Some(figure) = all_targets_figure(view, shared) else {
        let text = match shared.phase {
            Phase::Preparing => "The recording is being read; the first epoch follows.",
            _ => "Press Train: the targets of each test sample appear here, actual next to decoded.",
        };
        placeholder_ui(ui, text);
        return;
    };
    let figure = with_lit_targets(figure, view, shared);
    let has_room = ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        let title = format!("Test sample {}", view.snapshot + 1);
        ui.label(RichText::new(title).font(semibold(type_size().title)));
        legend_behind_ui(ui, &figure.keys)
    });
    if !has_room.inner {
        legend_ui(ui, &figure.keys);
    }
    if let Some(Positions::NoSurface(reason)) = shared.recorded_test().map(|test| &test.positions) {
        dim_ui(
            ui,
            &format!("No surface goes through the positions of the targets: {reason}."),
        );
    }
    let lit = view.lights.node;
    let drawn = plots_ui(ui, "all targets", &figure, Pointer::Moves);
    take_pointed_target(view, &drawn, shared);
    if view.lights.node != lit {
        ui.request_repaint();
    }
}
