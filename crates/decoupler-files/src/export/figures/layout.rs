//! The layout of figures in print: plots within their axes, the legend above them, surfaces side by side.

use std::sync::OnceLock;

use glam::Vec2;

use super::picture::{Canvas, PAGE_WIDTH, Picture, TEXT, measure};
use crate::figure::{
    Align, Bounds, ColourMap, Figure, Form, HeatMap, Hue, Ink, Plot, PlotFigure, Rgb, Series, Shape, Stroke, share,
    surface::{Surface, SurfaceFigure},
};

impl Figure {
    /// Draws the figure for print.
    pub fn draw(&self) -> Picture {
        match self {
            Self::Plots(plots) => draw_plots(plots),
            Self::HeatMap(map) => draw_map(map),
            Self::Surfaces(surfaces) => draw_surfaces(surfaces),
        }
    }
}

/// Height of a line of text.
const LINE: f32 = 1.6 * TEXT;
const TEXT_INK: Ink = Ink::Hue(Hue::Ink);
const DIM: Ink = Ink::Hue(Hue::Grey);

/// Room for the names and numbers of the axes of a plot, and its height.
const LEFT: f32 = 70.0;
const RIGHT: f32 = 16.0;
const BOTTOM: f32 = 46.0;
const PLOT_HEIGHT: f32 = 260.0;
/// Width of a figure whose plot has one scale for both axes.
const SQUARE_WIDTH: f32 = 410.0;
/// Width of the sample of a legend.
const SAMPLE: f32 = 22.0;

/// Draws plots side by side at the width of a page, with one legend; a single square plot is narrower.
fn draw_plots(figure: &PlotFigure) -> Picture {
    let is_square = matches!(&figure.plots[..], [plot] if plot.has_equal_scales);
    let width = if is_square { SQUARE_WIDTH } else { PAGE_WIDTH };
    let slot = width / figure.plots.len().max(1) as f32;
    let plot_width = slot - LEFT - RIGHT;
    let plot_height = if is_square { plot_width } else { PLOT_HEIGHT };
    let (mut shapes, mut at) = (Vec::new(), Vec2::new(LEFT, 0.5 * LINE));
    for (name, look) in figure.keys() {
        let text = measure(name).x;
        if at.x > LEFT && at.x + SAMPLE + text > width {
            at = Vec2::new(LEFT, at.y + LINE);
        }
        shapes.extend(look.sample(at, SAMPLE));
        let beside = at + Vec2::new(SAMPLE + 5.0, 0.0);
        shapes.push(Shape::text(beside, Align::Start, TEXT_INK, name));
        at.x += SAMPLE + text + 20.0;
    }
    let mut top = if shapes.is_empty() { 0.0 } else { at.y + 0.5 * LINE };
    for note in &figure.notes {
        let at = Vec2::new(LEFT, top + 0.5 * LINE);
        shapes.push(Shape::text(at, Align::Start, DIM, &**note));
        top += LINE;
    }
    top += 12.0;
    let mut canvas = Canvas::new(Vec2::new(width, top + plot_height + BOTTOM));
    canvas.draw(shapes);
    for (index, plot) in figure.plots.iter().enumerate() {
        let corner = Vec2::new(slot * index as f32 + LEFT, top);
        let area = Bounds::of_size(corner, Vec2::new(plot_width, plot_height));
        draw_plot(plot, area, &mut canvas);
    }
    canvas.finish()
}

