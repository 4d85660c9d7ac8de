use std::time::Duration;

use eframe::egui::{Align, ComboBox, Layout, Ui, vec2};

use super::{Measuring, measuring::UnderWay, thread::Told};
use crate::{
    app::{
        plotting::{Pointer, legend_ui, plots_ui},
        theme::{Theme, space},
        views::own_data::{remarks::sentence, state::OwnDataView},
        widgets::{
            TableCell, TableColumn, TableRow, TableView, dim_ui, explained_options_ui, fields::capitalised,
            ghost_button, note_ui, scrolled_ui, section_heading_ui,
        },
    },
    evaluation::Channel,
    evaluation::recorded::{Findings, FittedModel},
    export::{describe_target, describe_warnings, format_duration, format_number},
    figure::{PlotFigure, learning_curve_figure},
    import::Meaning,
};

/// Height of the learning curve.
const CURVE_HEIGHT: f32 = space(60);

/// Findings on the recording, or the way to measure them.
pub fn findings_ui(ui: &mut Ui, view: &mut OwnDataView) {
    scrolled_ui(ui, "findings", |ui| {
        begin_ui(ui, view);
        let now = view.planned();
        let settings = view.settings;
        let Measuring { told, target, .. } = &mut view.measuring;
        let Some(told) = told else { return };
        if now.is_some_and(|now| now.absolute != told.plan) || settings != told.settings {
            dim_ui(
                ui,
                "The import or the settings have changed since: measure again for what is chosen now.",
            );
        }
        targets_ui(ui, told);
        channels_ui(ui, told);
        curve_ui(ui, told, target);
    });
}

/// The button, what is fitted, and what it costs.
fn begin_ui(ui: &mut Ui, view: &mut OwnDataView) {
    dim_ui(
        ui,
        "How well the readings tell each target, what each channel is worth, and what more samples would bring: measured by \
         cross-validation, with intervals of 95 % from stretches or groups of samples.",
    );
    let (is_possible, folds) = (
        view.obstacle().is_none() && !view.phase.is_busy(),
        view.validation.folds,
    );
    let mut is_wanted = false;
    ui.horizontal(|ui| {
        if let Some(under_way) = view.measuring.under_way {
            if ui.add(ghost_button("Stop measuring")).clicked() {
                view.measuring.cancel();
            }
            if let UnderWay::Findings(stage) = under_way {
                dim_ui(
                    ui,
                    &stage.map_or_else(
                        || "Reading the files…".to_owned(),
                        |stage| format!("{}…", capitalised(&stage.to_string())),
                    ),
                );
            }
            return;
        }
        is_wanted = ui
            .add_enabled(is_possible, ghost_button("Measure what the readings tell"))
            .clicked();
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let options = [
                (
                    None,
                    "the better",
                    "The network where it is better than ridge regression for a target, else ridge.",
                ),
                (
                    Some(FittedModel::Ridge),
                    "ridge",
                    "Ridge regression alone: takes seconds, but sees only what is linear.",
                ),
                (
                    Some(FittedModel::Network),
                    "network",
                    "The network of these settings: each fit is a training.",
                ),
            ];
            if let Some(model) = explained_options_ui(ui, "Fitted model", &options, view.measuring.model, false) {
                view.measuring.model = model;
            }
            ui.label("Fits")
                .on_hover_text("Model that is fitted without each channel and to fewer samples.");
        });
    });
    let channels = view.draft.as_ref().map_or(0, |draft| draft.count(Meaning::Input));
    if channels > 0 && view.measuring.under_way.is_none() {
        let of_last = view.shown.as_ref().and_then(|shown| shown.wall_time);
        dim_ui(ui, &cost(view.measuring.model, channels, folds, of_last));
    }
    if is_wanted && let Some(planned) = view.planned() {
        view.measuring.find(planned.plan.clone(), view.settings, folds);
        ui.request_repaint();
    }
}

/// Cost of the measurement in words.
fn cost(model: Option<FittedModel>, channels: usize, folds: usize, of_last: Option<Duration>) -> String {
    if model == Some(FittedModel::Ridge) {
        return format!("No network is trained with ridge alone; {folds} folds.");
    }
    let trainings = match model {
        Some(_) => Findings::most_trainings(channels, folds),
        // Ridge may turn out to do as well.
        None => 2 * folds,
    };
    let most = Findings::most_trainings(channels, folds);
    let range = if trainings == most {
        format!("Up to {most}")
    } else {
        format!("{trainings} to {most}")
    };
    let time = of_last.map_or_else(String::new, |time| {
        let [least, most] = [trainings, most].map(|count| format_duration(time.saturating_mul(count as u32)));
        format!(
            "; the last training took {}, so from {least} to {most} in all",
            format_duration(time)
        )
    });
    format!("{range} trainings with {folds} folds{time}.")
}

