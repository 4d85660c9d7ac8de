use std::time::Duration;

use decoupler_core::{evaluation::TestErrors, text::capitalised, training::StopReason};
use decoupler_files::export::{format_duration, format_percent};
use eframe::egui::{Ui, WidgetInfo, accesskit::Role};

use super::{Command, Effect, Phase, RunView, Shared, SourceKind, Status, Tone};
use crate::window::widgets::{ghost_button, primary_button};

/// The buttons that run a training.
pub fn run_buttons_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
    let phase = shared.phase;
    // In a narrow window the buttons show only their symbols.
    let is_short = ui.ctx().content_rect().width() < 1100.0;
    let longer = Command::TrainLonger.about();
    if shared.can_continue() && ui.add(ghost_button(&longer.name)).on_hover_text(longer.hint).clicked() {
        effects.push(Effect::Continue);
    }
    let mut button_ui = |ui: &mut Ui, text: &str, is_possible: bool, command: Command, effect: Effect| {
        let shown = if is_short {
            text.split(' ').next().unwrap_or(text)
        } else {
            text
        };
        let button = ui.add_enabled(is_possible, ghost_button(shown));
        button.widget_info(|| WidgetInfo::labeled(Role::Button, is_possible, text));
        if button.on_hover_text(command.about().tooltip(ui.ctx())).clicked() {
            effects.push(effect);
        }
    };
    let (text, command, effect) = match phase {
        Phase::Paused => ("▶ Resume", Command::ResumeTraining, Effect::Resume),
        _ => ("⏸ Pause", Command::PauseTraining, Effect::Pause),
    };
    // They appear before Train, which stays where it is under the pointer.
    if phase.is_busy() {
        let can_pause = matches!(phase, Phase::Training | Phase::Paused);
        button_ui(ui, text, can_pause, command, effect);
        button_ui(ui, "■ Stop", true, Command::StopTraining, Effect::Stop);
    }
    let obstacle = shared.obstacle();
    let train = ui.add_enabled(!phase.is_busy() && obstacle.is_none(), primary_button("▶ Train"));
    let hint = Command::Train.about().tooltip(ui.ctx());
    let train = train.on_hover_text(&hint);
    if train.on_disabled_hover_text(obstacle.unwrap_or(&hint)).clicked() {
        effects.push(Effect::Train);
    }
}

/// Returns the state of the training: phase, epoch, error, speed, time left, and why it stopped; before it, the progress of
/// reading a recording.
pub fn training_status(shared: &Shared) -> Status {
    let mut status = phase_in_words(shared);
    if let (Phase::Preparing, SourceKind::Recording) = (shared.phase, shared.source) {
        let preparing = shared.preparing.as_ref();
        status.progress = preparing.and_then(|preparing| Some((preparing.work, preparing.share?)));
        return status;
    }
    let running = shared.run.as_ref().filter(|_| shared.phase.is_busy());
    let Some(run) = shared.shown_run().or(running) else {
        return status;
    };
    status.notes = progress_in_words(run, shared.phase);
    if shared.phase.is_busy() {
        let epochs_run = run.result.as_ref().map_or(0, |result| result.epochs_run);
        let epochs = run.settings().training.stopping.epochs.max(1);
        status.progress = Some(("Training", epochs_run as f32 / epochs as f32));
    }
    status
}

/// Returns the phase as text.
fn phase_in_words(shared: &Shared) -> Status {
    let is_recording = shared.source == SourceKind::Recording;
    let phase = match shared.phase {
        // A result that is not shown any more is no state of what is.
        Phase::Ended(_) if shared.shown_run().is_none() => Phase::Idle,
        phase => phase,
    };
    let (tone, text) = match phase {
        Phase::Idle => (Tone::Calm, shared.obstacle().unwrap_or("Ready: press Train")),
        Phase::Preparing if is_recording => {
            let preparing = shared.preparing.as_ref().map(|preparing| preparing.text.as_str());
            (Tone::Busy, preparing.unwrap_or("Reading the recording"))
        }
        Phase::Preparing => (Tone::Busy, "Drawing samples"),
        Phase::Training => (Tone::Busy, "Training"),
        Phase::Paused => (Tone::Warning, "Paused"),
        Phase::Calibrating => (Tone::Busy, "Calibrating the 90 % intervals"),
        Phase::Ended(StopReason::Stopped) => {
            let epoch = shared
                .run
                .as_ref()
                .and_then(RunView::latest)
                .map_or(0, |latest| latest.epoch);
            return Status::new(Tone::Calm, format!("Stopped at epoch {epoch}"));
        }
        Phase::Ended(reason) if reason.was_successful() => {
            return Status::new(Tone::Good, format!("Finished: {reason}"));
        }
        Phase::Ended(reason) => return Status::new(Tone::Bad, format!("Ended: {reason}")),
    };
    Status::new(tone, text)
}

fn progress_in_words(run: &RunView, phase: Phase) -> Vec<String> {
    let Some(result) = &run.result else {
        return Vec::new();
    };
    let (epochs, epochs_run) = (run.settings().training.stopping.epochs, result.epochs_run);
    let mut parts = vec![
        format!("Epoch {epochs_run} of {epochs}"),
        match result.errors {
            TestErrors::Nodes(_) => format!("z error {}", format_percent(result.errors.percent())),
            TestErrors::Targets(_) => format!("error {} of range", format_percent(result.errors.percent())),
        },
    ];
    if let Some(time) = result.wall_time
        && epochs_run > 0
    {
        let per_epoch = time.div_f64(epochs_run as f64);
        parts.push(format!("{} per epoch", format_duration(per_epoch)));
        if phase.is_busy() {
            parts.push(format!(
                "at most {} left",
                format_duration(time_left(per_epoch, epochs.saturating_sub(epochs_run)))
            ));
        } else {
            parts.push(format!("{} in total", format_duration(time)));
        }
    }
    parts
}

fn time_left(per_epoch: Duration, epochs: usize) -> Duration {
    Duration::try_from_secs_f64(per_epoch.as_secs_f64() * epochs as f64).unwrap_or(Duration::MAX)
}

/// Returns the text with a full stop, and with a capital unless it begins with the name of a column or file.
pub fn sentence(text: &str) -> String {
    const WORDS: [&str; 12] = [
        "the", "for", "it", "no", "none", "there", "a", "all", "always", "column", "too", "twice",
    ];
    let first = text.split_whitespace().next().unwrap_or_default();
    let mut sentence = text.to_owned();
    if WORDS.contains(&first) {
        sentence = capitalised(&sentence);
    }
    if !sentence.ends_with(['.', '!', '?']) {
        sentence.push('.');
    }
    sentence
}
