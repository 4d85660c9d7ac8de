//! A plot within a frame.

use glam::DVec2;

use super::{
    canvas::{Anchor, Area, At, CHARACTER, Canvas, Stroke, TEXT},
    frame::{COLOUR_BAR_WIDTH, Frame, LINE, draw_colour_bar, draw_legend, legend_height},
    picture::{DIM, INK, MISSING, Picture, contrast, pale, rgb},
};
use crate::{
    export::format_number,
    figure::{
        HeatMap, Hue, LineAt, LineStyle, Look, Marker, Plot, PlotFigure, PointLabel, ReferenceLine, Series, along,
        place_labels,
    },
};

/// Paleness of a shaded span; 1 is the background.
const SPAN_PALENESS: f64 = 0.88;

pub(super) fn stroke(hue: Hue, style: LineStyle) -> Stroke {
    let colour = rgb(hue);
    match style {
        LineStyle::Solid => Stroke::new(colour, 1.1),
        LineStyle::Dashed => Stroke {
            dashes: "3 2",
            ..Stroke::new(colour, 1.0)
        },
        LineStyle::Dotted => Stroke {
            dashes: "1 1.8",
            ..Stroke::new(colour, 1.0)
        },
        LineStyle::Fine => Stroke::new(pale(colour, 0.45), 0.6),
    }
}

/// Draws the plot within `area`; names and numbers are outside it.
pub(super) fn draw_plot(plot: &Plot, area: Area, canvas: &mut Canvas) {
    let [x, y] = plot.ranges();
    let frame = Frame {
        area,
        x: (&plot.x, x),
        y: (&plot.y, y),
    };
    for span in &plot.spans {
        let ends = [span.range.start(), span.range.end()].map(|end| plot.x.place(*end));
        if let [Some(from), Some(to)] = ends {
            let [left, right] = [from, to].map(|place| frame.x_at(place));
            let band = Area {
                left,
                width: right - left,
                ..area
            };
            canvas.polygon(&band.corners(), pale(rgb(span.hue), SPAN_PALENESS));
        }
    }
    frame.draw(canvas);
    for span in &plot.spans {
        let middle = plot.x.place(0.5 * (span.range.start() + span.range.end()));
        if let Some(middle) = middle {
            let at = [frame.x_at(middle), area.top + 0.8 * TEXT];
            canvas.text(at, Anchor::Middle, DIM, &span.name);
        }
    }
    canvas.clipped(area, |canvas| {
        let (bars, others): (Vec<_>, Vec<_>) = plot.series.iter().partition(|series| series.bar_width.is_some());
        for series in bars {
            draw_series(plot, series, &frame, canvas);
        }
        for line in &plot.lines {
            draw_line(line, &frame, canvas);
        }
        for series in others {
            draw_series(plot, series, &frame, canvas);
        }
        draw_point_labels(plot, &frame, canvas);
    });
}

/// Labels next to points.
fn draw_point_labels(plot: &Plot, frame: &Frame<'_>, canvas: &mut Canvas) {
    // Most plots have none.
    if !plot.has_point_labels() {
        return;
    }
    let (mut labels, mut texts, mut marks) = (Vec::new(), Vec::new(), Vec::new());
    for series in &plot.series {
        if series.look.line.is_some() {
            let line: Vec<DVec2> = plot.placed(series).map(|(_, place)| frame.at(place).into()).collect();
            marks.extend(along(&line));
        }
        for (point, place) in plot.placed(series).filter(|_| series.look.marker.is_some()) {
            let at = DVec2::from(frame.at(place));
            marks.push(at);
            let Some(text) = &point.label else { continue };
            let size = DVec2::new(CHARACTER * text.chars().count() as f64, TEXT);
            labels.push(PointLabel { at, size });
            texts.push(text);
        }
    }
    let area = frame.area;
    let corners = (DVec2::new(area.left, area.top), DVec2::new(area.right(), area.bottom()));
    for (corner, text) in place_labels(&labels, &marks, corners).into_iter().zip(texts) {
        if let Some(corner) = corner {
            canvas.text([corner.x, corner.y + 0.8 * TEXT], Anchor::Start, DIM, text);
        }
    }
}

