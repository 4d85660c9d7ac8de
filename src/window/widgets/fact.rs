use eframe::egui::{Align, Color32, Label, Layout, RichText, Ui, WidgetInfo, accesskit::Role};

use super::value_under::value_under;
use crate::window::theme::{Theme, type_size};

/// A figure with its name, and its meaning under the pointer.
pub fn fact_ui(ui: &mut Ui, name: &str, meaning: &str, value: &str) {
    let text = Theme::of(ui).palette.text;
    coloured_fact_ui(ui, name, meaning, value, text);
}

/// As [`fact_ui`], in a colour that means something.
pub fn coloured_fact_ui(ui: &mut Ui, name: &str, meaning: &str, value: &str, colour: Color32) {
    let dim = Theme::of(ui).palette.dim;
    ui.horizontal(|ui| {
        let text = |text: &str| RichText::new(text).size(type_size().note);
        ui.label(text(name).color(dim)).on_hover_text(meaning);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let response = ui.add(Label::new(text(value).color(colour)).truncate());
            let label = format!("{name}: {value}");
            value_under(ui, response.rect, value);
            response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &label));
            response.on_hover_text(meaning);
        });
    });
}
