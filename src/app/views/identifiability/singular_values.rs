//! The singular values of every row, from the best-seen pattern to the worst.

use eframe::egui::{RichText, Ui};
use egui_plot::{HLine, Line, LineStyle, MarkerShape, PlotPoints, Points};

use super::Analysis;
use crate::{
    app::{
        plotting::{
            Key, Mark, legend_ui, legend_width,
            plot_style::{log_marks, log_text, plot, whole_marks},
        },
        theme::{Theme, semibold, type_size},
    },
    sensor::Identifiability,
};

/// Values below the largest by this factor are rounding.
const ROUNDING: f64 = 1e-16;

/// Title, legend and chart, over the space that is left.
pub fn singular_values_ui(ui: &mut Ui, analysis: &Analysis) {
    let palette = Theme::of(ui).palette;
    let key = |name, mark, colour| Key { name, mark, colour };
    let mut keys = vec![key("worst row", Mark::Line, palette.accent)];
    if analysis.rows.len() > 1 {
        keys.push(key("other rows", Mark::Line, palette.dim));
    }
    let hidden_below = analysis.hidden_below_per_mm();
    if hidden_below > 0.0 {
        keys.push(key("noise hides what is below", Mark::Dashes, palette.warning));
    }
    ui.horizontal(|ui| {
        ui.label(RichText::new("Singular values").font(semibold(type_size().title)));
        let spare = ui.available_width() - ui.spacing().item_spacing.x - legend_width(ui, &keys);
        if spare > 0.0 {
            ui.add_space(spare);
            legend_ui(ui, &keys);
        }
    });
    let unknowns = analysis.worst_row().unknowns();
    let chart = plot(
        ui,
        "singular values",
        "deformation pattern, best seen first",
        "singular value of ∂ ln R/∂u (1/mm)",
    );
    chart
        .x_grid_spacer(whole_marks)
        .y_grid_spacer(log_marks)
        .y_axis_formatter(|mark, _| log_text(mark.value))
        .include_x(0.5)
        .include_x(unknowns as f64 + 0.5)
        .show(ui, |plot_ui| {
            let rows = analysis.rows.iter().enumerate();
            for (_, row) in rows.filter(|(place, _)| *place != analysis.worst) {
                let colour = palette.dim.gamma_multiply(0.55);
                plot_ui.line(Line::new("row", logarithms(row)).color(colour).width(1.0));
            }
            if hidden_below > 0.0 {
                let line = HLine::new("noise", hidden_below.log10()).color(palette.warning);
                plot_ui.hline(line.width(1.4).style(LineStyle::dashed_dense()));
            }
            let worst = logarithms(analysis.worst_row());
            let dots = Points::new("worst row", worst.clone()).shape(MarkerShape::Circle);
            plot_ui.points(dots.radius(3.0).color(palette.accent));
            let line = Line::new("worst row", PlotPoints::from(worst));
            plot_ui.line(line.color(palette.accent).width(1.8));
        });
}

/// Number of the pattern from 1, and the decimal logarithm of its value; without those that are rounding.
fn logarithms(row: &Identifiability) -> Vec<[f64; 2]> {
    let values = &row.singular_values_per_mm;
    let least = ROUNDING * values.first().copied().unwrap_or(0.0);
    let numbered = values.iter().enumerate().filter(|&(_, &value)| value > least);
    numbered
        .map(|(number, value)| [number as f64 + 1.0, value.log10()])
        .collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::sensor::{Axes, SensorModel};

    #[test]
    fn patterns_that_are_not_seen_have_no_place_on_a_logarithmic_axis() {
        let model = SensorModel::new("2x6_3x4".parse().unwrap());
        let row = Identifiability::of_row(&model, 0, &[DVec3::ZERO; 6], Axes::Z).unwrap();
        let points = logarithms(&row);
        assert_eq!((row.unknowns(), points.len()), (6, 4));
        assert_eq!(points[0], [1.0, row.singular_values_per_mm[0].log10()]);
    }
}
