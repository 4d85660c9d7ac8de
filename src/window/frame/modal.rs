//! The one card over the window that must be answered or closed first: the list of all commands, the help, the form of a
//! path, or the question before closing.

use std::path::PathBuf;

use eframe::egui::{
    Align, Button, Frame, Id, Key, Layout, Margin, Modal as EguiModal, Modifiers, Response, RichText, ScrollArea,
    TextEdit, Ui, WidgetInfo, accesskit::Role, vec2,
};

use super::{
    DecouplerWindow,
    closing::{Closing, closing_ui},
    export_dialog::export_dialog_ui,
    help::{Help, Page, help_ui},
    save_form::{Saving, save_form_ui},
};
use crate::window::{
    glossary,
    shared::{About, Command, Effect, Exporting, Offer, ViewKind},
    theme::{Theme, space},
    widgets::{dim_ui, hinted},
};

/// The open modal.
#[derive(Debug)]
pub(super) enum Modal {
    /// The list of all commands.
    Palette(Palette),
    /// The keys, the glossary, or the licences.
    Help(Help),
    /// A file waiting for its path.
    Path(Saving),
    /// The form of an export.
    Export(Exporting),
    /// The question about unfinished work before the window closes.
    Closing(Closing),
}

/// Answer of the user to a modal.
pub(super) enum Reply {
    /// Close it.
    Close,
    /// Do this.
    Do(Command, Option<ViewKind>),
    /// Explain this term.
    Define(&'static str),
    /// Use this path, after asking about a file that exists there if true.
    Path(PathBuf, bool),
    /// Apply this.
    Apply(Box<Effect>),
    /// Close the window, and keep the running training for the next start or not.
    Leave { keeps_training: bool },
}

impl DecouplerWindow {
    /// Shows the modal, and does what the user answers.
    pub(super) fn modal_ui(&mut self, ui: &mut Ui) {
        let unfinished = match self.modal {
            Some(Modal::Closing(_)) => self.unfinished(),
            _ => Vec::new(),
        };
        let offers = &self.shared.offers;
        let reply = match &mut self.modal {
            None => return,
            Some(Modal::Palette(palette)) => palette_ui(ui, palette, offers),
            Some(Modal::Help(help)) => help_ui(ui, help, offers),
            Some(Modal::Closing(closing)) => closing_ui(ui, closing, &unfinished),
            Some(Modal::Path(saving)) => save_form_ui(ui, saving),
            Some(Modal::Export(exporting)) => {
                let shown = self.views.get(self.shared.shown).shown(&self.shared);
                export_dialog_ui(ui, exporting, shown)
            }
        };
        match reply {
            None => return,
            Some(Reply::Close) => self.modal = None,
            Some(Reply::Path(path, asks)) => self.take_typed(path, asks),
            Some(Reply::Apply(effect)) => {
                self.modal = None;
                self.apply(*effect);
            }
            Some(Reply::Do(command, of)) => {
                (self.modal, self.picked) = (None, Some(command));
                of.into_iter().for_each(|view| self.show(view));
            }
            Some(Reply::Define(term)) => self.modal = Some(Modal::Help(Help::open(Page::Glossary, term))),
            Some(Reply::Leave { keeps_training }) => self.leave(keeps_training),
        }
        ui.request_repaint();
    }
}

/// Shows a card over the window. Escape, or a click outside, closes it.
pub(super) fn card_ui(ui: &Ui, id: &str, width: f32, add: impl FnOnce(&mut Ui) -> Option<Reply>) -> Option<Reply> {
    let frame = Frame::popup(ui.style()).inner_margin(Margin::same(16));
    let modal = EguiModal::new(Id::unique(id)).frame(frame).show(ui.ctx(), |ui| {
        ui.set_width(width);
        add(ui)
    });
    let closed = modal.should_close().then_some(Reply::Close);
    closed.or(modal.inner)
}

/// Gives the focus to a field of a card, unless the user has moved it.
pub(super) fn take_focus(ui: &Ui, field: &Response) {
    if ui.memory(|memory| memory.focused().is_none()) {
        field.request_focus();
    }
}

/// The open list of all commands: typing filters it, and Enter does the selected one.
#[derive(Debug, Default)]
pub(super) struct Palette {
    typed: String,
    /// Index of the selected line.
    marked: usize,
}

/// A line of the list.
struct Line {
    name: String,
    /// Its keys, or where it leads.
    right: String,
    /// Its accessible name.
    label: String,
    hint: &'static str,
    /// The answer, or the reason why its command is not available now.
    reply: Result<Reply, String>,
}

impl Line {
    fn ui(&self, ui: &mut Ui, is_marked: bool) -> Response {
        let right = RichText::new(&self.right).color(Theme::of(ui).palette.dim);
        let size = vec2(ui.available_width(), space(7));
        let is_possible = self.reply.is_ok();
        let line = ui.allocate_ui_with_layout(size, Layout::left_to_right(Align::Center), |ui| {
            let button = Button::selectable(is_marked, &self.name);
            ui.add_enabled(is_possible, button.min_size(size).right_text(right))
        });
        let why_not = self.reply.as_ref().err().map_or("", String::as_str);
        let line = line.inner.on_disabled_hover_text(why_not);
        line.widget_info(|| WidgetInfo::labeled(Role::Button, is_possible, &self.label));
        hinted(line, self.hint)
    }
}

fn palette_ui(ui: &Ui, palette: &mut Palette, offers: &[Offer]) -> Option<Reply> {
    card_ui(ui, "palette", space(110), |ui| {
        let mut reply = None;
        let lines = matching(ui, offers, &palette.typed);
        // Before the field, which would otherwise handle arrows and Enter.
        let [down, up, enter] = [Key::ArrowDown, Key::ArrowUp, Key::Enter]
            .map(|key| ui.input_mut(|input| input.consume_key(Modifiers::NONE, key)));
        let moved = (palette.marked + usize::from(down)).saturating_sub(usize::from(up));
        palette.marked = moved.min(lines.len().saturating_sub(1));
        let field = TextEdit::singleline(&mut palette.typed)
            .hint_text("Search actions")
            .margin(vec2(space(2), space(2)))
            .desired_width(f32::INFINITY);
        let field = ui.add(field);
        field.widget_info(|| WidgetInfo::labeled(Role::SearchInput, true, "Action"));
        take_focus(ui, &field);
        if field.changed() {
            palette.marked = 0;
        }
        ui.add_space(space(2));
        if lines.is_empty() {
            dim_ui(ui, "No matches");
        }
        ScrollArea::vertical().max_height(space(90)).show(ui, |ui| {
            for (place, line) in lines.into_iter().enumerate() {
                let is_marked = place == palette.marked;
                let shown = line.ui(ui, is_marked);
                if is_marked && (down || up) {
                    shown.scroll_to_me(None);
                }
                if shown.clicked() || (is_marked && enter) {
                    reply = line.reply.ok();
                }
            }
        });
        reply
    })
}

/// Returns the commands that contain the typed words in any order in their names, those that contain them in their hints,
/// and the terms of the glossary with these words; available commands come first.
fn matching(ui: &Ui, offers: &[Offer], typed: &str) -> Vec<Line> {
    let has_words = |text: &str| glossary::has_words(text, typed);
    let mut found = Vec::new();
    for Offer { command, obstacle, of } in offers {
        let About { name, keys, hint } = command.about();
        let is_named = has_words(&name);
        if is_named || has_words(&format!("{name} {hint}")) {
            let line = Line {
                // The accessible name leaves out the keys.
                label: name.clone(),
                name,
                right: match (of, keys) {
                    (Some(view), _) => view.name().to_owned(),
                    (None, keys) => keys.map_or(String::new(), |keys| ui.ctx().format_shortcut(&keys)),
                },
                hint,
                reply: obstacle.clone().map_or(Ok(Reply::Do(command.clone(), *of)), Err),
            };
            found.push(((obstacle.is_some(), !is_named, of.is_some()), line));
        }
    }
    found.sort_by_key(|(rank, _)| *rank);
    let terms = glossary::groups().into_iter().flat_map(|(_, terms)| terms);
    let terms = terms.filter(|term| !typed.trim().is_empty() && has_words(term.name));
    let terms = terms.map(|term| Line {
        name: term.name.to_owned(),
        right: "Glossary".to_owned(),
        label: format!("{} in the glossary", term.name),
        hint: term.hint,
        reply: Ok(Reply::Define(term.name)),
    });
    found.into_iter().map(|(_, line)| line).chain(terms).collect()
}

#[cfg(test)]
mod tests {
    use eframe::egui::{Context, RawInput};

    use super::*;

    #[test]
    fn words_in_any_order_find_a_command_and_available_ones_come_first() {
        let of = None;
        let offer = |command, obstacle: Option<&str>| Offer {
            command,
            obstacle: obstacle.map(str::to_owned),
            of,
        };
        let offers = [
            offer(Command::StopTraining, Some("No training is running.")),
            offer(Command::Train, None),
            offer(Command::Show(ViewKind::Compare), None),
        ];
        let names = |typed| {
            let mut names = Vec::new();
            let mut output = Context::default().run_ui(RawInput::default(), |ui| {
                let lines = matching(ui, &offers, typed).into_iter();
                let commands = lines.filter(|line| line.right != "Glossary");
                names = commands.map(|line| line.name).collect::<Vec<_>>();
            });
            // Nothing is drawn.
            output.textures_delta.clear();
            names
        };
        assert_eq!(names(""), ["Train", "Show Compare", "Stop training"]);
        assert_eq!(names("are show"), ["Show Compare"]);
        assert_eq!(names("TRAIN"), ["Train", "Stop training"]);
        assert_eq!(names("start training"), ["Train"], "by the words of its hint");
        assert_eq!(names("press"), [""; 0]);
    }
}
