//! The layout of figures in print: plots within their axes, the legend above them, surfaces side by side.

use std::{ops::RangeInclusive, sync::LazyLock};

use glam::Vec2;

use super::picture::{Layer, PAGE_WIDTH, Picture, TEXT, measure};
use crate::figure::{
    Align, Bounds, ColourMap, Figure, Form, HeatMap, Ink, Plot, PlotFigure, Series, Shape, Stroke,
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
const TEXT_INK: Ink = Ink::Text;
const DIM: Ink = Ink::Grey;

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
    let (count, is_stacked) = (figure.plots.len().max(1) as f32, figure.is_stacked);
    let plot_width = if is_stacked { width } else { width / count } - LEFT - RIGHT;
    let plot_height = if is_square { plot_width } else { PLOT_HEIGHT };
    let next = match is_stacked {
        true => Vec2::new(0.0, plot_height + BOTTOM),
        false => Vec2::new(plot_width + LEFT + RIGHT, 0.0),
    };
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
    let plots = figure.plots.iter().enumerate().flat_map(|(index, plot)| {
        let corner = Vec2::new(LEFT, top) + index as f32 * next;
        lay_out(plot, Bounds::of_size(corner, Vec2::new(plot_width, plot_height)))
    });
    let layers = std::iter::once((None, shapes)).chain(plots);
    let height = top + plot_height + BOTTOM + (count - 1.0) * next.y;
    Picture::new(Vec2::new(width, height), &Vec::from_iter(layers))
}

/// Lays the plot out within `area`; names and numbers are outside it.
fn lay_out(plot: &Plot, area: Bounds) -> [Layer; 2] {
    let ranges @ [_, y_range] = &plot.ranges();
    let at = |place: [f64; 2]| area.at(place, ranges);
    let (mut behind, mut lines, mut shapes) = (Vec::new(), Vec::new(), Vec::new());
    for (Series { look, .. }, line) in plot.lines_across() {
        let Some(corners) = plot.corners(line, ranges) else {
            continue;
        };
        let [from, to] = corners.map(at);
        match look.line {
            Some(style) => lines.push(Shape::Line(vec![from, to], style.stroke(look.ink))),
            None => behind.push(Bounds::of([from, to]).area(look.ink.at(0.12))),
        }
    }
    behind.extend(axes(plot, area, ranges));
    for series in &plot.series {
        if series.form == Form::Band {
            shapes.extend(plot.bands(series).iter().flat_map(|band| band.windows(2)).map(|ends| {
                let [from, to] = [ends[0], ends[1]];
                let corners = [[from[0], from[1]], [from[0], from[2]], [to[0], to[2]], [to[0], to[1]]];
                Shape::Area(corners.map(at).to_vec(), series.look.ink.at(0.2))
            }));
        }
        let Form::Bars(width) = series.form else { continue };
        for (_, [x, y]) in plot.placed(series) {
            let [left, right] = [-0.5, 0.5].map(|half| at([x + half * width, y]));
            if left.y < area.max.y {
                let bar = Bounds::of([left, Vec2::new(right.x, area.max.y)]);
                shapes.push(bar.area(series.look.ink));
            }
        }
    }
    shapes.extend(lines);
    for series in &plot.series {
        let look = series.look;
        if let Some(style) = look.line {
            let stretches = plot.stretches(series).into_iter();
            let stretches = stretches.map(|places| places.into_iter().map(at).collect());
            shapes.extend(stretches.map(|points| Shape::Line(points, style.stroke(look.ink))));
        }
        for (point, [x, _]) in plot.placed(series).filter(|_| series.form == Form::Points) {
            let Some(ends) = point.bar else { continue };
            let [low, high] = plot.bar_ends(ends, y_range).map(|end| at([x, end]));
            let cap = Vec2::new(3.0, 0.0);
            let lines = [[low, high], [low - cap, low + cap], [high - cap, high + cap]];
            shapes.extend(lines.map(|[from, to]| Shape::line(from, to, look.ink, 1.1)));
        }
        shapes.extend(plot.placed(series).filter_map(|(_, place)| look.mark(at(place))));
    }
    shapes.extend(plot.lay_out_labels(area, at, &measure));
    [(None, behind), (Some(area), shapes)]
}

