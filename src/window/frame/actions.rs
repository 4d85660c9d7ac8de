use decoupler_core::evaluation::RunSettings;
use eframe::egui::{
    Align, Button, Context, Frame, Id, Key, Layout, Margin, Modal, Modifiers, RichText, ScrollArea, TextEdit, Ui,
    WidgetInfo, accesskit::Role, util::undoer::Undoer, vec2,
};

use super::{
    DecouplerWindow,
    export_dialog::export_dialog_ui,
    help::{self, Help, Page, help_ui},
    top_bar::{DARK, LIGHT},
    tour::Tour,
};
use crate::window::{
    glossary::{self, Term},
    shared::{Action, Effect, Exporting, Offers, RecordingDraft, Shared, SourceKind},
    theme::{Theme, space},
    widgets::dim_ui,
};

/// Modal card over the window.
#[derive(Debug, Default)]
pub(super) enum Overlay {
    /// Nothing.
    #[default]
    None,
    /// The list of all actions.
    Palette(Palette),
    /// The keys, or the glossary.
    Help(Help),
    /// The form of an export.
    Export(Exporting),
}

/// Keys of the views, in the order of the top bar.
const VIEW_KEYS: [Key; 9] = [
    Key::Num1,
    Key::Num2,
    Key::Num3,
    Key::Num4,
    Key::Num5,
    Key::Num6,
    Key::Num7,
    Key::Num8,
    Key::Num9,
];

impl DecouplerWindow {
    /// Offers the actions of the current view and of the window, and carries out the ones that the user asked for.
    pub(super) fn offer_actions(&mut self, ctx: &Context, effects: &mut Vec<Effect>) -> Vec<Action> {
        // A question must be answered first.
        let hears_keys = !self.is_asked();
        let is_listed = self.picked.is_some() || matches!(self.overlay, Overlay::Palette(_));
        let mut offers = Offers::new(ctx, self.picked.take(), hears_keys);
        self.views.all()[self.shown].offer_actions(&mut offers, &self.shared, effects);
        // These have no keys, and take longer to list.
        if is_listed {
            for shown in self.views.all()[self.shown].shown(&self.shared) {
                if offers.offer(shown.action(), shown.item.is_ok()) {
                    effects.push(shown.ask());
                }
            }
        }
        self.offer_undoing(&mut offers);
        for (place, name) in self.names.clone() {
            let is_other = place != self.shown;
            if offers.offer_keys(format!("Show {name}"), Modifiers::COMMAND, VIEW_KEYS[place], is_other) {
                self.show(place);
            }
        }
        let theme = if self.shared.look.is_dark { LIGHT } else { DARK };
        if offers.offer(theme, true) {
            self.choose_theme(!self.shared.look.is_dark);
        }
        self.offer_colours(&mut offers);
        self.offer_scales(&mut offers);
        if offers.offer_keys("Search actions", Modifiers::COMMAND, Key::K, true) {
            self.overlay = Overlay::Palette(Palette::default());
        }
        if offers.offer_keys("Keys", Modifiers::NONE, Key::Questionmark, true) {
            self.overlay = Overlay::Help(Help::default());
        }
        if offers.offer("Glossary", true) {
            self.open_glossary("");
        }
        if offers.offer("About Decoupler", true) {
            let page = Page::About;
            self.overlay = Overlay::Help(Help {
                page,
                ..Help::default()
            });
        }
        if offers.offer("Take the tour", true) {
            self.begin_tour();
        }
        // Escape lifts the finger first.
        let may_end = self.tour.is_some() && !self.views.train.press.is_pressing();
        if offers.offer_keys("End the tour", Modifiers::NONE, Key::Escape, may_end) {
            self.end_tour();
        }
        offers.into_actions()
    }

    /// Returns true while a modal is open, which must be answered or closed first.
    pub(super) fn is_asked(&self) -> bool {
        self.saving.is_some() || self.closing.is_some() || !matches!(self.overlay, Overlay::None)
    }

    /// Shows the terms that contain this.
    fn open_glossary(&mut self, term: &str) {
        self.overlay = Overlay::Help(Help {
            page: Page::Glossary,
            typed: term.to_owned(),
        });
    }

    /// Starts the tour in the view that it describes.
    fn begin_tour(&mut self) {
        self.overlay = Overlay::None;
        self.tour = Some(Tour::default());
        self.show(0);
    }

    /// Ends the tour for good.
    pub(super) fn end_tour(&mut self) {
        self.tour = None;
        self.remembered.has_toured = Some(true);
    }

