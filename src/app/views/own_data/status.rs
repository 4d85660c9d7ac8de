use eframe::egui::{RichText, Ui};

use super::state::OwnDataView;
use crate::{
    app::{
        shared::{Phase, phase_in_words},
        theme::{Theme, type_size},
        widgets::{state_ui, status_progress_ui},
    },
    export::{format_duration, format_number},
    import::Progress,
};

/// Shows how files and training stand in the line at the bottom.
pub(super) fn status_ui(ui: &mut Ui, view: &OwnDataView) {
    let palette = Theme::of(ui).palette;
    ui.horizontal_centered(|ui| {
        if let Some((name, progress)) = &view.opening.under_way {
            state_ui(ui, palette.accent, &format!("Reading {name}"));
            reading_ui(ui, *progress);
            return;
        }
        let preparing = if view.is_validating {
            "Cross-validating"
        } else {
            "Reading the files"
        };
        let (colour, text) = phase_in_words(view.phase, preparing, &palette);
        let text = match (&view.draft, view.phase) {
            (None, Phase::Idle) => "Ready: drop recordings on the window".to_owned(),
            _ => text,
        };
        state_ui(ui, colour, &text);
        if view.phase == Phase::Preparing {
            reading_ui(ui, view.reading);
            return;
        }
        let Some(shown) = &view.shown else { return };
        let epochs = shown.file.settings.training.stopping.epochs;
        let mut parts = vec![format!("Epoch {} of {epochs}", shown.epochs_run)];
        if let Some(latest) = shown.file.training.history.last() {
            parts.push(format!("mse {}", format_number(latest.training_mse)));
        }
        if let Some(time) = shown.wall_time {
            parts.push(format!("{} in total", format_duration(time)));
        }
        for part in parts {
            ui.label(RichText::new(part).size(type_size().note).color(palette.dim));
        }
        if view.phase.is_busy() {
            status_progress_ui(ui, "Training", shown.epochs_run as f32 / epochs.max(1) as f32);
        }
    });
}

/// Progress of reading a file.
fn reading_ui(ui: &mut Ui, progress: Option<Progress>) {
    let Some(Progress { bytes, of: Some(of) }) = progress else {
        return;
    };
    status_progress_ui(ui, "Reading", bytes as f32 / of.max(1) as f32);
}
