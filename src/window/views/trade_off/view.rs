//! The body, the form and the exports of the Trade-off view.

use std::{sync::atomic::Ordering, time::Instant};

use decoupler_core::{
    dataset::LARGEST_SAMPLES,
    decoupling::{DecoderKind, Precision},
    evaluation::Preset,
    text::counted,
    training::{Method, StoppingRules},
};
use decoupler_files::{
    export::{format_duration, trade_off_points, trade_off_summary},
    figure::{Figure, trade_off_figure},
};
use eframe::egui::{Align, ComboBox, Key, Layout, RichText, Sense, TextEdit, Ui, vec2};

use super::{
    PointWish, Thoroughness, TradeOffEnding, TradeOffForm, TradeOffLook, TradeOffOutcome, TradeOffView, WhichPresets,
    chart::{charts_ui, noise_name, table_ui},
    form::choices_ui,
    state::TradeOffEvent,
};
use crate::window::{
    shared::{
        Command, Effect, Holdings, Matter, Notice, Offers, Shared, Shown, SourceKind, Status, Tone, Unfinished, View,
        sentence,
    },
    theme::{semibold, space, type_size},
    widgets::{
        card_ui, dim_ui, fields::count_ui, ghost_button, invitation_ui, note_ui, placeholder_ui, primary_button,
        progress_bar_ui, scrolled_ui, section_heading_ui, segmented_ui, with_shortcut,
    },
};

impl View for TradeOffView {
    fn take_events(&mut self, _shared: &Shared, effects: &mut Vec<Effect>) {
        while let Some(event) = self.job.next_event() {
            match event {
                TradeOffEvent::Samples { decoded, recorded } => {
                    if let Some(outcome) = &mut self.outcome {
                        (outcome.decoded, outcome.recorded) = (Some(decoded), recorded);
                    }
                }
                TradeOffEvent::Measured(level, point, file) => self.record(level, *point, file),
                TradeOffEvent::Refused(level, reason) => {
                    if let Some(outcome) = &mut self.outcome {
                        outcome.refused.push((level, reason));
                    }
                }
                TradeOffEvent::Ended(result) => {
                    self.end(Instant::now());
                    effects.extend(
                        result
                            .err()
                            .map(|reason| Effect::Notify(Matter::TradeOff, Notice::Failed(reason))),
                    );
                }
            }
        }
    }

    fn holdings(&self, _shared: &Shared) -> Holdings {
        let unfinished = self.outcome.iter().filter_map(|outcome| {
            let (done, all) = outcome.points();
            let progress = format!("{done} of {} measured", counted(all, "point"));
            let is_unsaved =
                outcome.ending == Some(TradeOffEnding::Complete) && !outcome.is_saved.load(Ordering::Relaxed);
            if self.running.is_some() {
                Some(Unfinished::new("Measurement", progress))
            } else {
                let progress = format!("{progress}, not exported as a table");
                is_unsaved.then(|| Unfinished::new("Measurement", progress))
            }
        });
        Holdings {
            is_computing: self.running.is_some(),
            unfinished: unfinished.collect(),
            files: Vec::new(),
        }
    }

    fn take_commands(&mut self, offers: &mut Offers<'_>, shared: &Shared, effects: &mut Vec<Effect>) {
        if offers.offer(Command::Begin("Measure trade-off"), self.can_measure(shared)) {
            self.measure(shared, effects);
        }
        if offers.offer(Command::Cancel("Cancel measuring"), self.running.is_some()) {
            self.cancel();
        }
    }

    fn shown<'a>(&'a self, _shared: &'a Shared) -> Vec<Shown<'a>> {
        shown(self)
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        form_ui(ui, self, shared, effects);
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        trade_ui(ui, self, shared, effects);
        Some(status(self))
    }
}

