//! The form, and the results of the study of a recording.

use decoupler_core::text::counted;
use decoupler_files::{
    export::{describe_target, error_table, format_below_one, format_duration},
    import::Setup,
};
use eframe::egui::{Key, RichText, Sense, Ui};

use super::{
    RecordingStudy,
    study::{FoldsResult, RecordingFindings, UnderWay},
};
use crate::window::{
    shared::{Command, Offers, Shared, Shown, Status, Tone, error_table_ui, sentence},
    theme::{space, type_size},
    widgets::{
        card_ui, dim_ui, fields::count_ui, ghost_button, invitation_ui, note_ui, placeholder_ui, primary_button,
        scrolled_ui, section_heading_ui, with_shortcut,
    },
};

const CHANGED: &str = "The recording or the settings have changed since: analyse again.";

/// Shows what the readings determine on the left, and the cross-validation on the right.
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
    let RecordingStudy { found, validated, .. } = study;
    card_ui(ui, left.with_max_x(left.max.x - space(1)), |ui| {
        scrolled_ui(ui, "findings", |ui| match found {
            Some(found) => {
                changed_ui(ui, &found.setup, setup.as_ref());
                findings_ui(ui, found);
            }
            None => placeholder_ui(ui, "Press “Analyse readings” for R² and channels without information."),
        });
    });
    card_ui(ui, right.with_min_x(right.min.x + space(1)), |ui| {
        scrolled_ui(ui, "study", |ui| match validated {
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
        });
    });
    ui.allocate_rect(whole, Sense::hover());
}

/// Returns the setup, if it can be analysed now.
fn ready(shared: &Shared) -> Option<Setup> {
    shared.setup().ok().filter(|_| !shared.phase.is_busy())
}

fn empty_ui(ui: &mut Ui, study: &mut RecordingStudy, ready: Option<Setup>, shared: &Shared) {
    match (study.under_way, shared.setup()) {
        (Some(under_way), _) => placeholder_ui(ui, &progress(under_way, study)),
        (None, Err(obstacle)) => placeholder_ui(ui, &obstacle),
        (None, Ok(_)) => {
            let text = "How well the readings determine each target: measured on held-out samples, with confidence intervals \
                        of 95 % from independent stretches or groups of samples.";
            if invitation_ui(ui, text, "Analyse now", ready.is_some())
                && let Some(setup) = ready
            {
                study.analyse(setup);
            }
        }
    }
}

/// Shows a note if a result is of another recording or other settings than the current ones.
fn changed_ui(ui: &mut Ui, of: &Setup, now: Option<&Setup>) {
    if now.is_some_and(|now| now != of) {
        dim_ui(ui, CHANGED);
    }
}

/// Offers to analyse, to cross-validate and to cancel.
pub fn offer_actions(study: &mut RecordingStudy, offers: &mut Offers<'_>, shared: &Shared) {
    let ready = ready(shared).filter(|_| !study.is_under_way());
    let is_analysed = offers.offer(Command::Begin("Analyse readings"), ready.is_some());
    let is_validated = offers.offer(Command::CrossValidate, ready.is_some());
    if let Some(setup) = ready {
        if is_analysed {
            study.analyse(setup);
        } else if is_validated {
            study.cross_validate(setup);
        }
    }
    if offers.offer(Command::Cancel("Cancel analysis"), study.is_under_way()) {
        study.cancel();
    }
}

/// Shows the state of the analysis in the line at the bottom.
pub fn status(study: &RecordingStudy, shared: &Shared) -> Status {
    let (tone, text) = match (study.under_way, &study.found) {
        (Some(under_way), _) => (Tone::Busy, progress(under_way, study)),
        (None, Some(found)) => (Tone::Good, format!("Analysed {}", counted(found.samples, "sample"))),
        (None, None) => (Tone::Calm, "Ready: press Analyse readings".to_owned()),
    };
    let status = Status::new(tone, text);
    match shared.setup() {
        Ok(setup) => status.with_note(setup.source_name()),
        Err(_) => status,
    }
}

/// Shows the held-out errors of the cross-validation and its remarks.
pub fn folds_ui(ui: &mut Ui, validated: &FoldsResult) {
    section_heading_ui(ui, "Cross-validation");
    dim_ui(
        ui,
        &format!(
            "{} samples, each tested by a network trained on the other folds: {}.",
            validated.samples, validated.folds
        ),
    );
    error_table_ui(ui, &validated.table);
    ui.add_space(space(1));
    for remark in &validated.remarks {
        ui.label(RichText::new(sentence(remark)).size(type_size().note));
    }
}

