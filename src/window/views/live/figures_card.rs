use eframe::egui::{RichText, Ui};

use super::{LiveView, engine::LiveFrame, tools::save_recording};
use crate::window::{
    glossary,
    shared::{Effect, Shared},
    theme::{Theme, space, type_size},
    widgets::{coloured_fact_ui, dim_ui, fact_ui, fields::capitalised, ghost_button, note_ui, section_heading_ui},
};
use decoupler_core::{
    live::{FaultEvent, FaultyWire, ZeroGains},
    text::counted,
};
use decoupler_files::{
    export::{format_duration, format_number, format_percent},
    live::{Recorded, Watched},
};

/// Shows confidence, faults, the stream, the unloaded state and the recording.
pub fn figures_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let Some(frame) = view.shown.frame.clone() else { return };
    warnings_ui(ui, &frame);
    section_heading_ui(ui, "Confidence");
    confidence_ui(ui, view, &frame, shared);
    section_heading_ui(ui, "Stream");
    stream_ui(ui, view);
    section_heading_ui(ui, "Zero");
    zero_ui(ui, view);
    section_heading_ui(ui, "Recording");
    recording_ui(ui, view, shared, effects);
    ui.add_space(space(2));
}

/// Shows warnings, above everything else.
fn warnings_ui(ui: &mut Ui, frame: &LiveFrame) {
    match &frame.watched {
        Watched::Checked(event @ FaultEvent::Named { wire, .. }) => {
            let its = match wire {
                FaultyWire::Row(_) | FaultyWire::Column(_) => "Its readings are left out",
                FaultyWire::Columns(_) => "Their readings are left out",
            };
            let text = capitalised(&event.to_string());
            note_ui(
                ui,
                &format!("{text}. {its}, and the others decoded by Gauss-Newton steps on Eq. (2)."),
            );
        }
        Watched::Checked(FaultEvent::Unexplained) => {
            note_ui(
                ui,
                "The readings contradict Eq. (2), and no fault of a single wire explains them: the answers may be wrong. \
                 Check the wiring, the geometry, the order of the rows, and the relative noise on the left.",
            );
        }
        Watched::NoNoise | Watched::TooLarge | Watched::Checked(FaultEvent::Recovered) => {}
    }
}

/// Shows rate, latency and losses of the stream.
pub fn stream_ui(ui: &mut Ui, view: &LiveView) {
    let counts = &view.shown.counts;
    let rate = if counts.is_waiting {
        "waiting".to_owned()
    } else {
        format!("{:.0} frames per second", counts.frames_per_second)
    };
    fact_ui(ui, "Rate", "Frames per second (recent).", &rate);
    let latency = match [0.5, 0.99].map(|share| counts.latencies.quantile(share)) {
        [Some(median), Some(high)] => format!("p50 {}, p99 {}", format_duration(median), format_duration(high)),
        _ => format_number(None),
    };
    let hint = "Time from reading a frame to its answer: median, and the 99th percentile, which one frame in a hundred \
                exceeds.";
    fact_ui(ui, "Latency", hint, &latency);
    fact_ui(
        ui,
        "Decoded",
        "Frames decoded since the start.",
        &counts.decoded.to_string(),
    );
    let hint = "Frames (lines of a device) that were replaced by newer ones before they could be decoded.";
    fact_ui(ui, "Dropped", hint, &counts.dropped.to_string());
    let hint = "Malformed lines, and frames that could not be decoded.";
    fact_ui(ui, "Bad", hint, &counts.bad.to_string());
    if let Some(reason) = &counts.last_bad {
        dim_ui(ui, &format!("Last: {reason}"));
    }
}