fn draw_line(line: &ReferenceLine, frame: &Frame<'_>, canvas: &mut Canvas) {
    let area = frame.area;
    let stroke = stroke(line.hue, line.style);
    match line.at {
        LineAt::X(value) => {
            let Some(x) = frame.x.0.place(value).map(|place| frame.x_at(place)) else {
                return;
            };
            canvas.line([x, area.top], [x, area.bottom()], stroke);
            if let Some(label) = &line.label {
                // On the other side where there is no room on the right.
                let (anchor, offset) = match area.right() - x < 50.0 {
                    true => (Anchor::End, -3.0),
                    false => (Anchor::Start, 3.0),
                };
                canvas.text([x + offset, area.top + 0.8 * TEXT], anchor, DIM, label);
            }
        }
        LineAt::Y(value) => {
            if let Some(y) = frame.y.0.place(value).map(|place| frame.y_at(place)) {
                canvas.line([area.left, y], [area.right(), y], stroke);
            }
        }
    }
}

fn draw_series(plot: &Plot, series: &Series, frame: &Frame<'_>, canvas: &mut Canvas) {
    let colour = rgb(series.look.hue);
    if let Some(style) = series.look.line {
        let places = series.points.iter().map(|point| plot.place(point.x, point.y));
        let places: Vec<Option<At>> = places.map(|place| place.map(|place| frame.at(place))).collect();
        // A missing point leaves a gap.
        for stretch in places.split(Option::is_none).filter(|stretch| stretch.len() > 1) {
            let line: Vec<At> = stretch.iter().copied().flatten().collect();
            canvas.polyline(&line, stroke(series.look.hue, style));
        }
    }
    for (point, place) in plot.placed(series) {
        let at = frame.at(place);
        if let Some(width) = series.bar_width {
            let half = 0.5 * width;
            let ends = [point.x - half, point.x + half].map(|x| plot.x.place(x).unwrap_or(place[0]));
            let [left, right] = ends.map(|place| frame.x_at(place));
            let bar = Area {
                left,
                top: at[1],
                width: right - left,
                height: frame.area.bottom() - at[1],
            };
            if bar.height > 0.0 {
                canvas.polygon(&bar.corners(), colour);
            }
        }
        if let Some(ends) = point.bar {
            let [low, high] = plot.bar_ends(ends, &frame.y.1).map(|place| frame.y_at(place));
            let stroke = Stroke::new(colour, 0.8);
            canvas.line([at[0], low], [at[0], high], stroke);
            for y in [low, high] {
                canvas.line([at[0] - 2.0, y], [at[0] + 2.0, y], stroke);
            }
        }
    }
    for (_, place) in plot.placed(series) {
        draw_marker(series.look, frame.at(place), canvas);
    }
}

pub(super) fn draw_marker(look: Look, at: At, canvas: &mut Canvas) {
    const HALF: f64 = 2.6;
    let colour = rgb(look.hue);
    let edge = Stroke::new(colour, 1.0);
    let [x, y] = at;
    let diamond = [[x, y - 3.2], [x + 3.2, y], [x, y + 3.2], [x - 3.2, y], [x, y - 3.2]];
    match look.marker {
        Some(Marker::Dot) => canvas.disc(at, 0.9, colour),
        Some(Marker::Disc) => canvas.disc(at, 2.1, colour),
        Some(Marker::Ring) => canvas.ring(at, 2.1, edge),
        Some(Marker::Halo) => canvas.ring(at, 4.6, edge),
        Some(Marker::Square) => {
            let square = Area {
                left: x - HALF,
                top: y - HALF,
                width: 2.0 * HALF,
                height: 2.0 * HALF,
            };
            canvas.outline(square, edge);
        }
        Some(Marker::Diamond) => canvas.polygon(&diamond[..4], colour),
        Some(Marker::HollowDiamond) => canvas.polyline(&diamond, edge),
        None => {}
    }
}

/// Draws a sample of `look`, from its left end to its right end.
pub(super) fn draw_sample(look: Look, from: At, width: f64, canvas: &mut Canvas) {
    let [left, y] = from;
    if let Some(style) = look.line {
        canvas.line(from, [left + width, y], stroke(look.hue, style));
    }
    draw_marker(look, [left + 0.5 * width, y], canvas);
}

/// Width of a page, in points (1/72 inch).
pub(super) const PAGE_WIDTH: f64 = 510.0;
/// Width of a figure whose plot has one scale for both axes.
const SQUARE_WIDTH: f64 = 300.0;

