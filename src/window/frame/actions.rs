use eframe::egui::{Context, Key, Modifiers, Ui};

use super::{
    DecouplerWindow,
    help::{self, Help, Page, help_ui},
    palette::{self, Palette, palette_ui},
    top_bar::{DARK, LIGHT},
    tour::Tour,
};
use crate::window::shared::{Action, Effect, Offers};

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
