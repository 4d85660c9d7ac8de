use std::path::PathBuf;

use eframe::egui::{Align, Frame, Id, Layout, Margin, Modal, RichText, TextEdit, Ui};

use super::Action;
use crate::app::{
    shared::State,
    theme::{Theme, semibold, space, type_size},
    widgets::{ghost_button, primary_button},
};

pub(super) fn form_frame(ui: &Ui) -> Frame {
    Frame::popup(ui.style()).inner_margin(Margin::same(16))
}

/// Asks for the path of a file inside the window: for desktops that offer no file dialog, and for typing.
pub fn save_form_ui(ui: &mut Ui, state: &State) -> Vec<Action> {
    let mut actions = Vec::new();
    let Some(saving) = &state.saving else { return actions };
    let modal = Modal::new(Id::unique("save form"))
        .frame(form_frame(ui))
        .show(ui.ctx(), |ui| {
            ui.set_width(space(110));
            ui.label(
                RichText::new(format!("{} {}", saving.task.verb(), saving.task.file_kind()))
                    .font(semibold(type_size().title)),
            );
            ui.label(
                RichText::new(saving.task.description())
                    .size(type_size().note)
                    .color(Theme::of(ui).palette.dim),
            );
            ui.add_space(space(2));
            let label = ui.label("File");
            let mut path = saving.path.clone();
            let edit = ui
                .add(TextEdit::singleline(&mut path).desired_width(f32::INFINITY))
                .labelled_by(label.id);
            if edit.changed() {
                actions.push(Action::EditPath(path.clone()));
            }
            let entered = edit.lost_focus() && ui.input(|input| input.key_pressed(eframe::egui::Key::Enter));
            // Typing and Enter are all it takes; Tab still reaches the buttons.
            if ui.memory(|memory| memory.focused().is_none()) {
                edit.request_focus();
            }
            ui.add_space(space(3));
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let is_named = !path.trim().is_empty();
                if ui.add_enabled(is_named, primary_button(saving.task.verb())).clicked() || (entered && is_named) {
                    actions.push(saving.task.at(PathBuf::from(path.trim())));
                }
                if ui.add(ghost_button("Cancel")).clicked() {
                    actions.push(Action::CancelSave);
                }
            });
        });
    if modal.should_close() {
        actions.push(Action::CancelSave);
    }
    actions
}
