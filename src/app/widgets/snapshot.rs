use eframe::egui::{Button, FontId, Response, RichText, Ui, Vec2, WidgetInfo, accesskit::Role};

use crate::app::theme::{Theme, space, type_size};

/// The number of the snapshot on show, and arrows to its neighbours; returns the one picked.
pub fn snapshot_ui(ui: &mut Ui, shown: usize, snapshots: usize) -> Option<usize> {
    let mut picked = None;
    // Right to left: next, number, previous.
    let next = ui.add_enabled(shown + 1 < snapshots, arrow_button("›"));
    if name(next, "Next snapshot")
        .on_hover_text("Next snapshot of the test set (Page down)")
        .clicked()
    {
        picked = Some(shown + 1);
    }
    let number = if snapshots == 0 {
        "–".to_owned()
    } else {
        format!("{} of {snapshots}", shown + 1)
    };
    ui.label(number);
    let previous = ui.add_enabled(shown > 0, arrow_button("‹"));
    if name(previous, "Previous snapshot")
        .on_hover_text("Previous snapshot of the test set (Page up)")
        .clicked()
    {
        picked = Some(shown - 1);
    }
    let dim = Theme::of(ui).palette.dim;
    let font = FontId::proportional(type_size().body);
    let galley = ui.painter().layout_no_wrap("Test snapshot".to_owned(), font, dim);
    if ui.available_width() >= galley.size().x {
        ui.label(RichText::new("Test snapshot").color(dim));
    }
    picked
}

fn arrow_button(text: &str) -> Button<'_> {
    Button::new(text).min_size(Vec2::splat(space(6)))
}

fn name(response: Response, label: &'static str) -> Response {
    let is_enabled = response.enabled();
    response.widget_info(|| WidgetInfo::labeled(Role::Button, is_enabled, label));
    response
}
