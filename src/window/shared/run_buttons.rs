use eframe::egui::{Key, Response, Ui, WidgetInfo, accesskit::Role};

use super::Phase;
use decoupler_core::text::capitalised;

use crate::window::{
    theme::space,
    widgets::{Landmark, ghost_button, primary_button, with_shortcut},
};

/// Wish of the user for a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunWish {
    /// Begin one.
    Train,
    /// Go on from the current weights with the settings as they are now.
    Continue,
    /// Hold it.
    Pause,
    /// Go on with it.
    Resume,
    /// End it.
    Stop,
}

/// The buttons that run a training in this phase, from right to left. Train draws or reads the samples, as `hint` says.
pub fn run_buttons_ui(
    ui: &mut Ui,
    phase: Phase,
    (can_train, can_continue): (bool, bool),
    hint: &str,
) -> Option<RunWish> {
    let mut wish = None;
    let is_busy = phase.is_busy();
    // In a narrow window the signs must do.
    let is_short = ui.available_width() < space(120);
    let stop = ui.add_enabled(is_busy, ghost_button(if is_short { "■" } else { "■ Stop" }));
    name(&stop, "■ Stop");
    if stop
        .on_hover_text(with_shortcut(
            ui,
            "Ends the training; the best network so far is kept",
            Key::Period,
        ))
        .clicked()
    {
        wish = Some(RunWish::Stop);
    }
    let (text, toggled) = if phase == Phase::Paused {
        ("▶ Resume", RunWish::Resume)
    } else {
        ("⏸ Pause", RunWish::Pause)
    };
    let can_pause = matches!(phase, Phase::Training | Phase::Paused);
    let sign = text.split(' ').next().unwrap_or(text);
    let pause = ui.add_enabled(can_pause, ghost_button(if is_short { sign } else { text }));
    name(&pause, text);
    if pause
        .on_hover_text(with_shortcut(ui, "Pauses or resumes the training", Key::P))
        .clicked()
    {
        wish = Some(toggled);
    }
    let train = ui.add_enabled(can_train && !is_busy, primary_button("▶ Train"));
    Landmark::Train.stands_at(ui, train.rect);
    let hint = if can_continue {
        with_shortcut(ui, &format!("Starts again: {hint}"), Key::Enter)
    } else {
        with_shortcut(ui, &capitalised(hint), Key::Enter)
    };
    if train.on_hover_text(hint).clicked() {
        wish = Some(RunWish::Train);
    }
    if can_continue {
        let hint = "Continues from the current weights with the method and the epochs on the left, counted from here. \
                    Train starts again from random weights.";
        let go_on = ui.add(ghost_button("Continue"));
        if go_on.on_hover_text(hint).clicked() {
            wish = Some(RunWish::Continue);
        }
    }
    wish
}

/// Gives the button its whole name, for assistive technology.
fn name(button: &Response, name: &str) {
    let is_enabled = button.enabled();
    button.widget_info(|| WidgetInfo::labeled(Role::Button, is_enabled, name));
}
