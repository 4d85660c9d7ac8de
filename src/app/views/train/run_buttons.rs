use eframe::egui::{Response, Ui, WidgetInfo, accesskit::Role};

use crate::app::{
    shared::{Effect, Phase, Shared},
    theme::space,
    widgets::{Landmark, ghost_button, primary_button},
};

/// The buttons that run the training, from right to left.
pub fn run_buttons_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
    let is_busy = shared.phase.is_busy();
    // In a narrow window the signs must do.
    let is_short = ui.available_width() < space(120);
    let stop = ui.add_enabled(is_busy, ghost_button(if is_short { "■" } else { "■ Stop" }));
    name(&stop, "■ Stop");
    if stop
        .on_hover_text("Ends the training; the best network so far is kept (Ctrl+.).")
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
    let sign = text.split(' ').next().unwrap_or(text);
    let pause = ui.add_enabled(can_pause, ghost_button(if is_short { sign } else { text }));
    name(&pause, text);
    if pause
        .on_hover_text("Pauses or resumes the training (Ctrl+P).")
        .clicked()
    {
        effects.push(effect);
    }
    let can_train = !is_busy && shared.phase != Phase::Died;
    let train = ui.add_enabled(can_train, primary_button("▶ Train"));
    Landmark::Train.stands_at(ui, train.rect);
    let can_continue = shared.can_continue();
    let hint = if can_continue {
        "Starts again: draws the sets and trains the network (Ctrl+Enter)."
    } else {
        "Draws the sets and trains the network (Ctrl+Enter)."
    };
    if train.on_hover_text(hint).clicked() {
        effects.push(Effect::Train);
    }
    if can_continue {
        let hint = "Continues from the present weights with the method and the epochs on the left, counted from here. \
                    Train starts again from random weights.";
        let go_on = ui.add(ghost_button("Continue"));
        if go_on.on_hover_text(hint).clicked() {
            effects.push(Effect::Continue);
        }
    }
}

/// Gives the button its whole name, for assistive technology.
fn name(button: &Response, name: &str) {
    let is_enabled = button.enabled();
    button.widget_info(|| WidgetInfo::labeled(Role::Button, is_enabled, name));
}
