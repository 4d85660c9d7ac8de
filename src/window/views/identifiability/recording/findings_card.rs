use eframe::egui::{Ui, vec2};

use super::{RecordingStudy, work::RecordingFindings};
use crate::window::{
    plotting::{Pointer, legend_ui, plots_ui},
    shared::{sentence, target_choice_ui},
    theme::{Theme, space},
    widgets::{TableCell, TableColumn, TableRow, TableView, dim_ui, note_ui, section_heading_ui},
};
use decoupler_core::evaluation::{Channel, recorded::FittedModel};
use decoupler_files::{
    export::{describe_target, describe_warnings, format_duration, format_number},
    figure::{PlotFigure, learning_curve_figure},
};

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
