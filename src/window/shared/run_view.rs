use std::time::Duration;

use decoupler_core::{evaluation::TestErrors, text::capitalised, training::StopReason};
use decoupler_files::export::{format_duration, format_percent};
use eframe::egui::Ui;

use super::{Command, Effect, Phase, RunView, Shared, SourceKind, Status, Tone, command_button_ui};
use crate::window::widgets::{ghost_button, primary_button};

/// The buttons that run a training.
pub fn run_buttons_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
    // In a narrow window the buttons show only their symbols.
    let is_short = ui.ctx().content_rect().width() < 1100.0;
    let longer = Command::TrainLonger;
    if shared.obstacle(&longer).is_none() {
        let button = ghost_button(longer.about().name);
        command_button_ui(ui, shared, longer, button, None, effects);
    }
    // They appear before Train, which stays where it is under the pointer.
    if shared.obstacle(&Command::StopTraining).is_none() {
        let is_paused = shared.phase == Phase::Paused;
        let pause = if is_paused { "▶ Resume" } else { "⏸ Pause" };
        for (command, text) in [(Command::PauseTraining, pause), (Command::StopTraining, "■ Stop")] {
            let shown = text.split(' ').next().filter(|_| is_short).unwrap_or(text);
            command_button_ui(ui, shared, command, ghost_button(shown), Some(text), effects);
        }
    }
    command_button_ui(ui, shared, Command::Train, primary_button("▶ Train"), None, effects);
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
        Phase::Idle => (Tone::Calm, shared.missing_recording().unwrap_or("Ready: press Train")),
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
