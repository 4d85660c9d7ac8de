use eframe::egui::{
    Align, CollapsingHeader, Color32, Label, Layout, Response, RichText, Stroke, StrokeKind, Ui, UiBuilder,
};

use crate::window::theme::{Theme, radius, space, type_size};

/// Rings what has the focus and shows it by nothing else.
pub fn focus_ring_ui(ui: &Ui, response: &Response) {
    if response.has_focus() {
        let stroke = Stroke::new(1.0, Theme::of(ui).palette.accent);
        let corner = f32::from(radius());
        ui.painter()
            .rect_stroke(response.rect, corner, stroke, StrokeKind::Inside);
    }
}

/// A part of a form that is folded away until its name is clicked; `summary` tells next to the name the status of it.
/// `contents` is added only while it is unfolded.
pub fn fold_ui(ui: &mut Ui, name: &str, summary: &str, contents: impl FnOnce(&mut Ui)) {
    let dim = Theme::of(ui).palette.dim;
    // What stands above may come and go without a change to the ids in here: who types in a field keeps it.
    let scope = UiBuilder::new().scope_id(ui.scope_id().with(name));
    let header = ui
        .scope_builder(scope, |ui| {
            let visuals = ui.visuals_mut();
            // The whole line can be clicked, and shows so under the pointer.
            visuals.collapsing_header_frame = true;
            visuals.widgets.inactive.weak_bg_fill = Color32::TRANSPARENT;
            let shown = CollapsingHeader::new(name).id_salt(name).show_unindented(ui, |ui| {
                let raised = Theme::of(ui).palette.raised;
                let visuals = ui.visuals_mut();
                visuals.collapsing_header_frame = false;
                visuals.widgets.inactive.weak_bg_fill = raised;
                contents(ui);
                ui.add_space(space(2));
            });
            shown.header_response
        })
        .inner;
    focus_ring_ui(ui, &header);
    let text_width =
        ui.painter()
            .layout_no_wrap(name.to_owned(), eframe::egui::TextStyle::Body.resolve(ui.style()), dim);
    let mut place = header.rect;
    place.min.x += space(7) + text_width.size().x + space(2);
    place.max.x -= space(1);
    let layout = Layout::right_to_left(Align::Center);
    let mut beside = ui.new_child(UiBuilder::new().max_rect(place).layout(layout));
    let text = RichText::new(summary).size(type_size().note).color(dim);
    beside.add(Label::new(text).truncate().selectable(false));
}
