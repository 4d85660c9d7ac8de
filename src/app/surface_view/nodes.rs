//! The nodes as dots on the surface, and which of them the pointer is on.

use eframe::egui::{Color32, Painter, Pos2, Rect, Stroke};
use glam::DVec3;

use super::mesh::{Stage, Surface};
use crate::app::theme::Theme;

/// How near the pointer must be to a node, in points.
const REACH: f32 = 10.0;
const HIDDEN_OPACITY: f32 = 0.1;
/// More dots than this, nearer to each other than that, are not drawn.
const CROWD: usize = 400;
const CROWDED: f32 = 10.0;

/// A node on the screen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dot {
    at: Pos2,
    is_hidden: bool,
}

/// Where the nodes are, and whether the surface hides them. Nodes without a value have no dot.
pub(super) fn dots(nodes: &[DVec3], surface: &Surface<'_>, stage: &Stage<'_>) -> Vec<Option<Dot>> {
    let dot = |node: &DVec3| {
        node.is_finite().then(|| Dot {
            at: stage.point(node.x, node.y, node.z),
            is_hidden: is_hidden(node, surface, stage),
        })
    };
    nodes.iter().map(dot).collect()
}

/// The visible node nearest to the pointer, if it is near.
pub(super) fn nearest(dots: &[Option<Dot>], pointer: Pos2) -> Option<usize> {
    dots.iter()
        .enumerate()
        .filter_map(|(index, dot)| {
            dot.filter(|dot| !dot.is_hidden)
                .map(|dot| (index, dot.at.distance(pointer)))
        })
        .filter(|(_, distance)| *distance <= REACH)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(index, _)| index)
}

/// Where a node is on the screen.
pub(super) fn position(dots: &[Option<Dot>], node: usize) -> Option<Pos2> {
    dots.get(node).copied().flatten().map(|dot| dot.at)
}

pub(super) fn paint(painter: &Painter, dots: &[Option<Dot>], highlight: Option<usize>, theme: &Theme) {
    let radius = radius(dots);
    for dot in dots.iter().flatten().filter(|_| radius > 0.0) {
        let opacity = if dot.is_hidden { HIDDEN_OPACITY } else { 1.0 };
        painter.circle_filled(dot.at, radius + 0.75, Color32::BLACK.gamma_multiply(0.45 * opacity));
        painter.circle_filled(dot.at, radius, Color32::WHITE.gamma_multiply(opacity));
    }
    if let Some(at) = highlight.and_then(|node| position(dots, node)) {
        painter.circle_filled(at, 3.0, theme.palette.accent);
        painter.circle_stroke(at, 6.5, Stroke::new(3.5, theme.palette.panel.gamma_multiply(0.8)));
        painter.circle_stroke(at, 6.5, Stroke::new(1.5, theme.palette.text));
    }
}

/// Dots shrink when there are many of them, and go when they would cover the surface.
fn radius(dots: &[Option<Dot>]) -> f32 {
    let mut bounds = Rect::NOTHING;
    for dot in dots.iter().flatten() {
        bounds.extend_with(dot.at);
    }
    let spacing = (bounds.area() / dots.len().max(1) as f32).sqrt();
    if dots.len() > CROWD && spacing < CROWDED {
        0.0
    } else {
        (0.07 * spacing).clamp(0.8, 1.8)
    }
}

/// Walks from the node towards the eye and looks whether the surface rises above the line of sight.
fn is_hidden(node: &DVec3, surface: &Surface<'_>, stage: &Stage<'_>) -> bool {
    let Stage::Space(projection) = stage else { return false };
    let plot_box = projection.plot_box;
    let (low, high) = (plot_box.min_mm.z, plot_box.max_mm.z);
    let start = DVec3::new(node.x, node.y, node.z.clamp(low, high));
    let sight = plot_box.place_mm(projection.eye) - start;
    let (x_mm, y_mm) = (surface.grid.x_mm(), surface.grid.y_mm());
    // Half a cell of the axis along which cells are crossed faster: however stretched the array, so many steps lead
    // off the grid as it has points.
    let cells = |sight_mm: f64, points_mm: &[f64]| sight_mm.abs() / (points_mm[1] - points_mm[0]);
    let step = 0.5 / cells(sight.x, x_mm).max(cells(sight.y, y_mm)).max(0.5);
    // A tolerance keeps nodes on a crest visible although the grid is coarser than the surface.
    let tolerance = 0.01 * (high - low);
    (3..)
        .map(|count| start + sight * (step * f64::from(count)))
        .take_while(|place| place.z <= high)
        .find_map(|place| {
            let cell = |points: &[f64], at: f64| {
                let upper = points.partition_point(|point| *point < at);
                (upper > 0 && upper < points.len()).then(|| upper - 1)
            };
            let (Some(ix), Some(iy)) = (cell(x_mm, place.x), cell(y_mm, place.y)) else {
                return Some(false);
            };
            (surface.values[surface.grid.index(ix, iy)].min(high) > place.z + tolerance).then_some(true)
        })
        == Some(true)
}
