use std::path::PathBuf;

use eframe::egui::{
    Align, Id, Key, Layout, RichText, TextEdit, Ui,
    text::{CCursor, CCursorRange},
    text_edit::TextEditState,
};

use super::modal::{Reply, card_ui};
use crate::window::{
    shared::FileTask,
    theme::{semibold, space, type_size},
    widgets::{dim_ui, ghost_button, note_ui, primary_button},
};

/// A file waiting for its path.
#[derive(Clone, Debug)]
pub struct Saving {
    /// Task of the file at the path.
    pub task: FileTask,
    /// The path typed so far.
    pub path: String,
    /// Outcome for this path, if it was tried.
    pub tried: Option<Tried>,
    is_new: bool,
}

/// Reasons why a file is not written at the typed path at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Tried {
    /// Another file exists there, and the user is asked whether to replace it.
    Exists,
    /// Nothing may be saved there, with the reason.
    Refused(String),
}

impl Saving {
    /// The task, with a path that typing replaces.
    pub fn new(task: FileTask, path: String, tried: Option<Tried>) -> Self {
        Self {
            task,
            path,
            tried,
            is_new: true,
        }
    }

    /// Returns the typed path.
    fn path(&self) -> PathBuf {
        PathBuf::from(self.path.trim())
    }
}

/// Asks for the path of a file inside the window, for desktops that offer no file dialog.
pub(super) fn save_form_ui(ui: &mut Ui, saving: &mut Saving) -> Option<Reply> {
    card_ui(ui, "save form", space(110), |ui| {
        ui.label(RichText::new(saving.task.title()).font(semibold(type_size().title)));
        dim_ui(ui, saving.task.words.description);
        ui.add_space(space(2));
        let has_entered = path_ui(ui, saving);
        match &saving.tried {
            Some(Tried::Refused(reason)) => {
                note_ui(ui, &format!("{reason}."));
            }
            Some(Tried::Exists) => {
                let path = saving.path();
                let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
                let text = format!("{name} already exists. Replacing it deletes its contents.");
                note_ui(ui, &text);
            }
            None => {}
        }
        ui.add_space(space(3));
        buttons_ui(ui, saving, has_entered)
    })
}

/// The field for the path. Returns true if Enter was pressed in it.
fn path_ui(ui: &mut Ui, saving: &mut Saving) -> bool {
    let label = ui.label("File");
    let id = Id::unique("path of a file");
    let edit = TextEdit::singleline(&mut saving.path).id(id);
    let edit = ui.add(edit.desired_width(f32::INFINITY)).labelled_by(label.id);
    let has_entered = edit.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
    // Typing and Enter are enough; Tab still reaches the buttons.
    let is_new = std::mem::take(&mut saving.is_new);
    if is_new || ui.memory(|memory| memory.focused().is_none()) {
        edit.request_focus();
    }
    if is_new {
        // Typing replaces the whole path.
        let mut state = TextEditState::load(ui.ctx(), id).unwrap_or_default();
        let whole = CCursorRange::two(CCursor::new(0), CCursor::new(saving.path.chars().count()));
        state.cursor.set_char_range(Some(whole));
        state.store(ui.ctx(), id);
    }
    if edit.changed() {
        saving.tried = None;
    }
    has_entered
}

fn buttons_ui(ui: &mut Ui, saving: &Saving, has_entered: bool) -> Option<Reply> {
    let mut reply = None;
    if saving.tried == Some(Tried::Exists) {
        // Where the button to save was, a second click or Enter does nothing.
        ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
            if ui.add(ghost_button("Replace")).clicked() {
                reply = Some(Reply::Path(saving.path(), false));
            }
            if ui.add(ghost_button("Cancel")).clicked() {
                reply = Some(Reply::Close);
            }
        });
        return reply;
    }
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        let is_named = !saving.path.trim().is_empty();
        let name = if saving.task.is_read() { "Open" } else { "Save" };
        let save = ui.add_enabled(is_named, primary_button(name));
        if is_named && (save.clicked() || has_entered) {
            reply = Some(Reply::Path(saving.path(), true));
        }
        if ui.add(ghost_button("Cancel")).clicked() {
            reply = Some(Reply::Close);
        }
    });
    reply
}
