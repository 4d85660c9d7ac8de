use decoupler_core::{
    evaluation::{Channel, recorded::FittedModel},
    text::counted,
};
use decoupler_files::{
    export::{describe_target, describe_warnings, format_duration, format_number},
    figure::{PlotFigure, learning_curve_figure},
    import::Setup,
};
use eframe::egui::{Key, Modifiers, RichText, Sense, Ui, vec2};

use super::{
    RecordingStudy,
    form::progress,
    study::{FoldsResult, RecordingFindings},
};
use crate::window::{
    plotting::{Pointer, legend_ui, plots_ui},
    shared::{Offers, Shared, error_table_ui, sentence, target_choice_ui},
    theme::{Theme, space, type_size},
    widgets::{
        TableCell, TableColumn, TableRow, TableView, card_ui, dim_ui, invitation_ui, note_ui, placeholder_ui,
        scrolled_ui, section_heading_ui, state_ui,
    },
};

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

/// Held-out errors of the cross-validation, and its remarks.
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

/// Height of the learning curve.
const CURVE_HEIGHT: f32 = space(60);

/// What the readings determine, target by target, and the contribution of each channel.
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
            .filter_map(|(name, r2)| Some(format!("{name} {:.3}", r2?.r2.value)))
            .collect();
        if r2.len() > 1 {
            dim_ui(ui, &format!("R² of the {}", r2.join(", of ")));
        }
        if let Some(comparison) = &findings.comparison {
            dim_ui(ui, &sentence(&comparison.sentence(index, &target.name)));
        }
        ui.add_space(space(1));
    }
    for warning in describe_warnings(&found.inputs, targets, findings) {
        note_ui(ui, &sentence(&warning));
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
            "RMSE without a channel, relative to the RMSE with all channels; {} is fitted again for each. Dim: dispensable, \
             because other channels replace it.",
            name_of(found.findings.model)
        ),
    );
    let palette = Theme::of(ui).palette;
    let titles: Vec<String> = found.targets.iter().map(Channel::title).collect();
    let columns: Vec<TableColumn<'_>> = std::iter::once(TableColumn::text("channel"))
        .chain(titles.iter().map(|title| TableColumn::figure(title)))
        .collect();
    let rows = found.findings.importance.iter().map(|channel| {
        let colour = if channel.is_dispensable() {
            palette.dim
        } else {
            palette.text
        };
        let name = found.inputs[channel.channel].title();
        let growth = channel.growth.iter().map(|growth| match growth {
            Some(growth) => growth.to_string(),
            None => format_number(None),
        });
        let cells = std::iter::once(name.clone()).chain(growth).map(TableCell::new);
        TableRow::new(cells).named(name).colour(colour)
    });
    TableView::new("channels", &columns).show_all(ui, rows.collect());
}

/// The learning curve of a target, and the gain from more samples in words.
pub fn curve_ui(ui: &mut Ui, found: &RecordingFindings, target: &mut usize) {
    section_heading_ui(ui, "More samples");
    for (channel, of_target) in found.targets.iter().zip(&found.findings.targets) {
        ui.label(sentence(&of_target.curve.sentence(&channel.name)));
    }
    target_choice_ui(ui, "Target", "learning curve target", &found.targets, target);
    let figure = curve_figure(found, *target);
    legend_ui(ui, &figure.keys);
    ui.allocate_ui(vec2(ui.available_width(), CURVE_HEIGHT), |ui| {
        ui.set_min_height(CURVE_HEIGHT);
        plots_ui(ui, "learning curve", &figure, Pointer::Moves);
    });
}

fn curve_figure(found: &RecordingFindings, target: usize) -> PlotFigure {
    let channel = &found.targets[target];
    learning_curve_figure(
        &found.findings.targets[target].curve,
        &channel.name,
        channel.unit.as_deref(),
    )
}

/// The learning curve displayed.
pub(super) fn shown_curve_figure(study: &RecordingStudy) -> Option<PlotFigure> {
    let found = study.found.as_ref()?;
    let last = found.targets.len().checked_sub(1)?;
    Some(curve_figure(found, study.target.min(last)))
}

fn name_of(model: FittedModel) -> &'static str {
    match model {
        FittedModel::Ridge => "ridge",
        FittedModel::Network => "the network",
    }
}