/// Shows both charts above, the table and the recommended decoders below.
fn trade_ui(ui: &mut Ui, trade: &mut TradeOffView, shared: &Shared, effects: &mut Vec<Effect>) {
    let can_load = !shared.phase.is_busy();
    let whole = ui.available_rect_before_wrap();
    let (Some(outcome), Some(level)) = (&trade.outcome, trade.shown()) else {
        let text = match (shared.source, shared.setup()) {
            (SourceKind::Array, _) => {
                "The error, the time for a frame and the training time of every decoder at several noise levels, measured \
                 on this machine."
                    .to_owned()
            }
            (SourceKind::Recording, Ok(_)) => {
                "The error, the decoding time and the training time of every decoder on the test samples of the recording, \
                 measured on this machine."
                    .to_owned()
            }
            (SourceKind::Recording, Err(obstacle)) => obstacle,
        };
        let mut is_wanted = false;
        card_ui(ui, whole, |ui| {
            is_wanted = invitation_ui(ui, &text, "Measure now", trade.can_measure(shared));
        });
        if is_wanted {
            trade.measure(shared, effects);
        }
        return;
    };
    let mut look = trade.look;
    let mut asked = None;
    let source = |point| outcome.source_of(trade.look.level, point);
    let gap = space(2);
    let lower_height = (0.38 * whole.height()).clamp(space(50), space(85));
    let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
    card_ui(ui, upper.with_max_y(upper.max.y - gap), |ui| {
        head_ui(ui, outcome, &mut look);
        if level.points.is_empty() {
            placeholder_ui(ui, waiting(trade.running.is_some()));
            return;
        }
        let figure = trade_off_figure(level, &look.limits);
        asked = charts_ui(ui, level, &figure, &mut look.marked, can_load);
    });
    let choices_width = (0.4 * lower.width()).clamp(space(76), space(105));
    let (left, right) = lower.split_left_right_at_x(lower.right() - choices_width);
    card_ui(ui, left.with_max_x(left.max.x - gap), |ui| {
        let mut refused = outcome.refused.iter().filter(|(of, _)| *of == look.level).peekable();
        if refused.peek().is_some() {
            let reasons = Vec::from_iter(refused.map(|(_, reason)| sentence(reason)));
            note_ui(ui, &reasons.join("\n"));
        }
        table_ui(ui, level, &mut look.marked);
    });
    card_ui(ui, right, |ui| {
        scrolled_ui(ui, "trade choices", |ui| {
            asked = asked.take().or(choices_ui(ui, level, &mut look, can_load, source));
        });
    });
    ui.allocate_rect(whole, Sense::hover());
    let level = trade.look.level;
    match asked {
        Some(PointWish::Load(point)) => {
            if let Some(setup) = outcome.setup_of(level, point) {
                effects.extend([Effect::TakeSetup(Box::new(setup)), Effect::ShowTraining]);
            }
        }
        Some(PointWish::Export(exporting)) => effects.push(Effect::Export(exporting)),
        None => {}
    }
    trade.look = look;
}

fn head_ui(ui: &mut Ui, outcome: &TradeOffOutcome, look: &mut TradeOffLook) {
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        ui.label(RichText::new("Speed against accuracy").font(semibold(type_size().title)));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            level_ui(ui, outcome, look);
        });
    });
}

/// Shows the choice of the noise level: buttons for a few levels, a list for many. A recording has only one level,
/// without a name.
fn level_ui(ui: &mut Ui, outcome: &TradeOffOutcome, look: &mut TradeOffLook) {
    let noises = outcome.levels.iter().filter_map(|level| level.noise);
    let names: Vec<String> = noises.map(noise_name).collect();
    if names.is_empty() {
        return;
    }
    let picked = if names.len() <= 5 {
        let options: Vec<_> = names
            .iter()
            .enumerate()
            .map(|(level, name)| (level, name.as_str()))
            .collect();
        segmented_ui(ui, "Displayed noise level", &options, look.level, false)
    } else {
        let mut picked = None;
        let combo = ComboBox::from_id_salt("noise level").selected_text(&names[look.level]);
        combo.show_ui(ui, |ui| {
            for (level, name) in names.iter().enumerate() {
                if ui.selectable_label(level == look.level, name).clicked() {
                    picked = Some(level);
                }
            }
        });
        picked
    };
    if let Some(level) = picked {
        (look.level, look.marked) = (level, None);
    }
    dim_ui(ui, "Noise");
}

/// Returns the hint shown while a noise level has no points.
fn waiting(is_running: bool) -> &'static str {
    if is_running {
        "The points appear here as they are measured."
    } else {
        "The measurement ended before the first point."
    }
}

/// Returns true for a simulated array.
fn has_noise(outcome: &TradeOffOutcome) -> bool {
    outcome.levels.iter().any(|level| level.noise.is_some())
}

