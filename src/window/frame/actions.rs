use decoupler_core::evaluation::SimulatedSettings;
use eframe::egui::{Context, Key, Modifiers, Ui, util::undoer::Undoer};

use super::{
    DecouplerWindow,
    help::{self, Help, Page, help_ui},
    palette::{self, Palette, palette_ui},
    top_bar::{DARK, LIGHT},
    tour::Tour,
};
use crate::window::shared::{Action, Effect, Offers, RecordingDraft, Shared, SourceKind};

/// A card that lies over the window for a moment.
#[derive(Debug, Default)]
pub(super) enum Overlay {
    /// Nothing.
    #[default]
    None,
    /// The list of all actions.
    Palette(Palette),
    /// The keys, or the glossary.
    Help(Help),
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
    /// Offers what can be done now, by the current view and by the window, and does what the user wants of that.
    pub(super) fn offer_actions(&mut self, ctx: &Context, effects: &mut Vec<Effect>) -> Vec<Action> {
        // A question is to be answered first.
        let hears_keys = !self.is_asked();
        let is_listed = self.picked.is_some() || matches!(self.overlay, Overlay::Palette(_));
        let mut offers = Offers::new(ctx, self.picked.take(), hears_keys);
        self.views.all()[self.shown].offer_actions(&mut offers, &self.shared, effects);
        // These have no keys, and take longer to list.
        if is_listed {
            for export in self.views.all()[self.shown].exports(&self.shared) {
                if offers.offer(export.action(), export.ask.is_ok())
                    && let Ok(ask) = export.ask
                {
                    effects.push(ask());
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

    /// Returns true while something lies over the window that is to be answered or closed first.
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

    /// Begins the tour in the view that it is about.
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
                Some(palette::Reply::Pick(name)) => {
                    self.picked = Some(name);
                    self.overlay = Overlay::None;
                }
                Some(palette::Reply::Define(term)) => self.open_glossary(term),
                Some(palette::Reply::Close) => self.overlay = Overlay::None,
                None => return,
            },
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
type Drafts = (SourceKind, SimulatedSettings, RecordingDraft);

fn drafts(shared: &Shared) -> Drafts {
    (shared.source, shared.draft, shared.recording.clone())
}

/// The settings that were, and those that were taken back.
///
/// A drag, or changes that follow one another within a second, count as one.
#[derive(Debug, Default)]
pub(super) struct Undoing {
    undoer: Undoer<Drafts>,
}

impl Undoing {
    /// Takes notice of the settings of this frame, at a time in seconds.
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
    /// Offers to take a change of the settings back, and to make it again.
    pub(super) fn offer_undoing(&mut self, offers: &mut Offers<'_>) {
        // The settings of a training that runs stay.
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

    /// Continues to the settings that were taken back last.
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