fn targets_ui(ui: &mut Ui, told: &Told) {
    section_heading_ui(ui, "What the readings tell");
    let Told { findings, targets, .. } = told;
    for (index, (target, found)) in targets.iter().zip(&findings.targets).enumerate() {
        ui.label(sentence(&describe_target(&target.name, found)));
        let r2 = [("network", found.network), ("ridge", found.ridge.ok())];
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
    for warning in describe_warnings(&told.inputs, targets, findings) {
        note_ui(ui, &sentence(&warning));
    }
    dim_ui(
        ui,
        &format!(
            "{} samples, {} folds by {}; measured in {}.",
            told.samples,
            told.folds,
            told.plan.division.by,
            format_duration(told.time)
        ),
    );
}

fn channels_ui(ui: &mut Ui, told: &Told) {
    if told.findings.importance.is_empty() {
        return;
    }
    section_heading_ui(ui, "Channels");
    dim_ui(
        ui,
        &format!(
            "Error (RMSE) without a channel, in proportion to that with all of them ({} fitted anew). Dim: dispensable, \
             as the others replace it.",
            name_of(told.findings.model)
        ),
    );
    let palette = Theme::of(ui).palette;
    let titles: Vec<String> = told.targets.iter().map(Channel::title).collect();
    let columns: Vec<TableColumn<'_>> = std::iter::once(TableColumn::text("channel"))
        .chain(titles.iter().map(|title| TableColumn::figure(title)))
        .collect();
    let rows = told.findings.importance.iter().map(|channel| {
        let colour = if channel.is_dispensable() {
            palette.dim
        } else {
            palette.text
        };
        let name = told.inputs[channel.channel].title();
        let growth = channel.growth.iter().map(|growth| match growth {
            Some(growth) => growth.to_string(),
            None => format_number(None),
        });
        let cells = std::iter::once(name.clone()).chain(growth).map(TableCell::new);
        TableRow::new(cells).named(name).colour(colour)
    });
    TableView::new("channels", &columns).show_all(ui, rows.collect());
}

fn curve_ui(ui: &mut Ui, told: &Told, target: &mut usize) {
    section_heading_ui(ui, "More samples");
    for (channel, found) in told.targets.iter().zip(&told.findings.targets) {
        ui.label(sentence(&found.curve.sentence(&channel.name)));
    }
    target_ui(ui, &told.targets, target);
    let figure = curve_figure(told, *target);
    legend_ui(ui, &figure.keys);
    ui.allocate_ui(vec2(ui.available_width(), CURVE_HEIGHT), |ui| {
        ui.set_min_height(CURVE_HEIGHT);
        plots_ui(ui, "learning curve", &figure, Pointer::Moves);
    });
}

/// The list of targets, where there are several.
pub(super) fn target_ui(ui: &mut Ui, targets: &[Channel], target: &mut usize) {
    *target = (*target).min(targets.len().saturating_sub(1));
    if targets.len() < 2 {
        return;
    }
    ui.horizontal(|ui| {
        let label = ui.label("Target");
        let combo = ComboBox::from_id_salt("judged target").selected_text(targets[*target].title());
        let picked = combo.show_ui(ui, |ui| {
            for (index, of) in targets.iter().enumerate() {
                ui.selectable_value(target, index, of.title());
            }
        });
        picked.response.labelled_by(label.id);
    });
}

fn curve_figure(told: &Told, target: usize) -> PlotFigure {
    let channel = &told.targets[target];
    learning_curve_figure(
        &told.findings.targets[target].curve,
        &channel.name,
        channel.unit.as_deref(),
    )
}

/// The learning curve on show.
pub fn shown_curve_figure(measuring: &Measuring) -> Option<PlotFigure> {
    let told = measuring.told.as_ref()?;
    Some(curve_figure(
        told,
        measuring.target.min(told.targets.len().checked_sub(1)?),
    ))
}

pub(super) fn name_of(model: FittedModel) -> &'static str {
    match model {
        FittedModel::Ridge => "ridge",
        FittedModel::Network => "network",
    }
}
