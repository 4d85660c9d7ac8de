use std::path::PathBuf;

use eframe::egui::{Align, Frame, Id, Layout, Margin, Modal, RichText, TextEdit, Ui};

use crate::app::{
    shared::FileTask,
    theme::{Theme, semibold, space, type_size},
    widgets::{ghost_button, primary_button},
};

/// A file waiting for its path.
#[derive(Clone, Debug)]
pub struct Saving {
    /// What to do with it.
    pub task: FileTask,
    /// The path typed so far.
    pub path: String,
}

/// What the user says to the question for a path.
pub enum Reply {
    /// This is it.
    Path(PathBuf),
    /// There shall be no file.
    Cancel,
}

/// Asks for the path of a file inside the window: for desktops that offer no file dialog, and for typing.
pub fn save_form_ui(ui: &mut Ui, saving: &mut Saving) -> Option<Reply> {
    let mut reply = None;
    let (task, path) = (&saving.task, &mut saving.path);
    let frame = Frame::popup(ui.style()).inner_margin(Margin::same(16));
    let modal = Modal::new(Id::unique("save form")).frame(frame).show(ui.ctx(), |ui| {
        ui.set_width(space(110));
        let title = format!("{} {}", task.verb(), task.words.kind);
        ui.label(RichText::new(title).font(semibold(type_size().title)));
        let dim = Theme::of(ui).palette.dim;
        ui.label(RichText::new(task.words.description).size(type_size().note).color(dim));
        ui.add_space(space(2));
        let label = ui.label("File");
        let edit = ui
            .add(TextEdit::singleline(path).desired_width(f32::INFINITY))
            .labelled_by(label.id);
        let entered = edit.lost_focus() && ui.input(|input| input.key_pressed(eframe::egui::Key::Enter));
        // Typing and Enter are all it takes; Tab still reaches the buttons.
        if ui.memory(|memory| memory.focused().is_none()) {
            edit.request_focus();
        }
        ui.add_space(space(3));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let is_named = !path.trim().is_empty();
            if ui.add_enabled(is_named, primary_button(task.verb())).clicked() || (entered && is_named) {
                reply = Some(Reply::Path(PathBuf::from(path.trim())));
            }
            if ui.add(ghost_button("Cancel")).clicked() {
                reply = Some(Reply::Cancel);
            }
        });
    });
    if modal.should_close() {
        reply = Some(Reply::Cancel);
    }
    reply
}
