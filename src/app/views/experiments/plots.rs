//! The pictures of the paper's experiments.

use eframe::egui::{Align2, Color32, Label, RichText, Sense, Ui, vec2};
use egui_plot::{
    GridMark, HLine, Line, LineStyle, MarkerShape, PlotPoint, PlotPoints, PlotUi, Points, Span, Text, VLine,
};

use super::Outcome;
use crate::{
    app::{
        plotting::{
            Key, Mark, legend_ui, legend_width,
            plot_style::{log_marks, log_text, plot, whole_marks},
        },
        theme::{Theme, semibold, space, type_size},
    },
    evaluation::{Errors, experiments::CellSummary},
    export::experiment_points::{CellPoint, repeat_name, trial_points, z_points},
    network::HiddenSuggestions,
};

/// Z error against hidden nodes: published and ours, the rules of thumb, and the bound of the bottleneck.
pub fn hidden_nodes_ui(ui: &mut Ui, outcome: &Outcome) {
    let palette = Theme::of(ui).palette;
    let key = |name, mark, colour| Key { name, mark, colour };
    let keys = [
        key("ours: median, least to largest", Mark::Discs, palette.accent),
        key("published", Mark::Squares, palette.text),
        key("bound of the bottleneck", Mark::Dashes, palette.validation_series),
        key("linear map", Mark::Dashes, palette.dim),
    ];
    keys_ui(ui, &keys);
    let points = z_points(&outcome.results, &outcome.summaries);
    let scale = outcome.results.experiment.base.source.sensor.scale;
    let suggested = HiddenSuggestions::new(scale.columns(), scale.coordinates_per_row());
    let (fewest, most) = (
        *suggested.square_root.start() as f64,
        *suggested.square_root.end() as f64,
    );
    let highest = largest(&points).max(1.0);
    plot(ui, "table 1", "hidden nodes", "Z error (%)")
        .include_y(0.0)
        .include_y(1.1 * highest)
        .set_margin_fraction(vec2(0.03, 0.02))
        .include_x(suggested.logarithm as f64)
        .include_x(points.iter().map(|point| point.x).fold(most, f64::max))
        .show(ui, |plot_ui| {
            let band = Span::new("Eq. (12)", fewest..=most).fill(palette.warning.gamma_multiply(0.10));
            plot_ui.span(band.border_color(Color32::TRANSPARENT));
            let log = VLine::new("Eq. (13)", suggested.logarithm as f64).color(palette.warning);
            plot_ui.vline(log.width(1.2));
            let top = PlotPoint::new(suggested.logarithm as f64, plot_ui.plot_bounds().max()[1]);
            let name = RichText::new(" Eq. (13)")
                .font(semibold(type_size().body))
                .color(palette.text);
            plot_ui.text(
                Text::new("Eq. (13)", top, name)
                    .anchor(Align2::LEFT_TOP)
                    .color(palette.dim),
            );
            dashed(
                plot_ui,
                "linear map",
                &line_of(&points, |point| point.linear),
                palette.dim,
            );
            dashed(
                plot_ui,
                "bound",
                &line_of(&points, |point| point.bound),
                palette.validation_series,
            );
            let published = line_of(&points, |point| point.published);
            plot_ui.line(
                Line::new("published", published)
                    .color(palette.text.gamma_multiply(0.5))
                    .width(1.2),
            );
            cells(plot_ui, &points, palette.text, palette.accent, true);
        });
}

/// In two rows where one would be too long.
fn keys_ui(ui: &mut Ui, keys: &[Key]) {
    let rows = if legend_width(ui, keys) > ui.available_width() {
        2
    } else {
        1
    };
    for row in keys.chunks(keys.len().div_ceil(rows)) {
        legend_ui(ui, row);
    }
}

/// Z error of each cell, side by side.
pub fn side_by_side_ui(ui: &mut Ui, outcome: &Outcome) {
    let palette = Theme::of(ui).palette;
    let key = |name, mark, colour| Key { name, mark, colour };
    let keys = [
        key("ours: median, least to largest", Mark::Discs, palette.accent),
        key("published", Mark::Squares, palette.text),
        key("linear map", Mark::Dashes, palette.dim),
    ];
    keys_ui(ui, &keys);
    let points = z_points(&outcome.results, &outcome.summaries);
    let axis = &outcome.results.experiment.axis;
    let labels: Vec<String> = (0..axis.len()).map(|index| axis.label(index)).collect();
    let count = labels.len();
    plot(ui, "table 3", axis.name(), "Z error (%)")
        .x_grid_spacer(move |_| {
            (0..count)
                .map(|at| GridMark {
                    value: at as f64,
                    step_size: 1.0,
                })
                .collect()
        })
        .x_axis_formatter(move |mark, _| labels.get(mark.value.round() as usize).cloned().unwrap_or_default())
        .include_y(0.0)
        .include_y(1.1 * largest(&points).max(1.0))
        .set_margin_fraction(vec2(0.02, 0.02))
        .include_x(-0.5)
        .include_x(count as f64 - 0.5)
        .show(ui, |plot_ui| {
            for point in &points {
                if let Some(linear) = point.linear {
                    let ends = vec![[point.x - 0.2, linear], [point.x + 0.2, linear]];
                    dashed(plot_ui, "linear map", &ends, palette.dim);
                }
            }
            cells(plot_ui, &points, palette.text, palette.accent, false);
        });
}

fn largest(points: &[CellPoint]) -> f64 {
    let of = |point: &CellPoint| {
        let spread = point.spread.map(|[_, _, largest]| largest);
        [spread, point.published, point.bound, point.linear]
            .into_iter()
            .flatten()
            .fold(0.0, f64::max)
    };
    points.iter().map(of).fold(0.0, f64::max)
}