/// Draws the plot within `area`; names and numbers are outside it.
fn draw_plot(plot: &Plot, area: Bounds, canvas: &mut Canvas) {
    let ranges @ [x_range, y_range] = &plot.ranges();
    let at = |[x, y]: [f64; 2]| {
        let [right, up] = [share(x, x_range), 1.0 - share(y, y_range)].map(|share| share as f32);
        area.min + Vec2::new(right, up) * area.size()
    };
    let (mut bands, mut lines, mut shapes) = (Vec::new(), Vec::new(), Vec::new());
    for (Series { look, .. }, line) in plot.lines_across() {
        let Some(corners) = plot.corners(line, ranges) else {
            continue;
        };
        let [from, to] = corners.map(at);
        match look.line {
            Some(style) => lines.push(Shape::Line(vec![from, to], style.stroke(look.hue))),
            None => bands.push(Bounds::of([from, to]).area(Ink::Hue(look.hue).at(0.12))),
        }
    }
    canvas.draw(bands);
    canvas.draw(axes(plot, area, ranges));
    for series in &plot.series {
        let Form::Bars(width) = series.form else { continue };
        for (_, [x, y]) in plot.placed(series) {
            let [left, right] = [-0.5, 0.5].map(|half| at([x + half * width, y]));
            if left.y < area.max.y {
                let bar = Bounds::of([left, Vec2::new(right.x, area.max.y)]);
                shapes.push(bar.area(series.look.hue));
            }
        }
    }
    shapes.extend(lines);
    for series in &plot.series {
        if let Some(style) = series.look.line {
            let stretches = plot.stretches(series).into_iter();
            let stretches = stretches.map(|places| places.into_iter().map(at).collect());
            shapes.extend(stretches.map(|points| Shape::Line(points, style.stroke(series.look.hue))));
        }
        for (point, place) in plot.placed(series) {
            let Some(ends) = point.bar else { continue };
            let [low, high] = plot.bar_ends(ends, y_range).map(|end| at([place[0], end]));
            let cap = Vec2::new(3.0, 0.0);
            let lines = [[low, high], [low - cap, low + cap], [high - cap, high + cap]];
            shapes.extend(lines.map(|[from, to]| Shape::line(from, to, series.look.hue, 1.1)));
        }
        let marks = plot.placed(series).filter_map(|(_, place)| series.look.mark(at(place)));
        shapes.extend(marks);
    }
    shapes.extend(plot.lay_out_labels(area, at, &measure));
    canvas.draw_clipped(area, shapes);
}

/// Grid, ticks, numbers and names of both axes, and the frame.
fn axes(plot: &Plot, area: Bounds, ranges: &[std::ops::RangeInclusive<f64>; 2]) -> Vec<Shape> {
    let (mut grid, mut edges, mut texts) = (Vec::new(), Vec::new(), Vec::new());
    // The name of the y axis is next to its longest number.
    let mut widest = measure("0.0").x;
    let (corner, size) = (Vec2::new(area.min.x, area.max.y), area.size());
    let (right, up) = (Vec2::new(size.x, 0.0), Vec2::new(0.0, -size.y));
    // Each with the room for a number, the directions along and across it, that of its ticks, and the place of numbers.
    let axes = [
        (&plot.x, 50.0_f32, right, up, Vec2::Y, 15.0, Align::Middle),
        (&plot.y, 28.0, up, right, Vec2::NEG_X, 7.0, Align::End),
    ];
    for ((axis, number, along, across, away, beyond, align), range) in axes.into_iter().zip(ranges) {
        let number = f64::from(number / along.length());
        let ticks = axis.ticks(range, number * (range.end() - range.start()));
        for &place in &ticks.places {
            let from = corner + along * share(place, range) as f32;
            let text = axis.tick_text(place, ticks.step);
            if align == Align::End {
                widest = widest.max(measure(&text).x);
            }
            grid.push(Shape::line(from, from + across, Ink::Grid, 0.7));
            edges.push(Shape::line(from, from + 4.0 * away, DIM, 1.0));
            texts.push(Shape::text(from + beyond * away, align, TEXT_INK, text));
        }
    }
    let below = Vec2::new(area.middle().x, area.max.y + 33.0);
    texts.push(Shape::text(below, Align::Middle, TEXT_INK, &*plot.x.name));
    let beside = Vec2::new(area.min.x - 19.0 - widest, area.middle().y);
    texts.push(Shape::text(beside, Align::Upright, TEXT_INK, &*plot.y.name));
    edges.push(area.outline(Stroke::new(DIM, 1.0)));
    grid.into_iter().chain(edges).chain(texts).collect()
}

