use eframe::egui::{Color32, Ui};
use egui_plot::{Line, PlotPoints};

use super::plot_style::{decade_text, decades, legend, plot, thinned};
use crate::{app::theme::Theme, training::EpochRecord};

/// Picks one of an epoch's quantities.
type QuantityOf = fn(&EpochRecord) -> f64;

/// Length of the gradient, damping or learning rate, and validation failures against epoch.
pub fn training_state_ui(ui: &mut Ui, history: &[EpochRecord], parameter_name: &str) {
    let palette = Theme::of(ui).palette;
    let half = 0.5 * (ui.available_width() - ui.spacing().item_spacing.x);
    let height = ui.available_height();
    ui.horizontal(|ui| {
        plot(ui, "training state", "epoch", "gradient, parameter")
            .width(half)
            .height(height)
            .legend(legend())
            .y_grid_spacer(decades)
            .y_axis_formatter(|mark, _| decade_text(mark))
            .show(ui, |plot_ui| {
                let curves: [(_, Color32, QuantityOf); 2] = [
                    ("gradient", palette.training_series, |epoch| epoch.gradient_norm),
                    (parameter_name, palette.test_series, |epoch| epoch.parameter),
                ];
                for (name, colour, value) in curves {
                    let points = thinned(history).map(|epoch| [epoch.epoch as f64, value(&epoch).log10()]);
                    let points: Vec<[f64; 2]> = points.filter(|point| point[1].is_finite()).collect();
                    plot_ui.line(Line::new(name, PlotPoints::from(points)).color(colour).width(1.8));
                }
            });
        plot(ui, "validation failures", "epoch", "rises in a row")
            .width(half)
            .height(height)
            .include_y(0.0)
            .include_y(1.0)
            .show(ui, |plot_ui| {
                let points = thinned(history).map(|epoch| [epoch.epoch as f64, epoch.validation_failures as f64]);
                let line = Line::new("rises in a row", points.collect::<PlotPoints<'_>>());
                plot_ui.line(line.color(palette.validation_series).width(1.8));
            });
    });
}
