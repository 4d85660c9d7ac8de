use std::time::Duration;

use eframe::egui::{Align, Color32, Layout, RichText, Sense, Ui, Vec2};

use super::{Phase, RunView, Shared};
use crate::{
    app::{
        theme::{Palette, Theme, space, type_size},
        widgets::state_ui,
    },
    export::{format_duration, format_number, format_percent},
    training::StopReason,
};

/// Shows the state of the training: phase, epoch, error, speed, time left, and why it stopped.
pub fn training_status_ui(ui: &mut Ui, shared: &Shared) {
    let palette = Theme::of(ui).palette;
    ui.horizontal_centered(|ui| {
        let (colour, text) = phase_in_words(shared.phase, "Drawing samples", &palette);
        state_ui(ui, colour, &text);
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
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| progress_bar_ui(ui, run));
        }
    });
}

/// Colour and words of a phase; `preparing` are those of the work before a training.
pub fn phase_in_words(phase: Phase, preparing: &str, palette: &Palette) -> (Color32, String) {
    match phase {
        Phase::Idle => (palette.dim, "Ready: press Train".to_owned()),
        Phase::Preparing => (palette.accent, preparing.to_owned()),
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
        format!("z error {}", format_percent(result.errors.percent())),
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
        parts.push(format!("{} an epoch", format_duration(per_epoch)));
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

fn progress_bar_ui(ui: &mut Ui, run: &RunView) {
    let palette = Theme::of(ui).palette;
    let share = run.result.as_ref().map_or(0.0, |result| {
        result.epochs_run as f32 / run.settings().training.stopping.epochs as f32
    });
    let (rect, response) = ui.allocate_exact_size(Vec2::new(space(40), space(1)), Sense::hover());
    let radius = 0.5 * space(1);
    ui.painter().rect_filled(rect, radius, palette.line);
    let done = rect.with_max_x(rect.left() + share.clamp(0.0, 1.0) * rect.width());
    ui.painter().rect_filled(done, radius, palette.accent);
    response.widget_info(|| {
        let label = format!("Progress {:.0} %", 100.0 * share);
        eframe::egui::WidgetInfo::labeled(eframe::egui::accesskit::Role::ProgressIndicator, true, label)
    });
}
