//! The nodes as dots on the surface, and which of them the pointer is on.

use eframe::egui::{Color32, Painter, Pos2, Rect, Stroke};
use glam::DVec3;

use super::mesh::{Stage, Surface};
use crate::{app::theme::Theme, surface::Grid};

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
    /// Whether it lies beyond the axes and is drawn at their edge.
    is_beyond: bool,
}

/// Where the nodes are, and whether the surface hides them. Nodes without a value have no dot.
pub(super) fn dots(nodes: &[DVec3], surface: &Surface<'_>, stage: &Stage<'_>) -> Vec<Option<Dot>> {
    let (low, high) = surface.box_mm();
    let dot = |node: &DVec3| {
        node.is_finite().then(|| {
            let within = node.clamp(low, high);
            let is_beyond = match stage {
                Stage::Space(_) => within != *node,
                Stage::Plan(_) => within.truncate() != node.truncate(),
            };
            Dot {
                at: stage.point(within),
                is_hidden: is_hidden(within, surface, stage),
                is_beyond,
            }
        })
    };
    nodes.iter().map(dot).collect()
}

/// How many nodes lie beyond the axes.
pub(super) fn beyond(dots: &[Option<Dot>]) -> usize {
    dots.iter().flatten().filter(|dot| dot.is_beyond).count()
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
        let colour = if dot.is_beyond {
            theme.palette.warning
        } else {
            Color32::WHITE
        };
        painter.circle_filled(dot.at, radius + 0.75, Color32::BLACK.gamma_multiply(0.45 * opacity));
        painter.circle_filled(dot.at, radius, colour.gamma_multiply(opacity));
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
fn is_hidden(node: DVec3, surface: &Surface<'_>, stage: &Stage<'_>) -> bool {
    let Stage::Space(projection) = stage else { return false };
    let plot_box = projection.plot_box;
    let (low, high) = (plot_box.min_mm.z, plot_box.max_mm.z);
    let sight = plot_box.place_mm(projection.eye) - node;
    // A tolerance keeps nodes on a crest visible although the grid is coarser than the surface.
    let tolerance = 0.01 * (high - low);
    line_of_sight(node, sight, surface.grid)
        .take_while(|(place, _)| place.z <= high)
        .any(|(place, point)| surface.values[point].min(high) > place.z + tolerance)
}

/// Places from a little off `node` towards the eye, as long as they lie over the grid; each with the grid point before
/// it.
fn line_of_sight(node: DVec3, sight: DVec3, grid: &Grid) -> impl Iterator<Item = (DVec3, usize)> {
    let (x_mm, y_mm) = (grid.x_mm(), grid.y_mm());
    // Half a cell of the axis along which cells are crossed faster: however stretched the array, so many steps lead
    // off the grid as it has points.
    let cells = |sight_mm: f64, points_mm: &[f64]| sight_mm.abs() / (points_mm[1] - points_mm[0]);
    let step = 0.5 / cells(sight.x, x_mm).max(cells(sight.y, y_mm)).max(0.5);
    let cell = |points: &[f64], at: f64| {
        let upper = points.partition_point(|point| *point < at);
        (upper > 0 && upper < points.len()).then(|| upper - 1)
    };
    (3..)
        .map(move |count| node + sight * (step * f64::from(count)))
        .map_while(move |place| Some((place, grid.index(cell(x_mm, place.x)?, cell(y_mm, place.y)?))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::SurfaceMap;

    #[test]
    fn looking_along_a_stretched_array_takes_as_few_steps_as_along_a_square_one() {
        for (row_pitch_mm, node_pitch_mm) in [(1.0, 2.0), (1e6, 1.0), (1.0, 1e6), (1e-6, 1.0), (1.0, 1e-6)] {
            let nodes = |pitch: f64| -> Vec<f64> { (0..10).map(|node| pitch * f64::from(node)).collect() };
            let map = SurfaceMap::new(&nodes(row_pitch_mm), &nodes(node_pitch_mm)).unwrap();
            let grid = map.grid();
            let points = grid.x_mm().len() + grid.y_mm().len();
            let corner = DVec3::new(grid.x_mm()[1], grid.y_mm()[1], 0.0);
            let far = DVec3::new(grid.x_mm()[points / 2 - 2], grid.y_mm()[points / 2 - 2], 0.0);
            // Eyes beyond the far corner, far out along either side, and almost above.
            for sight in [
                far - corner,
                (far - corner) * 1e3,
                (far - corner).with_y(0.0),
                DVec3::new(0.0, 0.0, 1.0),
            ] {
                let steps = line_of_sight(corner, sight, grid)
                    .take_while(|(place, _)| place.z <= 1.0)
                    .take(100_000)
                    .count();
                assert!(
                    steps <= 2 * points,
                    "{steps} steps over {points} points, pitches {row_pitch_mm} and {node_pitch_mm}, sight {sight}"
                );
            }
        }
    }
}
