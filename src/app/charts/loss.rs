use eframe::egui::{Color32, Ui};
use egui_plot::{Line, PlotPoints, VLine};

use super::plot_style::{decade_text, decades, legend, plot, thinned};
use crate::{app::theme::Theme, export::format_number, training::EpochRecord};

/// Picks one of an epoch's errors.
type ErrorOf = fn(&EpochRecord) -> Option<f64>;

/// Training, validation and test error against epoch; a dashed line marks the epoch of the best weights.
pub fn loss_ui(ui: &mut Ui, history: &[EpochRecord], best_epoch: usize) {
    let palette = Theme::of(ui).palette;
    let curves: [(_, Color32, ErrorOf); 3] = [
        ("training", palette.training_series, |epoch| Some(epoch.training_mse)),
        ("validation", palette.validation_series, |epoch| epoch.validation_mse),
        ("test", palette.test_series, |epoch| epoch.test_mse),
    ];
    plot(ui, "loss", "epoch", "mse (scaled)")
        .legend(legend())
        .y_grid_spacer(decades)
        .y_axis_formatter(|mark, _| decade_text(mark))
        .label_formatter(hover_text)
        .show(ui, |plot_ui| {
            for (name, colour, error) in curves {
                let points: Vec<[f64; 2]> = thinned(history)
                    .filter_map(|epoch| Some([epoch.epoch as f64, error(&epoch)?.log10()]))
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
}

fn hover_text(position: &egui_plot::HoverPosition<'_>) -> Option<String> {
    match position {
        egui_plot::HoverPosition::NearDataPoint {
            plot_name, position, ..
        } => Some(format!(
            "{plot_name}\nepoch {}\nmse {}",
            position.x,
            format_number(10.0_f64.powf(position.y))
        )),
        egui_plot::HoverPosition::Elsewhere { .. } => None,
    }
}