/// Shows what the readings determine, target by target, and channels without information.
pub fn findings_ui(ui: &mut Ui, found: &RecordingFindings) {
    section_heading_ui(ui, "What the readings determine");
    let RecordingFindings { findings, targets, .. } = found;
    for (index, (target, of_target)) in targets.iter().zip(&findings.targets).enumerate() {
        ui.label(sentence(&describe_target(&target.name, of_target)));
        if let (Ok(ridge), Some(kernel)) = (of_target.ridge, of_target.kernel) {
            let [ridge, kernel] = [ridge, kernel].map(|of| format_below_one(of.r2.value, 3));
            dim_ui(
                ui,
                &format!("R² of ridge regression {ridge}, of kernel ridge regression {kernel}"),
            );
        }
        dim_ui(ui, &sentence(&findings.comparison.sentence(index, &target.name)));
        ui.add_space(space(1));
    }
    for warning in &found.warnings {
        note_ui(ui, &sentence(warning));
    }
    dim_ui(
        ui,
        &format!(
            "{} samples, {}; analysed in {}.",
            found.samples,
            found.folds,
            format_duration(found.time)
        ),
    );
}

/// Returns what the view shows: the errors of the cross-validation.
pub fn shown(study: &RecordingStudy) -> Vec<Shown<'_>> {
    let validated = study.validated.as_deref();
    let source = validated.map_or(String::new(), |validated| validated.setup.source_name());
    let validated = validated.ok_or_else(|| "Nothing is cross-validated yet: press “Cross-validate” first.".to_owned());
    let errors = validated.map(|validated| move || error_table(&validated.table));
    let stem = format!("{source}-cross-validation");
    vec![Shown::table("Cross-validation table", stem, errors)]
}

/// Largest number of folds offered.
const MAX_FOLDS: usize = 1000;

/// Shows the folds of a cross-validation, and the buttons that start and cancel it.
pub fn form_ui(ui: &mut Ui, study: &mut RecordingStudy, shared: &Shared) {
    scrolled_ui(ui, "recording study form", |ui| {
        section_heading_ui(ui, "Recording");
        let setup = shared.setup();
        match &setup {
            Ok(setup) => dim_ui(
                ui,
                &format!("{}, with the network settings of the Train view.", setup.source_name()),
            ),
            Err(obstacle) => note_ui(ui, obstacle),
        };
        ui.add_enabled_ui(!study.is_under_way(), |ui| {
            choices_ui(ui, study);
            if setup.is_ok() {
                dim_ui(ui, &cost(study, shared));
            }
        });
        ui.add_space(space(2));
        buttons_ui(ui, study, setup.ok().filter(|_| !shared.phase.is_busy()));
        ui.add_space(space(4));
    });
}

fn choices_ui(ui: &mut Ui, study: &mut RecordingStudy) {
    section_heading_ui(ui, "Cross-validation");
    let hint = "Number of parts. Each part is tested by networks trained on the other parts.";
    count_ui(ui, "Folds", hint, &mut study.folds, 2..=MAX_FOLDS);
    ui.add_space(space(1));
}

fn buttons_ui(ui: &mut Ui, study: &mut RecordingStudy, ready: Option<Setup>) {
    if let Some(under_way) = study.under_way {
        dim_ui(ui, &progress(under_way, study));
        let cancel = ui.vertical_centered_justified(|ui| ui.add(ghost_button("■ Cancel")));
        if cancel
            .inner
            .on_hover_text(with_shortcut(
                ui,
                "Cancels the work in progress; no result is kept",
                Key::Period,
            ))
            .clicked()
        {
            study.cancel();
        }
        return;
    }
    let why_not = "Open a recording in the Train view, and wait until no training is running.";
    ui.vertical_centered_justified(|ui| {
        let analyse = ui.add_enabled(ready.is_some(), primary_button("Analyse readings"));
        let hint = "Measures on held-out samples how well the readings determine each target";
        let is_analysed = analyse
            .on_hover_text(with_shortcut(ui, hint, Key::Enter))
            .on_disabled_hover_text(why_not)
            .clicked();
        let validate = ui.add_enabled(ready.is_some(), ghost_button("Cross-validate"));
        let hint = "Tests on every sample with networks trained on the other folds: one training per fold.";
        let is_validated = validate.on_hover_text(hint).on_disabled_hover_text(why_not).clicked();
        if let Some(setup) = ready {
            if is_analysed {
                study.analyse(setup);
            } else if is_validated {
                study.cross_validate(setup);
            }
        }
    });
}

/// Describes the work under way.
pub(super) fn progress(under_way: UnderWay, study: &RecordingStudy) -> String {
    let reading = study.reading.map(|progress| match progress.of {
        Some(of) if of > 0 => format!("Reading the files… {:.0} %", 100.0 * progress.bytes as f64 / of as f64),
        _ => "Reading the files…".to_owned(),
    });
    match under_way {
        UnderWay::Findings => reading.unwrap_or_else(|| "Analysis…".to_owned()),
        UnderWay::CrossValidation => "Cross-validation…".to_owned(),
    }
}

/// Describes the cost of the work.
fn cost(study: &RecordingStudy, shared: &Shared) -> String {
    let folds = study.folds;
    let last = shared.result().and_then(|result| result.wall_time);
    let time = last.map_or_else(String::new, |last| {
        let all = format_duration(last.saturating_mul(folds as u32));
        format!("; the last training took {}, so {all}", format_duration(last))
    });
    format!("The analysis takes seconds; a cross-validation takes {folds} trainings{time}.")
}