const PLOT_HEIGHT: f64 = 190.0;
const LEFT: f64 = 50.0;
const TOP: f64 = 10.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 34.0;

impl PlotFigure {
    /// Draws the figure at the width of a page; a single square plot is narrower.
    pub fn draw(&self) -> Picture {
        let square = self
            .plots
            .first()
            .filter(|plot| plot.has_equal_scales && self.plots.len() == 1);
        let width = square.map_or(PAGE_WIDTH, |_| SQUARE_WIDTH);
        let slot = width / self.plots.len().max(1) as f64;
        let plot_width = slot - LEFT - RIGHT;
        let plot_height = square.map_or(PLOT_HEIGHT, |_| plot_width);
        let legend_width = width - LEFT - RIGHT;
        let mut top = TOP + legend_height(&self.keys, legend_width);
        let notes = top;
        top += LINE * self.notes.len() as f64 + 4.0;
        let mut canvas = Canvas::new(width, top + plot_height + BOTTOM);
        draw_legend(&self.keys, [LEFT, 0.5 * TOP], legend_width, &mut canvas);
        for (line, note) in self.notes.iter().enumerate() {
            let y = notes - 0.5 * TOP + LINE * (line as f64 + 0.5);
            canvas.text([LEFT, y], Anchor::Start, DIM, note);
        }
        for (index, plot) in self.plots.iter().enumerate() {
            let area = Area {
                left: slot * index as f64 + LEFT,
                top,
                width: plot_width,
                height: plot_height,
            };
            draw_plot(plot, area, &mut canvas);
        }
        canvas.finish()
    }
}

const WIDTH: f64 = 360.0;
const ROW: f64 = 24.0;

impl HeatMap {
    /// Draws the figure.
    pub fn draw(&self) -> Picture {
        let longest = |names: &[String]| names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        let (rows, columns) = self.values.dim();
        let left = 26.0 + CHARACTER * longest(&self.rows) as f64;
        let width = WIDTH - left - COLOUR_BAR_WIDTH - 16.0;
        // Names that do not fit side by side are drawn vertically.
        let column = width / columns.max(1) as f64;
        let name = CHARACTER * longest(&self.columns) as f64;
        let is_upright = name > column - 4.0;
        let names = if is_upright { name + 8.0 } else { 2.0 * TEXT };
        let height = (ROW * rows as f64).max(100.0);
        let area = Area {
            left,
            top: 12.0,
            width,
            height,
        };
        let mut canvas = Canvas::new(WIDTH, area.bottom() + names + 2.5 * TEXT);
        let range = self.range();
        let colours = self.colours.colours();
        for ((row, at), &value) in self.values.indexed_iter() {
            let cell = Area {
                left: area.left + column * at as f64,
                top: area.top + height / rows as f64 * row as f64,
                width: column,
                height: height / rows as f64,
            };
            let share = self.colour_share(value, &range);
            let colour = share.map_or(MISSING, |share| colours.at(share as f32));
            canvas.block(cell, colour);
            let text = format_number(value);
            if CHARACTER * text.chars().count() as f64 <= column {
                canvas.text(cell.centre(), Anchor::Middle, contrast(colour), &text);
            }
        }
        for (at, name) in self.columns.iter().enumerate() {
            let x = area.left + column * (at as f64 + 0.5);
            if is_upright {
                canvas.upright_text([x, area.bottom() + 0.5 * names], INK, name);
            } else {
                canvas.text([x, area.bottom() + TEXT], Anchor::Middle, INK, name);
            }
        }
        for (at, name) in self.rows.iter().enumerate() {
            let y = area.top + height / rows as f64 * (at as f64 + 0.5);
            canvas.text([area.left - 5.0, y], Anchor::End, INK, name);
        }
        let [middle_x, middle_y] = area.centre();
        canvas.text(
            [middle_x, area.bottom() + names + TEXT],
            Anchor::Middle,
            INK,
            &self.x_name,
        );
        canvas.upright_text([12.0, middle_y], INK, &self.y_name);
        draw_colour_bar(
            &mut canvas,
            area.right() + 12.0,
            area.top,
            area.height,
            (&self.value_axis, colours),
            &range,
        );
        canvas.finish()
    }
}
