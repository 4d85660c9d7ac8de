use eframe::egui::{Key, Modifiers, util::undoer::Undoer};

use super::DecouplerWindow;
use crate::{app::shared::Offers, evaluation::SimulatedSettings};

/// The settings that were, and those that were taken back.
///
/// A drag, or changes that follow one another within a second, count as one.
#[derive(Debug, Default)]
pub(super) struct Undoing {
    undoer: Undoer<SimulatedSettings>,
}

impl Undoing {
    /// Takes notice of the settings of this frame, at a time in seconds.
    pub(super) fn follow(&mut self, time_s: f64, draft: &SimulatedSettings) {
        self.undoer.feed_state(time_s, draft);
    }

    pub(super) fn can_undo(&self, draft: &SimulatedSettings) -> bool {
        self.undoer.has_undo(draft)
    }

    pub(super) fn can_redo(&self, draft: &SimulatedSettings) -> bool {
        self.undoer.has_redo(draft)
    }
}

impl DecouplerWindow {
    /// Offers to take a change of the settings back, and to make it again.
    pub(super) fn offer_undoing(&mut self, offers: &mut Offers<'_>) {
        // The settings of a training that runs stay.
        let is_free = !self.shared.phase.is_busy();
        let draft = self.shared.draft;
        let can_undo = is_free && self.undoing.can_undo(&draft);
        if offers.offer_keys("Undo change of settings", Modifiers::COMMAND, Key::Z, can_undo) {
            self.undo();
        }
        let can_redo = is_free && self.undoing.can_redo(&draft);
        let keys = Modifiers::COMMAND | Modifiers::SHIFT;
        if offers.offer_keys("Redo change of settings", keys, Key::Z, can_redo) {
            self.redo();
        }
    }

    /// Goes back to the settings before the last change.
    pub(super) fn undo(&mut self) {
        if let Some(&draft) = self.undoing.undoer.undo(&self.shared.draft) {
            self.configure(draft);
        }
    }

    /// Goes on to the settings that were taken back last.
    pub(super) fn redo(&mut self) {
        if let Some(&draft) = self.undoing.undoer.redo(&self.shared.draft) {
            self.configure(draft);
        }
    }
}
