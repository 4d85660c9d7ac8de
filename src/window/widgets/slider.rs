//! The one slider.

use eframe::egui::{CornerRadius, Response, Sense, Slider, Stroke, Ui};

use crate::window::theme::Theme;

/// A slider `width` points wide. A double click asks for the usual value, which the caller sets where the response is
/// double-clicked.
pub fn slider_ui(ui: &mut Ui, slider: Slider<'_>, width: f32) -> Response {
    ui.scope(|ui| {
        slider_style(ui);
        ui.spacing_mut().slider_width = width;
        let dragged = ui.add(slider.show_value(false));
        let clicked = dragged.interact(Sense::click());
        dragged.union(clicked)
    })
    .inner
}

/// Makes the sliders of this `ui` look like ours: accent up to the handle, a ring as the handle.
fn slider_style(ui: &mut Ui) {
    let palette = Theme::of(ui).palette;
    let visuals = ui.visuals_mut();
    visuals.selection.bg_fill = palette.accent;
    visuals.widgets.inactive.bg_fill = palette.line;
    visuals.widgets.inactive.corner_radius = CornerRadius::same(2);
    for state in [&mut visuals.widgets.hovered, &mut visuals.widgets.active] {
        state.bg_fill = palette.accent;
    }
    for state in [
        &mut visuals.widgets.inactive,
        &mut visuals.widgets.hovered,
        &mut visuals.widgets.active,
    ] {
        state.fg_stroke = Stroke::new(2.0, palette.accent);
    }
}
