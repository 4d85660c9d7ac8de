use eframe::egui::{Grid, RichText, ScrollArea, Ui, vec2};

use super::{RecordingStudy, work::RecordingFindings};
use crate::{
    app::{
        plotting::{Pointer, legend_ui, plots_ui},
        shared::{sentence, target_choice_ui},
        theme::{Theme, semibold, space, type_size},
        widgets::{dim_ui, note_ui, section_heading_ui},
    },
    evaluation::recorded::FittedModel,
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
    ScrollArea::horizontal().id_salt("channels").show(ui, |ui| {
        Grid::new("worth of the channels")
            .spacing(vec2(space(5), space(1)))
            .show(ui, |ui| {
                let heading = |text: &str| RichText::new(text).font(semibold(type_size().note)).color(palette.dim);
                ui.label(heading("channel"));
                for target in &found.targets {
                    ui.label(heading(&target.title()));
                }
                ui.end_row();
                for channel in &found.findings.importance {
                    let colour = if channel.is_dispensable() {
                        palette.dim
                    } else {
                        palette.text
                    };
                    let cell = |text: &str| RichText::new(text).size(type_size().note).color(colour);
                    ui.label(cell(&found.inputs[channel.channel].title()));
                    for growth in &channel.growth {
                        ui.label(cell(
                            &growth.map_or_else(|| format_number(None), |growth| growth.to_string()),
                        ));
                    }
                    ui.end_row();
                }
            });
    });
}

/// The learning curve of a target, and the gain from more samples in words.
pub fn curve_ui(ui: &mut Ui, found: &RecordingFindings, target: &mut usize) {
    section_heading_ui(ui, "More samples");
    for (channel, of_target) in found.targets.iter().zip(&found.findings.targets) {
        ui.label(sentence(&of_target.curve.sentence(&channel.name)));
    }
    target_choice_ui(ui, "learning curve target", &found.targets, target);
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

/// The learning curve on show.
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
