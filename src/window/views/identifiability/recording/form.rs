use eframe::egui::{Key, Ui};

use super::{
    RecordingStudy,
    study::{FoldsChoice, UnderWay},
};
use crate::window::{
    shared::Shared,
    theme::space,
    widgets::{
        dim_ui, explained_options_ui,
        fields::{capitalised, count_ui},
        ghost_button, note_ui, primary_button, scrolled_ui, section_heading_ui, with_shortcut,
    },
};
use decoupler_core::evaluation::recorded::{Findings, FittedModel};
use decoupler_files::{export::format_duration, import::Setup};

/// Largest number of folds offered.
const MAX_FOLDS: usize = 1000;

const MODELS: [(Option<FittedModel>, &str, &str); 3] = [
    (
        None,
        "better of the two",
        "The network where it is better than ridge regression for a target, else ridge.",
    ),
    (
        Some(FittedModel::Ridge),
        "ridge",
        "Ridge regression alone: takes seconds, but finds linear relations only.",
    ),
    (
        Some(FittedModel::Network),
        "network",
        "The network of these settings: each fit is a training.",
    ),
];

/// Model and folds of the analysis, and the buttons that begin and end it.
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
            if let Ok(setup) = &setup {
                dim_ui(ui, &cost(study, setup, shared));
            }
        });
        ui.add_space(space(2));
        buttons_ui(ui, study, setup.ok().filter(|_| !shared.phase.is_busy()));
        ui.add_space(space(4));
    });
}

fn choices_ui(ui: &mut Ui, study: &mut RecordingStudy) {
    section_heading_ui(ui, "Cross-validation");
    let FoldsChoice { folds, compares_random } = &mut study.choice;
    let hint = "Number of parts. Each part is tested by models fitted to the other parts.";
    count_ui(ui, "Folds", hint, folds, 2..=MAX_FOLDS);
    let hint = "Repeats the cross-validation with random folds and reports how optimistic their errors are. It takes twice \
                as long.";
    ui.checkbox(compares_random, "Compare with random folds")
        .on_hover_text(hint);
    section_heading_ui(ui, "Model");
    dim_ui(ui, "Model that is fitted without each channel and to fewer samples.");
    if let Some(model) = explained_options_ui(ui, "Fitted model", &MODELS, study.model, true) {
        study.model = model;
    }
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
                "Ends the work under way without a result",
                Key::Period,
            ))
            .clicked()
        {
            study.cancel();
        }
        return;
    }
    let why_not = "Open a recording in the Train view, and wait for the end of a training.";
    ui.vertical_centered_justified(|ui| {
        let analyse = ui.add_enabled(ready.is_some(), primary_button("Analyse readings"));
        let hint = "Measures by cross-validation how well the readings determine each target, what each channel contributes, \
                    and what more samples would bring";
        let is_analysed = analyse.on_hover_text(with_shortcut(ui, hint, Key::Enter)).on_disabled_hover_text(why_not).clicked();
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

/// The work under way in words.
pub(super) fn progress(under_way: UnderWay, study: &RecordingStudy) -> String {
    let reading = study.reading.map(|progress| match progress.of {
        Some(of) if of > 0 => format!("Reading the files… {:.0} %", 100.0 * progress.bytes as f64 / of as f64),
        _ => "Reading the files…".to_owned(),
    });
    match under_way {
        UnderWay::Findings(None) => reading.unwrap_or_else(|| "Reading the files…".to_owned()),
        UnderWay::Findings(Some(stage)) => format!("{}…", capitalised(&stage.to_string())),
        UnderWay::CrossValidation => "Cross-validation…".to_owned(),
    }
}

/// Cost of the analysis in words.
fn cost(study: &RecordingStudy, setup: &Setup, shared: &Shared) -> String {
    let folds = study.choice.folds;
    if study.model == Some(FittedModel::Ridge) {
        return format!("The analysis trains no network with ridge alone; {folds} folds.");
    }
    // Inputs of a plan may be patterns; those of the last analysis are known.
    let known = study.found.as_ref().filter(|found| found.setup.plan() == setup.plan());
    let channels = known.map_or_else(
        || setup.plan().map_or(0, |plan| plan.import.inputs.len()),
        |found| found.inputs.len(),
    );
    let most = Findings::max_trainings(channels, folds);
    let least = match study.model {
        Some(_) => most,
        // Ridge may turn out to do as well.
        None => 2 * folds,
    };
    let range = if least == most {
        format!("up to {most}")
    } else {
        format!("{least} to {most}")
    };
    let last = shared.result().and_then(|result| result.wall_time);
    let time = last.map_or_else(String::new, |last| {
        let [least, most] = [least, most].map(|count| format_duration(last.saturating_mul(count as u32)));
        format!(
            "; the last training took {}, so {least} to {most}",
            format_duration(last)
        )
    });
    format!("The analysis takes {range} trainings with {folds} folds{time}.")
}
