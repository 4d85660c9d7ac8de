use eframe::egui::{Key, Modifiers, util::undoer::Undoer};

use super::DecouplerWindow;
use crate::window::shared::{Offers, RecordingDraft, Shared, SourceKind};
use decoupler_core::evaluation::SimulatedSettings;

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