/// Shows the state of the measurement in the line at the bottom.
fn status(trade: &TradeOffView) -> Status {
    let (tone, text) = match (&trade.running, &trade.outcome) {
        (Some(_), Some(outcome)) => {
            let (done, all) = outcome.points();
            (Tone::Busy, format!("Measuring: {done} of {all} points"))
        }
        (_, Some(outcome)) => {
            let (done, all) = outcome.points();
            let took = outcome
                .took
                .map_or_else(String::new, |took| format!(" in {}", format_duration(took)));
            match outcome.ending {
                Some(TradeOffEnding::Complete) => (Tone::Good, format!("Measured {all} points{took}")),
                _ => (Tone::Warning, format!("Ended early: {done} of {all} points{took}")),
            }
        }
        (_, None) => (Tone::Calm, "Ready: press Measure".to_owned()),
    };
    let status = Status::new(tone, text);
    match &trade.outcome {
        Some(outcome) => {
            let unit = outcome.decoded.as_deref().filter(|_| !has_noise(outcome));
            let unit = unit.map_or_else(String::new, |unit| format!(", times of {unit}"));
            status.with_note(format!(
                "{}, one thread, median of many{unit}",
                outcome.plan.source_name()
            ))
        }
        None => status,
    }
}

/// Returns what the view shows: charts and table at the displayed noise level, and every point.
pub(super) fn shown(view: &TradeOffView) -> Vec<Shown<'_>> {
    let stem = || "trade_off".to_owned();
    let outcome = view.outcome.as_ref().filter(|outcome| outcome.points().0 > 0);
    let outcome = outcome.ok_or_else(|| "No point is measured yet: press Measure first.".to_owned());
    let level = outcome.clone().and_then(|outcome| {
        let level = outcome
            .levels
            .get(view.look.level)
            .filter(|level| !level.points.is_empty());
        level.ok_or_else(|| "No point is measured here yet.".to_owned())
    });
    let charts = level
        .clone()
        .map(|level| move || Figure::from(trade_off_figure(level, &view.look.limits)));
    let points = outcome.clone().map(|outcome| || trade_off_points(&outcome.levels));
    let table = level.map(|level| move || trade_off_summary(level));
    let shown = [
        Shown::figure("Charts", stem(), charts),
        Shown::table("All points", stem(), points),
        Shown::table("Trade-off table", stem(), table),
    ];
    match outcome {
        Ok(outcome) => shown.map(|shown| shown.noting(&outcome.is_saved)).into(),
        Err(_) => shown.into(),
    }
}

/// Shows the form: lists, presets, decoders, Measure and Cancel.
pub fn form_ui(ui: &mut Ui, trade: &mut TradeOffView, shared: &Shared, effects: &mut Vec<Effect>) {
    scrolled_ui(ui, "trade form", |ui| {
        section_heading_ui(ui, "Measurement");
        if let Ok(setup) = shared.setup() {
            let of = match shared.source {
                SourceKind::Array => "in the scene of the Train view",
                SourceKind::Recording => "with its split and settings of the Train view",
            };
            dim_ui(
                ui,
                &format!("{} {of}, seed {}.", setup.source_name(), setup.settings().seed),
            );
        }
        let source = shared.source;
        ui.add_enabled_ui(trade.running.is_none(), |ui| fields_ui(ui, &mut trade.form, source));
        ui.add_space(space(1));
        match trade.plan(shared) {
            Ok(plan) => {
                dim_ui(ui, &format!("{} points", plan.points()));
            }
            Err(problem) => {
                note_ui(ui, &problem);
            }
        }
        buttons_ui(ui, trade, shared, effects);
        progress_ui(ui, trade, shared);
        ui.add_space(space(4));
    });
}

fn fields_ui(ui: &mut Ui, form: &mut TradeOffForm, source: SourceKind) {
    if source == SourceKind::Array {
        let hint = "Noise of each reading (standard deviation), relative to the reading. Separate several levels with \
                    commas.";
        list_ui(ui, "Noise levels", hint, &mut form.noises);
    }
    let hint = "Numbers of hidden nodes of the networks, separated by commas.";
    list_ui(ui, "Hidden nodes", hint, &mut form.hidden);
    match source {
        SourceKind::Array => {
            section_heading_ui(ui, "Presets");
            let presets = [
                (WhichPresets::Both, "Both"),
                (WhichPresets::Only(Preset::Paper), "Paper"),
                (WhichPresets::Only(Preset::Best), "Best"),
            ];
            form.presets = segmented_ui(ui, "Presets", &presets, form.presets, true).unwrap_or(form.presets);
        }
        SourceKind::Recording => {
            section_heading_ui(ui, "Training methods");
            for (method, is_chosen) in Method::all().iter().zip(&mut form.methods) {
                ui.checkbox(is_chosen, method.name()).on_hover_text(method.summary());
            }
        }
    }
    section_heading_ui(ui, "Decoders");
    for (kind, is_chosen) in DecoderKind::ALL.into_iter().zip(&mut form.decoders) {
        if source == SourceKind::Array || !kind.needs_sensor() {
            ui.checkbox(is_chosen, kind.name(Precision::Double))
                .on_hover_text(kind.meaning());
        }
    }
    section_heading_ui(ui, "Training");
    training_ui(ui, form, source);
}