/// Grid, ticks, numbers and names of both axes, and the frame.
fn axes(plot: &Plot, area: Bounds, ranges: &[RangeInclusive<f64>; 2]) -> Vec<Shape> {
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
        for (share, text) in axis.numbers(range, number / along.length()) {
            let from = corner + along * share as f32;
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
    [grid, edges, texts].concat()
}

fn draw_map(map: &HeatMap) -> Picture {
    let longest = map.columns.iter().map(|name| measure(name).x).fold(0.0, f32::max);
    let height = (34.0 * map.values.nrows() as f32 + 40.0).max(190.0) + longest;
    let area = Bounds::of_size(Vec2::new(8.0, 14.0), Vec2::new(484.0, height - 22.0));
    Picture::new(Vec2::new(500.0, height), &[(None, map.lay_out(area, &measure).shapes)])
}

/// Colours of errors on white paper.
static ERRORS: LazyLock<ColourMap> = LazyLock::new(|| {
    ColourMap::diverging([
        [0x0b, 0x3d, 0x91],
        [0x5b, 0x9b, 0xe6],
        [0xff; 3],
        [0xf0, 0x87, 0x5a],
        [0x9a, 0x2c, 0x06],
    ])
});
/// Room for the title of a card of a surface.
const TITLE: f32 = 22.0;

/// Draws surfaces side by side, as wide as a page. A colour bar is drawn to the right of the last card that it belongs to.
fn draw_surfaces(figure: &SurfaceFigure) -> Picture {
    const KEY: f32 = Surface::SCALE_WIDTH;
    let surfaces = &figure.surfaces;
    let has_key = |card: usize| surfaces.get(card + 1).map(Surface::scale) != Some(surfaces[card].scale());
    let keys = (0..surfaces.len()).filter(|&card| has_key(card)).count();
    let width = (PAGE_WIDTH - keys as f32 * KEY) / surfaces.len().max(1) as f32;
    let height = (0.98 * width).clamp(206.0, 400.0);
    let below = TITLE + height + 0.5 * LINE;
    let (mut layers, mut left, mut last) = (Vec::new(), 0.0, below);
    for (card, surface) in surfaces.iter().enumerate() {
        let bounds = Bounds::of_size(Vec2::new(left, TITLE), Vec2::new(width, height));
        let drawing = surface.lay_out(figure.camera, bounds, &measure, &ERRORS);
        let title = Vec2::new(bounds.middle().x, 0.5 * TITLE);
        layers.push((None, vec![Shape::text(title, Align::Middle, TEXT_INK, &*surface.title)]));
        let section = figure.section.map(|section| section.shapes(surface, &drawing.sight));
        let dots = drawing.dots.shapes(figure.marked_node, &figure.lit_nodes);
        let shapes = drawing.frame.into_iter().chain(drawing.mesh.shapes());
        let shapes = shapes.chain(section.into_iter().flatten()).chain(dots);
        layers.push((Some(bounds), shapes.collect()));
        left += width;
        let mut beside = Vec::new();
        if has_key(card) {
            let area = Bounds::of_size(Vec2::new(left, TITLE), Vec2::new(KEY, height));
            beside = surface.lay_out_scale(area, &measure, &ERRORS);
            left += KEY;
        }
        if let Some(note) = drawing.note {
            let at = Vec2::new(bounds.min.x + 16.0, below);
            beside.push(Shape::text(at, Align::Start, Ink::Orange, note));
            last = below + LINE;
        }
        layers.push((None, beside));
    }
    let note = Shape::text(Vec2::new(16.0, last), Align::Start, DIM, figure.note());
    layers.push((None, vec![note]));
    Picture::new(Vec2::new(PAGE_WIDTH, last + 0.6 * LINE), &layers)
}
