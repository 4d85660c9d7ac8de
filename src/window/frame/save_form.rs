use std::path::{Path, PathBuf};

use eframe::egui::{
    Align, Context, Frame, Id, Key, Layout, Margin, Modal, RichText, TextEdit, Ui,
    text::{CCursor, CCursorRange},
    text_edit::TextEditState,
};

use super::files::Found;
use crate::window::{
    shared::FileTask,
    theme::{Theme, semibold, space, type_size},
    widgets::{dim_ui, ghost_button, note_ui, primary_button},
};

/// A file waiting for its path.
#[derive(Clone, Debug)]
pub struct Saving {
    /// Task of the file at the path.
    pub task: FileTask,
    /// The path typed so far.
    pub path: String,
    stage: Stage,
}

/// State of the path entry.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Stage {
    /// The form has just opened.
    Opening,
    /// The path is being typed.
    Typing,
    /// The path is being checked.
    Checking,
    /// Another file exists there, and the user is asked whether to replace it.
    Asking,
    /// Nothing may be saved there, with the reason.
    Refused(String),
}

/// Answer of the user to the form.
pub enum Reply {
    /// Use this path.
    Path(PathBuf),
    /// Use this path and replace the file there.
    Replace(PathBuf),
    /// Cancel.
    Cancel,
}

impl Saving {
    /// The task, with a path that typing replaces.
    pub fn new(task: FileTask, path: String) -> Self {
        Self {
            task,
            path,
            stage: Stage::Opening,
        }
    }

    /// Returns the typed path.
    fn path(&self) -> PathBuf {
        PathBuf::from(self.path.trim())
    }

    /// Waits for the check of the path.
    pub(super) fn wait_for_check(&mut self) {
        self.stage = Stage::Checking;
    }

    /// The path, while it is being checked.
    pub(super) fn checked_path(&self) -> Option<PathBuf> {
        (self.stage == Stage::Checking).then(|| self.path())
    }

    /// Takes the result of checking a path; returns true if the file can be written there without a question.
    pub(super) fn take(&mut self, path: &Path, found: Found) -> bool {
        // Another path may have been typed since.
        if self.stage != Stage::Checking || self.path() != path {
            return false;
        }
        match found {
            Found::Nothing => return true,
            Found::File => self.stage = Stage::Asking,
            Found::InUse(reason) => self.stage = Stage::Refused(reason),
        }
        false
    }
}

/// Asks for the path of a file inside the window: for desktops that offer no file dialog, and for typing.
pub fn save_form_ui(ui: &mut Ui, saving: &mut Saving) -> Option<Reply> {
    let mut reply = None;
    let frame = Frame::popup(ui.style()).inner_margin(Margin::same(16));
    let modal = Modal::new(Id::unique("save form")).frame(frame).show(ui.ctx(), |ui| {
        ui.set_width(space(110));
        let task = &saving.task;
        let title = format!("{} {}", task.verb(), task.words.kind);
        ui.label(RichText::new(title).font(semibold(type_size().title)));
        let dim = Theme::of(ui).palette.dim;
        ui.label(RichText::new(task.words.description).size(type_size().note).color(dim));
        ui.add_space(space(2));
        let has_entered = path_ui(ui, saving);
        ui.add_space(space(3));
        reply = match &saving.stage {
            Stage::Asking => question_ui(ui, saving),
            _ => buttons_ui(ui, saving, has_entered),
        };
    });
    if modal.should_close() {
        reply = Some(Reply::Cancel);
    }
    reply
}

/// The field for the path, with notes about it. Returns true if Enter was pressed in it.
fn path_ui(ui: &mut Ui, saving: &mut Saving) -> bool {
    let label = ui.label("File");
    let id = Id::unique("path of a file");
    let edit = TextEdit::singleline(&mut saving.path).id(id);
    let edit = ui.add(edit.desired_width(f32::INFINITY)).labelled_by(label.id);
    let has_entered = edit.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
    // Typing and Enter are enough; Tab still reaches the buttons.
    if ui.memory(|memory| memory.focused().is_none()) {
        edit.request_focus();
    }
    if saving.stage == Stage::Opening {
        select_all(ui.ctx(), id, &saving.path);
        saving.stage = Stage::Typing;
    }
    if edit.changed() {
        saving.stage = Stage::Typing;
    }
    match &saving.stage {
        Stage::Refused(reason) => {
            note_ui(ui, &format!("{reason}."));
        }
        Stage::Asking => {
            let name = saving.path();
            let name = name.file_name().unwrap_or(name.as_os_str()).to_string_lossy();
            note_ui(
                ui,
                &format!("{name} already exists. Replacing it deletes its contents."),
            );
        }
        Stage::Checking => {
            dim_ui(ui, "Checking whether a file of this name exists…");
        }
        Stage::Opening | Stage::Typing => {}
    }
    has_entered
}

/// Selects the whole path, so that typing replaces it.
fn select_all(ctx: &Context, id: Id, path: &str) {
    let mut state = TextEditState::load(ctx, id).unwrap_or_default();
    let whole = CCursorRange::two(CCursor::new(0), CCursor::new(path.chars().count()));
    state.cursor.set_char_range(Some(whole));
    state.store(ctx, id);
}

fn buttons_ui(ui: &mut Ui, saving: &Saving, has_entered: bool) -> Option<Reply> {
    let mut reply = None;
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        let may_go = !saving.path.trim().is_empty() && saving.stage == Stage::Typing;
        let is_clicked = ui.add_enabled(may_go, primary_button(saving.task.verb())).clicked();
        if is_clicked || (has_entered && may_go) {
            reply = Some(Reply::Path(saving.path()));
        }
        if ui.add(ghost_button("Cancel")).clicked() {
            reply = Some(Reply::Cancel);
        }
    });
    reply
}

/// Asks whether to replace the file. Where the button to save was, a second click or Enter does nothing.
fn question_ui(ui: &mut Ui, saving: &Saving) -> Option<Reply> {
    let mut reply = None;
    ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
        if ui.add(ghost_button("Replace")).clicked() {
            reply = Some(Reply::Replace(saving.path()));
        }
        if ui.add(ghost_button("Cancel")).clicked() {
            reply = Some(Reply::Cancel);
        }
    });
    reply
}
