use eframe::egui::Ui;

use crate::app::{
    shared::{Effect, Phase, Shared},
    widgets::{ghost_button, primary_button},
};

/// The buttons that run the training, from right to left.
pub fn run_buttons_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
    let is_busy = shared.phase.is_busy();
    let stop = ui.add_enabled(is_busy, ghost_button("■ Stop"));
    if stop
        .on_hover_text("End the training; the best network so far stays (Ctrl+.)")
        .clicked()
    {
        effects.push(Effect::Stop);
    }
    let held = shared.phase == Phase::Paused;
    let (text, effect) = if held {
        ("▶ Resume", Effect::Resume)
    } else {
        ("⏸ Pause", Effect::Pause)
    };
    let can_pause = matches!(shared.phase, Phase::Training | Phase::Paused);
    if ui
        .add_enabled(can_pause, ghost_button(text))
        .on_hover_text("Hold the training, or go on (Ctrl+P)")
        .clicked()
    {
        effects.push(effect);
    }
    let can_train = !is_busy && shared.phase != Phase::Died;
    let train = ui.add_enabled(can_train, primary_button("▶ Train"));
    let can_continue = shared.can_continue();
    let hint = if can_continue {
        "Begin anew: draw the sets and train the network (Ctrl+Enter)"
    } else {
        "Draw the sets and train the network (Ctrl+Enter)"
    };
    if train.on_hover_text(hint).clicked() {
        effects.push(Effect::Train);
    }
    if can_continue {
        let hint = "Go on from the present weights with the method and the epochs on the left, counted from here; Train \
                    begins anew";
        let go_on = ui.add(ghost_button("Continue"));
        if go_on.on_hover_text(hint).clicked() {
            effects.push(Effect::Continue);
        }
    }
}