    /// Shows the list that the user asked for.
    pub(super) fn overlay_ui(&mut self, ui: &Ui, actions: &[Action]) {
        match &mut self.overlay {
            Overlay::None => return,
            Overlay::Palette(palette) => match palette_ui(ui, palette, actions) {
                Some(Reply::Pick(name)) => {
                    self.picked = Some(name);
                    self.overlay = Overlay::None;
                }
                Some(Reply::Define(term)) => self.open_glossary(term),
                Some(Reply::Close) => self.overlay = Overlay::None,
                None => return,
            },
            Overlay::Export(exporting) => {
                let shown = self.views.all()[self.shown].shown(&self.shared);
                let Some(effect) = export_dialog_ui(ui, exporting, shown) else {
                    return;
                };
                self.overlay = Overlay::None;
                self.apply_all(Vec::from_iter(effect));
            }
            Overlay::Help(help) => match help_ui(ui, help, actions) {
                Some(help::Reply::Tour) => self.begin_tour(),
                Some(help::Reply::Close) => self.overlay = Overlay::None,
                None => return,
            },
        }
        ui.request_repaint();
    }
}

/// Everything that the user sets for the next training.
type Drafts = (SourceKind, RunSettings, RecordingDraft);

fn drafts(shared: &Shared) -> Drafts {
    (shared.source, shared.draft, shared.recording.clone())
}

/// Undo and redo history of the settings.
///
/// A drag counts as one change, and so do changes less than a second apart.
#[derive(Debug, Default)]
pub(super) struct Undoing {
    undoer: Undoer<Drafts>,
}

impl Undoing {
    /// Records the settings of this frame, at a time in seconds.
    pub(super) fn follow(&mut self, time_s: f64, shared: &Shared) {
        self.undoer.feed_state(time_s, &drafts(shared));
    }

    pub(super) fn can_undo(&self, shared: &Shared) -> bool {
        self.undoer.has_undo(&drafts(shared))
    }

    pub(super) fn can_redo(&self, shared: &Shared) -> bool {
        self.undoer.has_redo(&drafts(shared))
    }
}

impl DecouplerWindow {
    /// Offers to undo and redo a change of the settings.
    pub(super) fn offer_undoing(&mut self, offers: &mut Offers<'_>) {
        // The settings of a running training cannot change.
        let is_free = !self.shared.phase.is_busy();
        let can_undo = is_free && self.undoing.can_undo(&self.shared);
        if offers.offer_keys("Undo change of settings", Modifiers::COMMAND, Key::Z, can_undo) {
            self.undo();
        }
        let can_redo = is_free && self.undoing.can_redo(&self.shared);
        let keys = Modifiers::COMMAND | Modifiers::SHIFT;
        if offers.offer_keys("Redo change of settings", keys, Key::Z, can_redo) {
            self.redo();
        }
    }

    /// Goes back to the settings before the last change.
    pub(super) fn undo(&mut self) {
        if let Some(drafts) = self.undoing.undoer.undo(&drafts(&self.shared)).cloned() {
            self.take_drafts(drafts);
        }
    }

    /// Restores the settings that were undone last.
    pub(super) fn redo(&mut self) {
        if let Some(drafts) = self.undoing.undoer.redo(&drafts(&self.shared)).cloned() {
            self.take_drafts(drafts);
        }
    }

    fn take_drafts(&mut self, (source, draft, mut recording): Drafts) {
        match &recording.plan {
            Ok(plan) if recording.plan != self.shared.recording.plan => self.views.open_plan(plan),
            Ok(_) => {}
            // Undoing closes no files.
            Err(_) => recording.plan.clone_from(&self.shared.recording.plan),
        }
        self.shared.recording = recording;
        self.shared.draft = draft;
        self.choose_source(source);
    }
}

/// The open list of all actions: typing filters it, and Enter runs the selected one.
#[derive(Debug, Default)]
pub(super) struct Palette {
    typed: String,
    /// Index of the selected action among the matches.
    marked: usize,
}

/// Answer of the user to the list.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Reply {
    /// Do the action of this name.
    Pick(String),
    /// Explain this term.
    Define(&'static str),
    /// Nothing.
    Close,
}

