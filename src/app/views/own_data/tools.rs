use eframe::egui::{Key, Modifiers, Ui};

use super::state::OwnDataView;
use crate::app::shared::{Effect, Offers, Phase, RunWish, run_buttons_ui};

/// Offers what can be done with the import and its training.
pub(super) fn offer_actions(view: &mut OwnDataView, offers: &mut Offers<'_>, effects: &mut Vec<Effect>) {
    let phase = view.phase;
    let can_begin = !phase.is_busy() && view.obstacle().is_none();
    if offers.offer_keys("Train", Modifiers::COMMAND, Key::Enter, can_begin) {
        view.train();
    }
    if offers.offer("Continue training", view.can_continue()) {
        view.go_on();
    }
    let name = if phase == Phase::Paused {
        "Resume training"
    } else {
        "Pause training"
    };
    let can_pause = matches!(phase, Phase::Training | Phase::Paused);
    if offers.offer_keys(name, Modifiers::COMMAND, Key::P, can_pause) {
        view.toggle_pause();
    }
    if offers.offer_keys("Stop training", Modifiers::COMMAND, Key::Period, phase.is_busy()) {
        view.stop();
    }
    if offers.offer("Cross-validate", can_begin) {
        view.validate();
    }
    if offers.offer("Open files", !phase.is_busy()) {
        effects.push(Effect::ChooseFile(view.open_task()));
    }
}

/// The buttons that run the training, from right to left.
pub(super) fn tools_ui(ui: &mut Ui, view: &mut OwnDataView) {
    let can = (view.obstacle().is_none(), view.can_continue());
    let hint = "reads the files and trains the network";
    match run_buttons_ui(ui, view.phase, can, hint) {
        Some(RunWish::Train) => view.train(),
        Some(RunWish::Continue) => view.go_on(),
        Some(RunWish::Pause | RunWish::Resume) => view.toggle_pause(),
        Some(RunWish::Stop) => view.stop(),
        None => {}
    }
}
