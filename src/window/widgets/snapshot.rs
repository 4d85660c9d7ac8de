use eframe::egui::{Button, DragValue, FontId, Response, RichText, Ui, Vec2, WidgetInfo, accesskit::Role};

use crate::window::theme::{Theme, space, type_size};

/// The number of the snapshot or sample (`what`) displayed, to be typed or dragged too, and arrows to its neighbours; returns
/// the one picked.
pub fn snapshot_ui(ui: &mut Ui, what: &str, shown: usize, snapshots: usize) -> Option<usize> {
    let mut picked = None;
    let title = format!("Test {what}");
    // Right to left: next, number, previous.
    let next = ui.add_enabled(shown + 1 < snapshots, arrow_button("›"));
    if name(next, format!("Next {what}"))
        .on_hover_text(format!("Next {what} of the test set (Page down)"))
        .clicked()
    {
        picked = Some(shown + 1);
    }
    let mut number = shown + 1;
    let field = (snapshots > 0).then(|| {
        let suffix = format!(" of {snapshots}");
        let field = DragValue::new(&mut number).range(1..=snapshots).suffix(suffix);
        ui.add(field).on_hover_text("Type a number, or drag.")
    });
    if field.is_none() {
        ui.label("–");
    } else if number != shown + 1 {
        picked = Some(number - 1);
    }
    let previous = ui.add_enabled(shown > 0, arrow_button("‹"));
    if name(previous, format!("Previous {what}"))
        .on_hover_text(format!("Previous {what} of the test set (Page up)"))
        .clicked()
    {
        picked = Some(shown - 1);
    }
    let dim = Theme::of(ui).palette.dim;
    let font = FontId::proportional(type_size().body);
    let galley = ui.painter().layout_no_wrap(title.clone(), font, dim);
    let label = (ui.available_width() >= galley.size().x).then(|| ui.label(RichText::new(&title).color(dim)));
    match (field, label) {
        (Some(field), Some(label)) => {
            field.labelled_by(label.id);
        }
        (Some(field), None) => {
            ui.ctx().accesskit_node_builder(field.id, |node| node.set_label(title));
        }
        (None, _) => {}
    }
    picked
}

fn arrow_button(text: &str) -> Button<'_> {
    Button::new(text).min_size(Vec2::splat(space(6)))
}

fn name(response: Response, label: String) -> Response {
    let is_enabled = response.enabled();
    response.widget_info(|| WidgetInfo::labeled(Role::Button, is_enabled, &label));
    response
}