fn training_ui(ui: &mut Ui, form: &mut TradeOffForm, source: SourceKind) {
    let full = match source {
        SourceKind::Array => "Full presets",
        SourceKind::Recording => "As in Train view",
    };
    let options = [(Thoroughness::Quick, "Quick look"), (Thoroughness::Full, full)];
    let picked = segmented_ui(ui, "Training length", &options, form.thoroughness, true);
    form.thoroughness = picked.unwrap_or(form.thoroughness);
    match form.thoroughness {
        Thoroughness::Quick => {
            if source == SourceKind::Array {
                let hint = "Largest number of training samples per network; a preset with fewer keeps its own number.";
                count_ui(ui, "Maximum samples", hint, &mut form.samples, 1..=LARGEST_SAMPLES);
            }
            let hint = "Largest number of epochs per training.";
            let epochs = 1..=StoppingRules::MAX_EPOCHS;
            count_ui(ui, "Maximum epochs", hint, &mut form.epochs, epochs);
        }
        Thoroughness::Full => {
            let text = match source {
                SourceKind::Array => "Samples and epochs as in the presets: the best networks, at some minutes each.",
                SourceKind::Recording => "As many epochs as in the Train view.",
            };
            dim_ui(ui, text);
        }
    }
    if source == SourceKind::Array {
        let hint = "Number of samples on which the errors are measured.";
        count_ui(ui, "Test samples", hint, &mut form.test_samples, 1..=LARGEST_SAMPLES);
    }
}

fn list_ui(ui: &mut Ui, name: &str, hint: &str, text: &mut String) {
    let label = ui.label(name).on_hover_text(hint);
    let edit = TextEdit::singleline(text)
        .desired_width(f32::INFINITY)
        .margin(vec2(space(2), space(1)));
    ui.add(edit).labelled_by(label.id).on_hover_text(hint);
}

fn buttons_ui(ui: &mut Ui, trade: &mut TradeOffView, shared: &Shared, effects: &mut Vec<Effect>) {
    let half = ((ui.available_width() - space(2)) / 2.0).floor();
    ui.horizontal(|ui| {
        let size = vec2(half, space(7));
        let measure = primary_button("▶ Measure").min_size(size);
        let measure = ui.add_enabled(trade.can_measure(shared), measure);
        let why_not = if !trade.is_quiet(shared) {
            "A training, an experiment or live decoding is running and would distort the times"
        } else if trade.running.is_some() {
            "A measurement is already running"
        } else {
            "The settings are not valid: the note above says what to change"
        };
        if measure
            .on_hover_text(with_shortcut(
                ui,
                "Trains, fits and times every decoder in the background",
                Key::Enter,
            ))
            .on_disabled_hover_text(why_not)
            .clicked()
        {
            trade.measure(shared, effects);
        }
        let cancel = ghost_button("■ Cancel").min_size(size);
        let cancel = ui.add_enabled(trade.running.is_some(), cancel);
        if cancel
            .on_hover_text(with_shortcut(
                ui,
                "Ends the measurement; the points measured so far are kept",
                Key::Period,
            ))
            .clicked()
        {
            trade.cancel();
        }
    });
}

fn progress_ui(ui: &mut Ui, trade: &TradeOffView, shared: &Shared) {
    let (Some(_), Some(outcome)) = (&trade.running, &trade.outcome) else {
        return;
    };
    ui.add_space(space(1));
    let (done, all) = outcome.points();
    let level = outcome.levels.iter().rposition(|level| !level.points.is_empty());
    let noise = outcome.levels.get(level.unwrap_or(0)).and_then(|level| level.noise);
    let noise = noise.map_or_else(String::new, |noise| format!(", at noise {}", noise_name(noise)));
    let text = format!("{done} of {all} points{noise}");
    progress_bar_ui(ui, "Measurement", done as f32 / all.max(1) as f32, &text);
    if !trade.is_quiet(shared) {
        note_ui(
            ui,
            "A training, an experiment or live decoding is running and makes these times longer.",
        );
    }
}