fn draw_map(map: &HeatMap) -> Picture {
    let longest = map.columns.iter().map(|name| measure(name).x).fold(0.0, f32::max);
    let height = (34.0 * map.values.nrows() as f32 + 40.0).max(190.0) + longest;
    let mut canvas = Canvas::new(Vec2::new(500.0, height));
    let area = Bounds::of_size(Vec2::new(8.0, 14.0), Vec2::new(484.0, height - 22.0));
    canvas.draw(map.lay_out(area, &measure).shapes);
    canvas.finish()
}

/// Room for the title of a card of a surface.
const TITLE: f32 = 22.0;

/// Draws surfaces side by side, as wide as a page. A colour bar is drawn to the right of the last card that it belongs to.
fn draw_surfaces(figure: &SurfaceFigure) -> Picture {
    const KEY: f32 = Surface::SCALE_WIDTH;
    let scales: Vec<_> = figure.surfaces.iter().map(Surface::scale).collect();
    let has_key = |card: usize| scales.get(card + 1) != Some(&scales[card]);
    let keys = (0..scales.len()).filter(|&card| has_key(card)).count();
    let width = (PAGE_WIDTH - keys as f32 * KEY) / scales.len().max(1) as f32;
    let height = (0.98 * width).clamp(206.0, 400.0);
    let (mut cards, mut corner) = (Vec::new(), Vec2::new(0.0, TITLE));
    for (card, surface) in figure.surfaces.iter().enumerate() {
        let bounds = Bounds::of_size(corner, Vec2::new(width, height));
        let drawing = surface.lay_out(figure.camera, bounds, &measure, colours(surface));
        cards.push((bounds, surface, drawing));
        corner.x += width + if has_key(card) { KEY } else { 0.0 };
    }
    let below = TITLE + height + 0.5 * LINE;
    let has_notes = cards.iter().any(|(_, _, drawing)| drawing.note.is_some());
    let last = below + if has_notes { LINE } else { 0.0 };
    let mut canvas = Canvas::new(Vec2::new(PAGE_WIDTH, last + 0.6 * LINE));
    for (card, (bounds, surface, drawing)) in cards.into_iter().enumerate() {
        let title = Vec2::new(bounds.middle().x, 0.5 * TITLE);
        canvas.draw([Shape::text(title, Align::Middle, TEXT_INK, &*surface.title)]);
        let section = figure.section.map(|section| section.shapes(surface, &drawing.sight));
        let dots = drawing.dots.shapes(figure.marked_node, &figure.lit_nodes);
        let shapes = drawing.frame.into_iter().chain(drawing.mesh.shapes());
        canvas.draw_clipped(bounds, shapes.chain(section.into_iter().flatten()).chain(dots));
        if has_key(card) {
            let corner = Vec2::new(bounds.max.x, bounds.min.y);
            let area = Bounds::of_size(corner, Vec2::new(KEY, height));
            canvas.draw(surface.lay_out_scale(area, colours(surface), &measure));
        }
        let at = Vec2::new(bounds.min.x + 16.0, below);
        let write = |note| Shape::text(at, Align::Start, Ink::Hue(Hue::Orange), note);
        canvas.draw(drawing.note.map(write));
    }
    canvas.draw([Shape::text(Vec2::new(16.0, last), Align::Start, DIM, figure.note())]);
    canvas.finish()
}

fn colours(surface: &Surface) -> &'static ColourMap {
    static DIVERGING: OnceLock<ColourMap> = OnceLock::new();
    const STOPS: [Rgb; 5] = [
        [0x0b, 0x3d, 0x91],
        [0x5b, 0x9b, 0xe6],
        [0xff; 3],
        [0xf0, 0x87, 0x5a],
        [0x9a, 0x2c, 0x06],
    ];
    match surface.quantity.is_diverging() {
        true => DIVERGING.get_or_init(|| ColourMap::diverging(STOPS)),
        false => surface.colours.colours(),
    }
}
