use eframe::egui::{Button, Key, Modifiers, Ui};

use super::{LiveView, engine::Command};
use crate::window::{
    glossary,
    shared::{Effect, Offers, Shared},
    theme::{Theme, space},
    widgets::{ghost_button, primary_button, with_shortcut},
};

/// The buttons that run the source, from right to left.
pub fn tools_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let is_running = view.running.is_some();
    let stop = ui.add_enabled(is_running, ghost_button("■ Stop"));
    if stop
        .on_hover_text(with_shortcut(ui, "Ends live decoding", Key::Period))
        .clicked()
    {
        view.stop();
    }
    let obstacle = view.obstacle(shared);
    let start = ui.add_enabled(!is_running && obstacle.is_none(), primary_button("▶ Start"));
    let why_not = obstacle.as_deref().unwrap_or("Frames are being decoded.");
    if start
        .on_hover_text(with_shortcut(
            ui,
            "Decodes the frames of the source as they arrive",
            Key::Enter,
        ))
        .on_disabled_hover_text(why_not)
        .clicked()
    {
        view.start(shared, effects);
    }
    ui.add_space(space(2));
    if !view.has_sensor(shared) {
        return;
    }
    record_ui(ui, view);
    let zero = ui.add_enabled(is_running, ghost_button("Re-zero"));
    let hint = glossary::UNLOADED_STATE.hint;
    if zero.on_hover_text(hint).clicked() {
        view.re_zero();
    }
}

fn record_ui(ui: &mut Ui, view: &LiveView) {
    let is_recording = view.recording.is_some();
    let text = if is_recording {
        "■ End recording"
    } else {
        "● Record"
    };
    let mut button: Button<'_> = ghost_button(text);
    if is_recording {
        button = button.fill(Theme::of(ui).palette.selected);
    }
    let button = ui.add_enabled(view.can_record(), button);
    let why_not = if view.running.is_some() {
        "A replay cannot be recorded."
    } else {
        "Start a source first."
    };
    if button
        .on_hover_text(with_shortcut(
            ui,
            "Writes every frame with its time to a file of its own, as it arrives",
            Key::R,
        ))
        .on_disabled_hover_text(why_not)
        .clicked()
    {
        view.toggle_recording();
    }
}

/// Offers what can be done with the source.
pub fn offer_actions(view: &mut LiveView, offers: &mut Offers<'_>, shared: &Shared, effects: &mut Vec<Effect>) {
    let is_running = view.running.is_some();
    let can_start = !is_running && view.obstacle(shared).is_none();
    if offers.offer_keys("Start live decoding", Modifiers::COMMAND, Key::Enter, can_start) {
        view.start(shared, effects);
    }
    if offers.offer_keys("Stop live decoding", Modifiers::COMMAND, Key::Period, is_running) {
        view.stop();
    }
    if offers.offer_keys("Start or end recording", Modifiers::COMMAND, Key::R, view.can_record()) {
        view.toggle_recording();
    }
    if offers.offer("Re-zero", is_running && view.has_sensor(shared)) {
        view.re_zero();
    }
    let replay = view.shown.replay;
    let is_pressed = offers.offer_keys("Pause or resume replay", Modifiers::COMMAND, Key::P, replay.is_some());
    if let Some(replay) = replay.filter(|_| is_pressed) {
        view.command(Command::Play(!replay.is_playing));
    }
}