fn line_of(points: &[CellPoint], value: fn(&CellPoint) -> Option<f64>) -> Vec<[f64; 2]> {
    points
        .iter()
        .filter_map(|point| Some([point.x, value(point)?]))
        .collect()
}

fn dashed(plot_ui: &mut PlotUi<'_>, name: &str, points: &[[f64; 2]], colour: Color32) {
    if points.len() > 1 {
        let line = Line::new(name, PlotPoints::from(points.to_vec()))
            .color(colour)
            .width(1.4);
        plot_ui.line(line.style(LineStyle::dashed_dense()));
    }
}

/// Published as squares; ours as discs with whiskers, joined if `is_joined`.
fn cells(plot_ui: &mut PlotUi<'_>, points: &[CellPoint], published: Color32, ours: Color32, is_joined: bool) {
    for point in points {
        if let Some([_, least, largest]) = point.spread {
            let whisker = vec![[point.x, least], [point.x, largest]];
            plot_ui.line(
                Line::new("least to largest", whisker)
                    .color(ours.gamma_multiply(0.55))
                    .width(3.0),
            );
        }
    }
    let medians = line_of(points, |point| point.spread.map(|[median, _, _]| median));
    if is_joined && medians.len() > 1 {
        plot_ui.line(Line::new("median", medians.clone()).color(ours).width(1.8));
    }
    let squares = Points::new("published", line_of(points, |point| point.published));
    plot_ui.points(
        squares
            .shape(MarkerShape::Square)
            .filled(false)
            .radius(5.0)
            .color(published),
    );
    plot_ui.points(
        Points::new("median", medians)
            .shape(MarkerShape::Circle)
            .radius(4.0)
            .color(ours),
    );
}

/// Fig. 5: Z, X and Y errors of every repeat, for each size of the dataset.
pub fn repeats_ui(ui: &mut Ui, outcome: &Outcome) {
    let palette = Theme::of(ui).palette;
    let colours = [
        palette.accent,
        palette.test_series,
        palette.validation_series,
        palette.dim,
    ];
    let axis = &outcome.results.experiment.axis;
    ui.horizontal(|ui| {
        for at in 0..axis.len() {
            let colour = colours[at % colours.len()];
            let (dot, _) = ui.allocate_exact_size(vec2(space(2), space(4)), Sense::hover());
            ui.painter().circle_filled(dot.center(), 3.0, colour);
            let name = format!("{} {}", axis.label(at), axis.name());
            ui.label(RichText::new(name).size(type_size().note).color(palette.dim));
            ui.add_space(space(2));
        }
        let is_zero = |cell: &CellSummary| cell.y_percent.median == Some(0.0);
        let text = if outcome.summaries.iter().any(is_zero) {
            "Dashed: published. Y is constant: our error of it is 0 and below its axis"
        } else {
            "Dashed: published"
        };
        ui.add(Label::new(RichText::new(text).size(type_size().note).color(palette.dim)).truncate());
    });
    type Published = fn(&CellSummary) -> Option<f64>;
    type Measured = fn(&Errors) -> Option<f64>;
    let panels: [(&'static str, &str, Published, Measured); 3] = [
        (
            "fig 5 z",
            "Z error (%)",
            |cell| cell.z_percent.published,
            |errors| errors.z_percent,
        ),
        (
            "fig 5 x",
            "X error (%)",
            |cell| cell.x_percent.published,
            |errors| errors.x_percent,
        ),
        (
            "fig 5 y",
            "Y error (%)",
            |cell| cell.y_percent.published,
            |errors| errors.y_percent,
        ),
    ];
    let experiment = &outcome.results.experiment;
    let trials = outcome
        .results
        .cells
        .iter()
        .map(|cell| cell.expected)
        .max()
        .unwrap_or(1);
    let x_name = repeat_name(&outcome.results);
    let (width, height) = ((ui.available_width() - 2.0 * space(2)) / 3.0, ui.available_height());
    ui.horizontal(|ui| {
        for (id, y_name, published, measured) in panels {
            // Y is constant, so its error is of the size of rounding for some and not for others.
            let is_log = id == "fig 5 y";
            let on_axis = move |value: f64| if is_log { value.log10() } else { value };
            let mut chart = plot(ui, id, x_name, y_name)
                .include_x(0.5)
                .include_x(trials as f64 + 0.5)
                .width(width)
                .height(height)
                .x_grid_spacer(whole_marks);
            if is_log {
                chart = chart
                    .y_grid_spacer(log_marks)
                    .y_axis_formatter(|mark, _| log_text(mark.value));
            } else {
                chart = chart.include_y(0.0);
            }
            chart.set_margin_fraction(vec2(0.04, 0.08)).show(ui, |plot_ui| {
                for (at, (cell, summary)) in outcome.results.cells.iter().zip(&outcome.summaries).enumerate() {
                    let colour = colours[at % colours.len()];
                    let points = trial_points(experiment, cell, measured);
                    let points = points.into_iter().map(|[x, y]| [x, on_axis(y)]);
                    let points: Vec<[f64; 2]> = points.filter(|point| point[1].is_finite()).collect();
                    if let Some(published) = published(summary).map(on_axis).filter(|value| value.is_finite()) {
                        let line = HLine::new("published", published).color(colour).width(1.2);
                        plot_ui.hline(line.style(LineStyle::dashed_dense()));
                    }
                    plot_ui.points(Points::new("repeats", points).radius(2.6).color(colour));
                }
            });
        }
    });
}
