use eframe::egui::{Context, Key, KeyboardShortcut, Modifiers};

use crate::app::{
    shared::{Phase, State},
    window::Action,
};

/// What the keys of this frame mean.
pub fn pressed_shortcuts(ctx: &Context, state: &State) -> Vec<Action> {
    // The question for a path is to be answered first.
    if state.saving.is_some() {
        return Vec::new();
    }
    let snapshots = state.test().map_or(0, |test| test.snapshots.len());
    let shown = state.look.snapshot;
    let pressed =
        |modifiers, key| ctx.input_mut(|input| input.consume_shortcut(&KeyboardShortcut::new(modifiers, key)));
    let mut actions = Vec::new();
    if pressed(Modifiers::COMMAND, Key::Enter) && !state.phase.is_busy() && state.phase != Phase::Died {
        actions.push(Action::Train);
    }
    if pressed(Modifiers::COMMAND, Key::P) {
        match state.phase {
            Phase::Training => actions.push(Action::Pause),
            Phase::Paused => actions.push(Action::Resume),
            _ => {}
        }
    }
    if pressed(Modifiers::COMMAND, Key::Period) && state.phase.is_busy() {
        actions.push(Action::Stop);
    }
    if pressed(Modifiers::NONE, Key::PageDown) && shown + 1 < snapshots {
        actions.push(Action::ShowSnapshot(shown + 1));
    }
    if pressed(Modifiers::NONE, Key::PageUp) && shown > 0 {
        actions.push(Action::ShowSnapshot(shown - 1));
    }
    actions
}
