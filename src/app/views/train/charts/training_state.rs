use eframe::egui::{Color32, Ui};
use egui_plot::{Line, PlotPoints};

use super::{
    ceiling::{drawn_parameter, highest_gradient},
    stages::{parameter_name, stage_marks_ui},
};
use crate::{
    app::{
        plotting::{
            Key, Mark,
            plot_style::{log_marks, log_text, plot, thinned, whole_marks},
        },
        theme::{Palette, Theme},
    },
    training::{EpochRecord, Stage},
};

/// Picks one of an epoch's quantities, given the largest gradient drawn.
type QuantityOf = fn(&EpochRecord, f64) -> f64;

fn curves(palette: &Palette, parameter_name: &'static str) -> [(&'static str, Color32, QuantityOf); 2] {
    [
        ("gradient", palette.training_series, |epoch, highest| {
            epoch.gradient_norm.min(highest)
        }),
        (parameter_name, palette.test_series, |epoch, _| {
            drawn_parameter(epoch.parameter)
        }),
    ]
}

/// What is in the charts.
pub fn training_state_keys(palette: &Palette, parameter_name: &'static str) -> Vec<Key> {
    let curves = curves(palette, parameter_name).map(|(name, colour, _)| (name, colour));
    let failures = ("validation failures", palette.validation_series);
    let keys = curves.into_iter().chain([failures]);
    keys.map(|(name, colour)| Key {
        name,
        mark: Mark::Line,
        colour,
    })
    .collect()
}

/// Length of the gradient (far above that of the start along the upper edge), damping or learning rate, and validation failures against epoch.
pub fn training_state_ui(ui: &mut Ui, history: &[EpochRecord], stages: &[Stage]) {
    let parameter_name = parameter_name(stages);
    let palette = Theme::of(ui).palette;
    let highest = highest_gradient(history);
    let half = 0.5 * (ui.available_width() - ui.spacing().item_spacing.x);
    let height = ui.available_height();
    ui.horizontal(|ui| {
        let shown = plot(ui, "training state", "epoch", &format!("gradient, {parameter_name}"))
            .width(half)
            .height(height)
            .y_grid_spacer(log_marks)
            .y_axis_formatter(|mark, _| log_text(mark.value))
            .show(ui, |plot_ui| {
                for (name, colour, value) in curves(&palette, parameter_name) {
                    let points = thinned(history).map(|epoch| [epoch.epoch as f64, value(&epoch, highest).log10()]);
                    let points: Vec<[f64; 2]> = points.filter(|point| point[1].is_finite()).collect();
                    plot_ui.line(Line::new(name, PlotPoints::from(points)).color(colour).width(1.8));
                }
            });
        stage_marks_ui(ui, &shown, stages);
        plot(ui, "validation failures", "epoch", "validation failures")
            .width(half)
            .height(height)
            .y_grid_spacer(whole_marks)
            .include_y(0.0)
            .include_y(1.0)
            .show(ui, |plot_ui| {
                let line = Line::new("validation failures", PlotPoints::from(steps(history)));
                // A band would make slopes of the steps.
                plot_ui.line(line.color(palette.validation_series).width(1.8).allow_band(false));
            });
    });
}

/// Validation failures hold from one epoch to the next: `[epoch, failures]` at both ends of each step.
fn steps(history: &[EpochRecord]) -> Vec<[f64; 2]> {
    let mut points: Vec<[f64; 2]> = Vec::new();
    for epoch in thinned(history) {
        let (at, failures) = (epoch.epoch as f64, epoch.validation_failures as f64);
        if let Some(&[_, before]) = points.last().filter(|[_, before]| *before != failures) {
            points.push([at, before]);
        }
        points.push([at, failures]);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_rise_upright() {
        let epoch = |epoch: usize, validation_failures: usize| EpochRecord {
            epoch,
            training_mse: 1.0,
            validation_mse: Some(1.0),
            test_mse: None,
            gradient_norm: 1.0,
            parameter: 1.0,
            effective_parameters: None,
            validation_failures,
        };
        let history = [epoch(0, 0), epoch(1, 1), epoch(2, 1), epoch(3, 0)];
        let expected = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [3.0, 1.0], [3.0, 0.0]];
        assert_eq!(steps(&history), expected);
        assert!(steps(&[]).is_empty());
    }
}
