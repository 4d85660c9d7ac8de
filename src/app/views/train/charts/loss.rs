use eframe::egui::{Color32, Ui};
use egui_plot::{HoverPosition, Line, PlotPoints, VLine};

use super::{ceiling::highest_mse, stages::stage_marks_ui};
use crate::{
    app::{
        plotting::{
            Key, Mark,
            plot_style::{log_marks, log_text, plot, thinned},
        },
        theme::{Palette, Theme},
    },
    export::format_number,
    training::{EpochRecord, Stage},
};

/// Picks one of an epoch's errors.
type ErrorOf = fn(&EpochRecord) -> Option<f64>;

fn curves(palette: &Palette) -> [(&'static str, Color32, ErrorOf); 3] {
    [
        ("training", palette.training_series, |epoch| Some(epoch.training_mse)),
        ("validation", palette.validation_series, |epoch| epoch.validation_mse),
        ("test", palette.test_series, |epoch| epoch.test_mse),
    ]
}

/// What is in the chart: no validation where nothing was held out.
pub fn loss_keys(palette: &Palette, history: &[EpochRecord]) -> Vec<Key> {
    let has_errors = |error: &ErrorOf| history.iter().any(|epoch| error(epoch).is_some());
    let curves = curves(palette).into_iter().filter(|(_, _, error)| has_errors(error));
    let curves = curves.map(|(name, colour, _)| Key {
        name,
        mark: Mark::Line,
        colour,
    });
    let best = Key {
        name: "best weights",
        mark: Mark::Dashes,
        colour: palette.dim,
    };
    curves.chain([best]).collect()
}

/// Training, validation and test error against epoch; a dashed line marks the epoch of the best weights,
/// a thin one each change of method. Errors far above that of the start run along the upper edge.
pub fn loss_ui(ui: &mut Ui, history: &[EpochRecord], stages: &[Stage], best_epoch: usize) {
    let palette = Theme::of(ui).palette;
    let highest = highest_mse(history);
    let shown = plot(ui, "loss", "epoch", "mse (scaled)")
        .y_grid_spacer(log_marks)
        .y_axis_formatter(|mark, _| log_text(mark.value))
        .label_formatter(move |position| hover_text(position, highest))
        .show(ui, |plot_ui| {
            for (name, colour, error) in curves(&palette) {
                let points: Vec<[f64; 2]> = thinned(history)
                    .filter_map(|epoch| Some([epoch.epoch as f64, error(&epoch)?.min(highest).log10()]))
                    .filter(|point| point[1].is_finite())
                    .collect();
                if !points.is_empty() {
                    plot_ui.line(Line::new(name, PlotPoints::from(points)).color(colour).width(1.8));
                }
            }
            let best = VLine::new("best weights", best_epoch as f64)
                .color(palette.dim)
                .width(1.0);
            plot_ui.vline(best.style(egui_plot::LineStyle::dashed_dense()));
        });
    stage_marks_ui(ui, &shown, stages);
}

fn hover_text(position: &HoverPosition<'_>, highest: f64) -> Option<String> {
    match position {
        HoverPosition::NearDataPoint {
            plot_name, position, ..
        } => {
            let above = if position.y >= highest.log10() { "at least " } else { "" };
            let mse = format_number(10.0_f64.powf(position.y));
            Some(format!(
                "{plot_name}, epoch {}\nmean squared error {above}{mse}",
                position.x
            ))
        }
        HoverPosition::Elsewhere { .. } => None,
    }
}
