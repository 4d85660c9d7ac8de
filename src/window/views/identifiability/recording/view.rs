use eframe::egui::{Key, Modifiers, RichText, Sense, Ui};

use super::{
    RecordingStudy,
    findings_card::{curve_ui, findings_ui},
    folds_card::folds_ui,
    form::progress,
};
use crate::window::{
    shared::{Offers, Shared},
    theme::{Theme, space, type_size},
    widgets::{card_ui, dim_ui, invitation_ui, placeholder_ui, scrolled_ui, state_ui},
};
use decoupler_core::text::counted;
use decoupler_files::import::Setup;

const CHANGED: &str = "The recording or the settings have changed since: analyse again.";

/// What the readings determine on the left; the learning curve and the cross-validation on the right.
pub fn body_ui(ui: &mut Ui, study: &mut RecordingStudy, shared: &Shared) {
    let whole = ui.available_rect_before_wrap();
    let ready = ready(shared);
    if study.found.is_none() && study.validated.is_none() {
        card_ui(ui, whole, |ui| empty_ui(ui, study, ready, shared));
        ui.allocate_rect(whole, Sense::hover());
        return;
    }
    let setup = shared.setup().ok();
    let (left, right) = whole.split_left_right_at_x(whole.center().x);
    let RecordingStudy {
        found,
        validated,
        target,
        ..
    } = study;
    card_ui(ui, left.with_max_x(left.max.x - space(1)), |ui| {
        scrolled_ui(ui, "findings", |ui| match found {
            Some(found) => {
                changed_ui(ui, &found.setup, setup.as_ref());
                findings_ui(ui, found);
            }
            None => placeholder_ui(ui, "Press “Analyse readings” for R², channels and learning curve."),
        });
    });
    card_ui(ui, right.with_min_x(right.min.x + space(1)), |ui| {
        scrolled_ui(ui, "study", |ui| {
            if let Some(found) = found {
                curve_ui(ui, found, target);
            }
            match validated {
                Some(validated) => {
                    changed_ui(ui, &validated.setup, setup.as_ref());
                    folds_ui(ui, validated);
                }
                None => {
                    ui.add_space(space(2));
                    dim_ui(
                        ui,
                        "“Cross-validate” tests on every sample and lists the held-out errors here.",
                    );
                }
            }
        });
    });
    ui.allocate_rect(whole, Sense::hover());
}

/// Setup that can be analysed now.
fn ready(shared: &Shared) -> Option<Setup> {
    shared.setup().ok().filter(|_| !shared.phase.is_busy())
}

fn empty_ui(ui: &mut Ui, study: &mut RecordingStudy, ready: Option<Setup>, shared: &Shared) {
    match (study.under_way, shared.setup()) {
        (Some(under_way), _) => placeholder_ui(ui, &progress(under_way, study)),
        (None, Err(obstacle)) => placeholder_ui(ui, &obstacle),
        (None, Ok(_)) => {
            let text = "How well the readings determine each target, what each channel contributes, and what more samples \
                        would bring: measured by cross-validation, with confidence intervals of 95 % from independent \
                        stretches or groups of samples.";
            if invitation_ui(ui, text, "Analyse now", ready.is_some())
                && let Some(setup) = ready
            {
                study.analyse(setup);
            }
        }
    }
}

/// Says that a result is of another recording or other settings than those chosen now.
fn changed_ui(ui: &mut Ui, of: &Setup, now: Option<&Setup>) {
    if now.is_some_and(|now| now != of) {
        dim_ui(ui, CHANGED);
    }
}

/// Offers to analyse, to cross-validate and to cancel.
pub fn offer_actions(study: &mut RecordingStudy, offers: &mut Offers<'_>, shared: &Shared) {
    let ready = ready(shared).filter(|_| !study.is_under_way());
    let is_analysed = offers.offer_keys("Analyse readings", Modifiers::COMMAND, Key::Enter, ready.is_some());
    let is_validated = offers.offer("Cross-validate", ready.is_some());
    if let Some(setup) = ready {
        if is_analysed {
            study.analyse(setup);
        } else if is_validated {
            study.cross_validate(setup);
        }
    }
    if offers.offer_keys("Cancel analysis", Modifiers::COMMAND, Key::Period, study.is_under_way()) {
        study.cancel();
    }
}

/// Shows the state of the analysis in the line at the bottom.
pub fn status_ui(ui: &mut Ui, study: &RecordingStudy, shared: &Shared) {
    let palette = Theme::of(ui).palette;
    let (colour, text) = match (study.under_way, &study.found) {
        (Some(under_way), _) => (palette.accent, progress(under_way, study)),
        (None, Some(found)) => (palette.good, format!("Analysed {}", counted(found.samples, "sample"))),
        (None, None) => (palette.dim, "Ready: press Analyse readings".to_owned()),
    };
    ui.horizontal_centered(|ui| {
        state_ui(ui, colour, &text);
        if let Ok(setup) = shared.setup() {
            let name = RichText::new(setup.source_name()).size(type_size().note);
            ui.label(name.color(palette.dim));
        }
    });
}