fn confidence_ui(ui: &mut Ui, view: &LiveView, frame: &LiveFrame, shared: &Shared) {
    let noise = view.network.network(&shared.runs);
    let noise = noise.and_then(|(_, file)| Some(view.source.noise(file.problem.sensor.as_ref()?)));
    let mut residual = format_percent(100.0 * frame.residual);
    if let Some(noise) = noise.filter(|noise| *noise > 0.0 && frame.residual.is_finite()) {
        residual += &format!(" ({} × noise)", format_number(frame.residual / noise));
    }
    let hint = format!(
        "{}\n\nIt is as small as the noise of a reading if the answer explains the readings.",
        glossary::RESIDUAL.hint
    );
    fact_ui(ui, "Residual of Eq. (2)", &hint, &residual);
    let hint = "Readings beyond the range seen in training by more than a tenth of it, and coordinates beyond by more \
                than all of it. There the network extrapolates: check these readings, or train with a scene that covers \
                them, for the simulated source with an indenter as the loading.";
    outside_ui(ui, view.shown.outside, frame.drops_percent.len(), "coordinate", hint);
    let hint = glossary::WIRE_FAULT.hint;
    match &frame.watched {
        Watched::NoNoise => {
            let reason = "without noise, deviations cannot be judged; give the noise of a reading";
            dim_ui(ui, &format!("Faults of wires are not looked for: {reason}."));
        }
        Watched::TooLarge => {
            let reason = "the array is too large to check every frame";
            dim_ui(ui, &format!("Faults of wires are not looked for: {reason}."));
        }
        Watched::Checked(FaultEvent::Recovered) => fact_ui(ui, "Fault", hint, "none"),
        Watched::Checked(FaultEvent::Unexplained) => fact_ui(ui, "Fault", hint, "not a single-wire fault"),
        Watched::Checked(FaultEvent::Named { wire, .. }) => fact_ui(ui, "Fault", hint, &wire.to_string()),
    }
    if frame.actual.is_none() {
        return;
    }
    let in_mm = |mm: Option<f64>| match mm {
        Some(mm) => format!("{} mm", format_number(mm)),
        None => format_number(None),
    };
    let hint = "Mean |error| of z over all nodes, compared with the simulated truth, over the latest frames.";
    fact_ui(ui, "Error", hint, &in_mm(view.shown.counts.error_mm));
}

/// Shows how many of `of` readings, and of the targets, are outside the range seen in training.
pub fn outside_ui(ui: &mut Ui, outside: (Option<usize>, usize), of: usize, target: &str, hint: &str) {
    let (readings, targets) = outside;
    let value = match readings {
        None => "readings not known".to_owned(),
        Some(0) if targets == 0 => "none".to_owned(),
        Some(readings) => format!("{} of {of}", counted(readings, "reading")),
    };
    let value = match targets {
        0 => value,
        number => format!("{value}, {}", counted(number, target)),
    };
    let palette = Theme::of(ui).palette;
    let is_outside = readings.unwrap_or(0) + targets > 0;
    let colour = if is_outside { palette.warning } else { palette.text };
    coloured_fact_ui(ui, "Outside training", hint, &value, colour);
}

fn zero_ui(ui: &mut Ui, view: &mut LiveView) {
    if let Some(problem) = &view.zero_problem {
        note_ui(ui, &format!("Not re-zeroed: {problem}."));
    }
    let Some(zero) = view.zero.clone() else {
        dim_ui(
            ui,
            "Readings are compared with the model at rest. Re-zero uses the current state of the array instead.",
        );
        return;
    };
    let hint = "Smallest and largest gain: reading in the unloaded state over the resistance of the model at rest.";
    fact_ui(ui, "Gains", hint, &format_gains(&zero));
    let hint =
        "Rows in contact during the re-zero: only the gains of their columns were taken, so that the contact is kept.";
    let touched = zero.in_contact.iter().filter(|touched| **touched).count();
    fact_ui(
        ui,
        "Rows in contact",
        hint,
        &format!("{touched} of {}", zero.in_contact.len()),
    );
    let clear = ui.add(ghost_button("Clear zero"));
    if clear
        .on_hover_text("Compares readings with the model at rest again.")
        .clicked()
    {
        view.clear_zero();
    }
}

fn format_gains(zero: &ZeroGains) -> String {
    let (low, high) = (zero.gains.iter()).fold((f64::MAX, f64::MIN), |(low, high), &gain| {
        (low.min(gain), high.max(gain))
    });
    format!("{low:.4} to {high:.4}")
}

fn recording_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    if let Some(recorded) = view.shown.recording.as_ref().filter(|_| view.recording.is_some()) {
        let palette = Theme::of(ui).palette;
        let text = format!("● {}, {:.1} s", counted(recorded.frames, "frame"), recorded.seconds);
        ui.label(RichText::new(text).size(type_size().note).color(palette.bad));
        return;
    }
    let Some(recorded) = view.recorded.clone() else {
        dim_ui(
            ui,
            "Record keeps every frame with its time, to be replayed with any network.",
        );
        return;
    };
    let Recorded { path, frames, seconds } = &recorded;
    dim_ui(ui, &format!("Recorded {}, {seconds:.1} s.", counted(*frames, "frame")))
        .on_hover_text(path.display().to_string());
    ui.horizontal(|ui| {
        let replay = ui.add_enabled(*frames > 0, ghost_button("Replay recording"));
        if replay
            .on_hover_text("Replays it with the network on the left.")
            .clicked()
        {
            view.replay_recorded(shared, effects);
        }
        let task = save_recording(&recorded);
        let save = ui.add(ghost_button("Save recording…"));
        if save.on_hover_text(task.words.description).clicked() {
            effects.push(Effect::ChooseFile(task));
        }
    });
}
