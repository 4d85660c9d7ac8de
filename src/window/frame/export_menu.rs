//! The Export menu: everything that the current view can export, drawn from one list.

use eframe::egui::{
    Align, Button, Frame, Layout, Margin, RichText, ScrollArea, TextWrapMode, Ui, WidgetInfo, accesskit::Role,
    containers::menu::MenuButton,
};

use crate::window::{
    shared::{Ask, Effect, Export},
    theme::{Theme, space, type_size},
    widgets::{Landmark, ghost_button, section_heading_ui},
};

const WIDTH: f32 = space(88);

/// The button that opens the menu. `exports` lists what there is; it is called only while the menu is open.
pub(super) fn export_menu_ui<'a>(ui: &mut Ui, exports: impl FnOnce() -> Vec<Export<'a>>, effects: &mut Vec<Effect>) {
    let (button, _) = MenuButton::from_button(ghost_button("Export")).ui(ui, |ui| {
        // What the window cannot hold is scrolled to.
        let most = ui.ctx().content_rect().height() - space(20);
        let scroll = ScrollArea::vertical().max_height(most).min_scrolled_height(most);
        let margin = Margin {
            left: 8,
            right: 8,
            top: 0,
            bottom: 8,
        };
        scroll.show(ui, |ui| {
            Frame::new().inner_margin(margin).show(ui, |ui| {
                // A menu justifies its lines, and shows buttons as text.
                ui.with_layout(Layout::top_down(Align::Min), |ui| {
                    ui.set_width(WIDTH);
                    ui.visuals_mut().widgets.inactive.weak_bg_fill = Theme::of(ui).palette.raised;
                    let asked = exports_ui(ui, exports());
                    effects.extend(asked.map(|ask| ask()));
                });
            });
        });
    });
    Landmark::Export.stands_at(ui, button.rect);
    button.on_hover_text("Networks, reports, figures and tables of this view, as files or to the clipboard.");
}

/// One line for each thing, with a button for each of its forms; a reason, where there is one, is told once for all that
/// follow each other and share it. Returns what was asked for.
fn exports_ui<'a>(ui: &mut Ui, exports: Vec<Export<'a>>) -> Option<Ask<'a>> {
    let mut asked = None;
    let mut told = String::new();
    let mut group = None;
    let mut exports = gathered(exports).into_iter().peekable();
    while let Some(first) = exports.next() {
        if group.replace(first.group) != Some(first.group) {
            section_heading_ui(ui, &first.group.heading());
        }
        let reason = first.ask.as_ref().err().cloned().unwrap_or_default();
        if reason != told && !reason.is_empty() {
            let text = RichText::new(&reason).size(type_size().note);
            ui.label(text.color(Theme::of(ui).palette.dim));
        }
        told = reason;
        let name = first.name.clone();
        let mut forms = vec![first];
        while let Some(next) = exports.next_if(|next| next.group == forms[0].group && next.name == name) {
            forms.push(next);
        }
        ui.horizontal(|ui| {
            ui.style_mut().wrap_mode = Some(TextWrapMode::Extend);
            ui.set_min_height(space(6));
            let colour = if forms[0].ask.is_ok() {
                Theme::of(ui).palette.text
            } else {
                Theme::of(ui).palette.dim
            };
            ui.label(RichText::new(name).color(colour));
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                // From right to left.
                for form in forms.into_iter().rev() {
                    asked = asked.take().or(form_ui(ui, form));
                }
            });
        });
    }
    asked
}

/// The exports with those of one group together, in the order in which the groups begin: each has one heading.
fn gathered(mut exports: Vec<Export<'_>>) -> Vec<Export<'_>> {
    let mut groups = Vec::new();
    for export in &exports {
        if !groups.contains(&export.group) {
            groups.push(export.group);
        }
    }
    exports.sort_by_key(|export| groups.iter().position(|group| *group == export.group));
    exports
}

/// The button of one form. Returns the request if it was clicked.
fn form_ui<'a>(ui: &mut Ui, export: Export<'a>) -> Option<Ask<'a>> {
    let (label, is_there) = (export.label(), export.ask.is_ok());
    let button = ui.add_enabled(is_there, Button::new(&export.form));
    button.widget_info(|| WidgetInfo::labeled(Role::Button, is_there, &label));
    let button = button.on_hover_text(export.description);
    match export.ask {
        Ok(ask) => button.clicked().then_some(ask),
        Err(reason) => {
            button.on_disabled_hover_text(reason);
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::window::shared::ExportGroup;

    #[test]
    fn each_group_has_one_heading_and_keeps_the_order_of_its_exports() {
        let export = |(group, name): (ExportGroup, &str)| Export {
            group,
            name: name.to_owned(),
            form: String::new(),
            description: "",
            ask: Err(String::new()),
        };
        let exports = [
            (ExportGroup::Network, "network"),
            (ExportGroup::Tables, "errors"),
            (ExportGroup::Copies, "errors"),
            (ExportGroup::Tables, "channels"),
            (ExportGroup::Copies, "channels"),
            (ExportGroup::Training, "checkpoint"),
        ];
        let gathered = gathered(exports.map(export).into());
        let found: Vec<_> = gathered
            .iter()
            .map(|export| (export.group, export.name.as_str()))
            .collect();
        let [network, errors, copied_errors, channels, copied_channels, checkpoint] = exports;
        let expected = [network, errors, channels, copied_errors, copied_channels, checkpoint];
        assert_eq!(found, expected);
    }
}
