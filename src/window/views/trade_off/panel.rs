use eframe::egui::{Key, TextEdit, Ui, vec2};

use super::{Thoroughness, TradeOffForm, TradeOffView, WhichPresets, chart::noise_name};
use crate::window::{
    shared::{Effect, Shared, SourceKind},
    theme::space,
    widgets::{
        dim_ui, fields::count_ui, ghost_button, note_ui, primary_button, progress_bar_ui, scrolled_ui,
        section_heading_ui, segmented_ui, with_shortcut,
    },
};
use decoupler_core::{
    dataset::LARGEST_SAMPLES,
    decoupling::{DecoderKind, Precision},
    evaluation::Preset,
    training::{Method, StoppingRules},
};

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
                ui.checkbox(is_chosen, method.name())
                    .on_hover_text(method.description());
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