/// Shows the list over the window.
pub(super) fn palette_ui(ui: &Ui, palette: &mut Palette, actions: &[Action]) -> Option<Reply> {
    let mut reply = None;
    let frame = Frame::popup(ui.style()).inner_margin(Margin::same(12));
    let modal = Modal::new(Id::unique("palette")).frame(frame).show(ui.ctx(), |ui| {
        ui.set_width(space(110));
        let found = matching(actions, &palette.typed);
        let terms = terms(&palette.typed);
        // Before the field, which would otherwise handle arrows and Enter.
        let (down, up, enter) = ui.input_mut(|input| {
            let mut take = |key| input.consume_key(eframe::egui::Modifiers::NONE, key);
            (take(Key::ArrowDown), take(Key::ArrowUp), take(Key::Enter))
        });
        let last = (found.len() + terms.len()).saturating_sub(1);
        palette.marked = palette.marked.min(last);
        if down {
            palette.marked = (palette.marked + 1).min(last);
        }
        if up {
            palette.marked = palette.marked.saturating_sub(1);
        }
        let field = TextEdit::singleline(&mut palette.typed)
            .hint_text("Search actions")
            .margin(vec2(space(2), space(2)))
            .desired_width(f32::INFINITY);
        let field = ui.add(field);
        field.widget_info(|| WidgetInfo::labeled(Role::SearchInput, true, "Action"));
        field.request_focus();
        if field.changed() {
            palette.marked = 0;
        }
        ui.add_space(space(2));
        ScrollArea::vertical().max_height(space(90)).show(ui, |ui| {
            for (place, action) in found.iter().enumerate() {
                let is_marked = place == palette.marked;
                let row = action_ui(ui, action, is_marked);
                if is_marked && (down || up) {
                    row.scroll_to_me(None);
                }
                if action.is_possible && (row.clicked() || (is_marked && enter)) {
                    reply = Some(Reply::Pick(action.name.clone()));
                }
            }
            for (place, term) in terms.iter().enumerate() {
                let is_marked = found.len() + place == palette.marked;
                let row = term_ui(ui, term, is_marked);
                if is_marked && (down || up) {
                    row.scroll_to_me(None);
                }
                if row.clicked() || (is_marked && enter) {
                    reply = Some(Reply::Define(term.name));
                }
            }
            if found.is_empty() && terms.is_empty() {
                dim_ui(ui, "No matches");
            }
        });
    });
    if modal.should_close() {
        reply = Some(Reply::Close);
    }
    reply
}

/// One action and its keys. Returns the response of the whole line.
fn action_ui(ui: &mut Ui, action: &Action, is_marked: bool) -> eframe::egui::Response {
    let dim = Theme::of(ui).palette.dim;
    let keys = action.keys.map(|keys| ui.ctx().format_shortcut(&keys));
    let width = ui.available_width();
    let line = ui.allocate_ui_with_layout(vec2(width, space(7)), Layout::left_to_right(Align::Center), |ui| {
        ui.add_enabled_ui(action.is_possible, |ui| {
            let text = Button::selectable(is_marked, action.name.as_str());
            let text = text
                .min_size(vec2(width, space(7)))
                .right_text(RichText::new(keys.unwrap_or_default()).color(dim));
            let button = ui.add(text);
            // The accessible name leaves out the keys.
            button.widget_info(|| WidgetInfo::labeled(Role::Button, action.is_possible, &action.name));
            button
        })
        .inner
    });
    let reason = "Not available now";
    line.inner.on_disabled_hover_text(reason)
}

/// A term of the glossary. Returns the response of the whole line.
fn term_ui(ui: &mut Ui, term: &Term, is_marked: bool) -> eframe::egui::Response {
    let dim = Theme::of(ui).palette.dim;
    let button = Button::selectable(is_marked, term.name)
        .min_size(vec2(ui.available_width(), space(7)))
        .right_text(RichText::new("Glossary").color(dim));
    let button = ui.add(button);
    let label = format!("{} in the glossary", term.name);
    button.widget_info(|| WidgetInfo::labeled(Role::Button, true, &label));
    button.on_hover_text(term.hint)
}

/// Returns the terms whose names contain the words in `typed`; none if it is empty.
fn terms(typed: &str) -> Vec<Term> {
    let words: Vec<_> = typed.split_whitespace().map(str::to_lowercase).collect();
    let all = glossary::groups().into_iter().flat_map(|group| group.terms);
    let is_match = |term: &Term| {
        let name = term.name.to_lowercase();
        !words.is_empty() && words.iter().all(|word| name.contains(word))
    };
    all.filter(is_match).collect()
}

/// Returns the actions whose names contain the words in `typed` in any order, available ones first.
fn matching<'a>(actions: &'a [Action], typed: &str) -> Vec<&'a Action> {
    let words: Vec<_> = typed.split_whitespace().map(str::to_lowercase).collect();
    let mut found: Vec<_> = actions
        .iter()
        .filter(|action| {
            let name = action.name.to_lowercase();
            words.iter().all(|word| name.contains(word))
        })
        .collect();
    found.sort_by_key(|action| !action.is_possible);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_in_any_order_find_an_action_and_available_ones_come_first() {
        let action = |name: &str, is_possible| Action {
            name: name.to_owned(),
            keys: None,
            is_possible,
        };
        let actions = [
            action("Stop training", false),
            action("Train", true),
            action("Show Trade-off", true),
        ];
        let names = |typed| {
            matching(&actions, typed)
                .iter()
                .map(|found| found.name.as_str())
                .collect::<Vec<_>>()
        };
        assert_eq!(names(""), ["Train", "Show Trade-off", "Stop training"]);
        assert_eq!(names("off show"), ["Show Trade-off"]);
        assert_eq!(names("TRAIN"), ["Train", "Stop training"]);
        assert_eq!(names("press"), [""; 0]);
    }
}
