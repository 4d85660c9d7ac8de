//! The form, the results and the exports of the study of a recording.

use decoupler_core::{
    evaluation::recorded::{Findings, FittedModel},
    problem::Channel,
    text::counted,
};
use decoupler_files::{
    export::{
        Cell, Table, TableColumn as ExportColumn, describe_target, error_table, format_below_one, format_duration,
        format_number,
    },
    import::Setup,
};
use eframe::egui::{Key, Modifiers, RichText, Sense, Ui};

use super::{
    RecordingStudy,
    study::{FoldsChoice, FoldsResult, RecordingFindings, UnderWay},
};
use crate::window::{
    shared::{Export, FileWords, Offers, Shared, copy_exports, csv_export, error_table_ui, sentence},
    theme::{Theme, space, type_size},
    widgets::{
        TableCell, TableColumn, TableRow, TableView, card_ui, dim_ui, explained_options_ui,
        fields::{capitalised, count_ui},
        ghost_button, invitation_ui, note_ui, placeholder_ui, primary_button, scrolled_ui, section_heading_ui,
        state_ui, with_shortcut,
    },
};

const CHANGED: &str = "The recording or the settings have changed since: analyse again.";

/// Shows what the readings determine on the left, the learning curve and the cross-validation on the right.
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
            None => placeholder_ui(ui, "Press “Analyse readings” for R², channels and learning curve."),
        });
    });
    card_ui(ui, right.with_min_x(right.min.x + space(1)), |ui| {
        scrolled_ui(ui, "study", |ui| {
            if let Some(found) = found {
                curve_ui(ui, found);
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

/// Returns the setup, if it can be analysed now.
fn ready(shared: &Shared) -> Option<Setup> {
    shared.setup().ok().filter(|_| !shared.phase.is_busy())
}

fn empty_ui(ui: &mut Ui, study: &mut RecordingStudy, ready: Option<Setup>, shared: &Shared) {
    match (study.under_way, shared.setup()) {
        (Some(under_way), _) => placeholder_ui(ui, &progress(under_way, study)),
        (None, Err(obstacle)) => placeholder_ui(ui, &obstacle),
        (None, Ok(_)) => {
            let text = "How well the readings determine each target, what each channel contributes, and how the error falls \
                        with the number of samples: measured on held-out samples, with confidence intervals of 95 % from \
                        independent stretches or groups of samples.";
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

/// Shows what the readings determine, target by target, and the contribution of each channel.
pub fn findings_ui(ui: &mut Ui, found: &RecordingFindings) {
    targets_ui(ui, found);
    channels_ui(ui, found);
}

fn targets_ui(ui: &mut Ui, found: &RecordingFindings) {
    section_heading_ui(ui, "What the readings determine");
    let RecordingFindings { findings, targets, .. } = found;
    for (index, (target, of_target)) in targets.iter().zip(&findings.targets).enumerate() {
        ui.label(sentence(&describe_target(&target.name, of_target)));
        let r2 = [("network", of_target.network), ("ridge", of_target.ridge.ok())];
        let r2: Vec<String> = r2
            .into_iter()
            .filter_map(|(name, r2)| Some(format!("{name} {}", format_below_one(r2?.r2.value, 3))))
            .collect();
        if r2.len() > 1 {
            dim_ui(ui, &format!("R² of the {}", r2.join(", of ")));
        }
        if let Some(comparison) = &findings.comparison {
            dim_ui(ui, &sentence(&comparison.sentence(index, &target.name)));
        }
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

fn channels_ui(ui: &mut Ui, found: &RecordingFindings) {
    if found.findings.importance.is_empty() {
        return;
    }
    section_heading_ui(ui, "Channels");
    dim_ui(
        ui,
        &format!(
            "RMSE without a channel, relative to the RMSE with all channels; {} is fitted again for each. Dim: \
             dispensable, because no error grows significantly without it.",
            name_of(found.findings.model)
        ),
    );
    let palette = Theme::of(ui).palette;
    let titles: Vec<String> = found.targets.iter().map(Channel::title).collect();
    let columns: Vec<TableColumn<'_>> = std::iter::once(TableColumn::text("channel"))
        .chain(titles.iter().map(|title| TableColumn::figure(title)))
        .collect();
    let rows = found.findings.importance.iter().enumerate().map(|(channel, growth)| {
        let colour = if found.findings.is_dispensable(channel) {
            palette.dim
        } else {
            palette.text
        };
        let name = found.inputs[channel].title();
        let growth = growth.iter().map(|growth| match growth {
            Some(growth) => growth.to_string(),
            None => format_number(None),
        });
        let cells = std::iter::once(name.clone()).chain(growth).map(TableCell::new);
        TableRow::new(cells).named(name).colour(colour)
    });
    TableView::new("channels", &columns).show_all(ui, rows.collect());
}

/// Shows the errors on the test samples by the number of training samples.
pub fn curve_ui(ui: &mut Ui, found: &RecordingFindings) {
    if found.findings.curve.is_empty() {
        return;
    }
    section_heading_ui(ui, "Learning curve");
    dim_ui(
        ui,
        &format!(
            "RMSE on the test samples by the number of training samples: mean of the fits, from best to worst; {} is fitted \
             again for each.",
            name_of(found.findings.model)
        ),
    );
    let titles: Vec<String> = found.targets.iter().map(Channel::title).collect();
    let columns: Vec<TableColumn<'_>> = std::iter::once(TableColumn::figure("samples"))
        .chain(titles.iter().map(|title| TableColumn::figure(title)))
        .collect();
    let rows = found.findings.curve.iter().map(|point| {
        let samples = point.samples.to_string();
        let errors = point.rmse.iter().zip(&point.range).map(|(&rmse, &range)| {
            let [best, worst] = range.map(format_number);
            format!("{} ({best} to {worst})", format_number(rmse))
        });
        let cells = std::iter::once(samples.clone()).chain(errors).map(TableCell::new);
        TableRow::new(cells).named(counted(point.samples, "sample"))
    });
    TableView::new("learning curve", &columns).show_all(ui, rows.collect());
}

fn name_of(model: FittedModel) -> &'static str {
    match model {
        FittedModel::Ridge => "ridge",
        FittedModel::Network => "the network",
    }
}

const CHANNELS: FileWords = FileWords {
    kind: "channel table",
    description: "How much the error of each target grows without each channel, with every digit, as CSV.",
    extensions: &["csv"],
};

const CURVE: FileWords = FileWords {
    kind: "learning curve",
    description: "RMSE of each target on the test samples by the number of training samples, with every digit, as CSV.",
    extensions: &["csv"],
};

const HELD_OUT: FileWords = FileWords {
    kind: "cross-validation table",
    description: "Errors of each target over all samples, each tested by models fitted to the other folds, with every \
                  digit, as CSV.",
    extensions: &["csv"],
};

/// Returns the exports: learning curve, channels and errors of the cross-validation.
pub fn study_exports(study: &RecordingStudy) -> Vec<Export<'_>> {
    let nothing = || "The readings are not analysed yet: press “Analyse readings” first.".to_owned();
    let of_source = |source: &str, what: &str| format!("{source}-{what}");
    let found = study.found.as_deref().ok_or_else(nothing);
    let stem = |what: &str| {
        let source = found.as_ref().map_or(String::new(), |found| found.setup.source_name());
        of_source(&source, what)
    };
    let curve = found.clone().map(|found| move || curve_table(found));
    let mut exports = vec![csv_export(
        "Learning curve",
        CURVE,
        stem("learning-curve"),
        curve.clone(),
    )];
    exports.extend(copy_exports("Learning curve", curve));
    let channels = found.clone().map(|found| move || channel_table(found));
    exports.push(csv_export(
        "Channel table",
        CHANNELS,
        stem("channels"),
        channels.clone(),
    ));
    exports.extend(copy_exports("Channel table", channels));
    let validated = study.validated.as_deref();
    let name = validated.map_or(String::new(), |validated| validated.setup.source_name());
    let validated = validated.ok_or_else(|| "Nothing is cross-validated yet: press “Cross-validate” first.".to_owned());
    let errors = validated.map(|validated| move || error_table(&validated.table));
    exports.push(csv_export(
        "Cross-validation table",
        HELD_OUT,
        of_source(&name, "cross-validation"),
        errors.clone(),
    ));
    exports.extend(copy_exports("Cross-validation table", errors));
    exports
}

/// Returns the growth of the error of each target without each channel.
fn channel_table(found: &RecordingFindings) -> Table {
    let mut rows = Vec::new();
    for (channel, growth) in found.inputs.iter().zip(&found.findings.importance) {
        for (target, growth) in found.targets.iter().zip(growth) {
            let names = [&channel.name, &target.name];
            let figures = [
                growth.map(|growth| growth.value),
                growth.map(|growth| growth.low),
                growth.map(|growth| growth.high),
            ];
            let names = names.into_iter().map(|name| Cell::from(name.clone()));
            rows.push(names.chain(figures.map(Cell::Number)).collect());
        }
    }
    let columns = [
        ("channel", "Channel"),
        ("target", "Target"),
        ("rmse_ratio", "RMSE without it / with all"),
        ("low", "from"),
        ("high", "to"),
    ];
    Table {
        columns: columns
            .map(|(field, heading)| ExportColumn::new(field, heading, ""))
            .into(),
        rows,
    }
}

/// Returns the errors of each target by the number of training samples.
fn curve_table(found: &RecordingFindings) -> Table {
    let mut rows = Vec::new();
    for point in &found.findings.curve {
        for (index, target) in found.targets.iter().enumerate() {
            let [best, worst] = point.range[index];
            let figures = [point.rmse[index], best, worst].map(Cell::from);
            let names = [Cell::from(point.samples), Cell::from(target.name.clone())];
            rows.push(names.into_iter().chain(figures).collect());
        }
    }
    let columns = [
        ("samples", "Training samples"),
        ("target", "Target"),
        ("rmse", "RMSE"),
        ("min", "best fit"),
        ("max", "worst fit"),
    ];
    Table {
        columns: columns
            .map(|(field, heading)| ExportColumn::new(field, heading, ""))
            .into(),
        rows,
    }
}

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

/// Shows model and folds of the analysis, and the buttons that start and cancel it.
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
        let hint = "Measures on held-out samples how well the readings determine each target, what each channel contributes, \
                    and how the error falls with the number of samples";
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

/// Describes the work under way.
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

/// Describes the cost of the analysis.
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
    let max = Findings::max_trainings(channels, folds);
    let min = match study.model {
        Some(_) => max,
        // Ridge may turn out to be as good.
        None => 2 * folds,
    };
    let range = if min == max {
        format!("up to {max}")
    } else {
        format!("{min} to {max}")
    };
    let last = shared.result().and_then(|result| result.wall_time);
    let time = last.map_or_else(String::new, |last| {
        let [min, max] = [min, max].map(|count| format_duration(last.saturating_mul(count as u32)));
        format!("; the last training took {}, so {min} to {max}", format_duration(last))
    });
    format!("The analysis takes {range} trainings with {folds} folds{time}.")
}
