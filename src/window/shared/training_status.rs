use std::time::Duration;

use decoupler_core::{evaluation::TestErrors, training::StopReason};
use decoupler_files::{
    export::{format_duration, format_number, format_percent},
    import::Progress,
};
use eframe::egui::{Color32, RichText, Ui};

use super::{Phase, RunView, Shared, SourceKind};
use crate::window::{
    theme::{Palette, Theme, type_size},
    widgets::{fields::capitalised, state_ui, status_progress_ui},
};

/// Shows the state of the training: phase, epoch, error, speed, time left, and why it stopped; before it how much of a
/// recording is read.
pub fn training_status_ui(ui: &mut Ui, shared: &Shared) {
    let palette = Theme::of(ui).palette;
    ui.horizontal_centered(|ui| {
        let (colour, text) = phase_in_words(shared, &palette);
        state_ui(ui, colour, &text);
        if let (Phase::Preparing, SourceKind::Recording) = (shared.phase, shared.source) {
            if let Some(Progress { bytes, of: Some(of) }) = shared.reading {
                status_progress_ui(ui, "Reading", bytes as f32 / of.max(1) as f32);
            }
            return;
        }
        let Some(run) = shared
            .shown_run()
            .or(shared.run.as_ref().filter(|_| shared.phase.is_busy()))
        else {
            return;
        };
        for part in progress_in_words(run, shared.phase) {
            ui.label(RichText::new(part).size(type_size().note).color(palette.dim));
        }
        if shared.phase.is_busy() {
            let epochs_run = run.result.as_ref().map_or(0, |result| result.epochs_run);
            let epochs = run.settings().training.stopping.epochs.max(1);
            status_progress_ui(ui, "Training", epochs_run as f32 / epochs as f32);
        }
    });
}

/// Colour and words of the phase.
fn phase_in_words(shared: &Shared, palette: &Palette) -> (Color32, String) {
    let is_recording = shared.source == SourceKind::Recording;
    match shared.phase {
        Phase::Idle if is_recording && shared.recording.plan.is_err() => {
            (palette.dim, "Ready: open a recording".to_owned())
        }
        Phase::Idle => (palette.dim, "Ready: press Train".to_owned()),
        Phase::Preparing if is_recording => (palette.accent, "Reading the recording".to_owned()),
        Phase::Preparing => (palette.accent, "Drawing samples".to_owned()),
        Phase::Training => (palette.accent, "Training".to_owned()),
        Phase::Paused => (palette.warning, "Paused".to_owned()),
        Phase::Ended(StopReason::Stopped) => (palette.dim, format!("Ended: {}", StopReason::Stopped)),
        Phase::Ended(reason) if reason.was_successful() => (palette.good, format!("Finished: {reason}")),
        Phase::Ended(reason) => (palette.bad, format!("Ended: {reason}")),
        Phase::Died => (palette.bad, "The training thread ended unexpectedly".to_owned()),
    }
}

fn progress_in_words(run: &RunView, phase: Phase) -> Vec<String> {
    let (Some(latest), Some(result)) = (run.latest(), &run.result) else {
        return Vec::new();
    };
    let (epochs, epochs_run) = (run.settings().training.stopping.epochs, result.epochs_run);
    let mut parts = vec![
        format!("Epoch {epochs_run} of {epochs}"),
        match result.errors {
            TestErrors::Nodes(_) => format!("z error {}", format_percent(result.errors.percent())),
            TestErrors::Targets(_) => format!("error {} of range", format_percent(result.errors.percent())),
        },
        format!("mse {}", format_number(latest.training_mse)),
        format!(
            "{} {}",
            run.settings().training.method.parameter_name(),
            format_number(latest.parameter)
        ),
    ];
    if run.settings().starts > 1 && phase.is_busy() {
        parts.push(format!(
            "{} of {} starts ended",
            result.starts_ended,
            run.settings().starts
        ));
    }
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
    const WORDS: [&str; 11] = [
        "the", "for", "no", "none", "there", "a", "all", "always", "column", "too", "twice",
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
