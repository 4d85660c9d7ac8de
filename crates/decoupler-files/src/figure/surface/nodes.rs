//! The nodes as dots on the surface, and picking of nodes with the pointer.

use decoupler_core::surface::Grid;
use glam::{DVec3, Vec2};

use super::{drawing::Projector, field::Field};
use crate::figure::{
    Hue,
    drawing::{Bounds, Ink, Shape},
};

/// Distance within which the pointer selects a node, in points.
const REACH: f32 = 10.0;
const HIDDEN_OPACITY: f32 = 0.1;
/// Dots are not drawn if there are more than this and they are closer than that.
const CROWD: usize = 400;
const CROWDED: f32 = 10.0;

/// A node on the screen.
#[derive(Clone, Copy, Debug)]
struct Dot {
    at: Vec2,
    is_hidden: bool,
    /// True if it is beyond the axes and drawn at their edge.
    is_beyond: bool,
}

/// The nodes of a surface as dots. Nodes without a value have no dot.
#[derive(Clone, Debug, Default)]
pub struct Dots {
    dots: Vec<Option<Dot>>,
}

impl Dots {
    pub(super) fn new(nodes: &[DVec3], field: &Field<'_>, stage: &Projector<'_>) -> Self {
        let (low, high) = field.box_mm();
        let dot = |node: &DVec3| {
            node.is_finite().then(|| {
                let within = node.clamp(low, high);
                let is_beyond = match stage {
                    Projector::Space(_) => within != *node,
                    Projector::Plan(_) => within.truncate() != node.truncate(),
                };
                Dot {
                    at: stage.point(within),
                    is_hidden: is_hidden(within, field, stage),
                    is_beyond,
                }
            })
        };
        Self {
            dots: nodes.iter().map(dot).collect(),
        }
    }

    /// Number of nodes beyond the axes, which are drawn at their edge.
    pub(super) fn beyond(&self) -> usize {
        self.dots.iter().flatten().filter(|dot| dot.is_beyond).count()
    }

    /// Returns the visible node nearest to `place`, if it is near.
    pub fn nearest(&self, place: Vec2) -> Option<usize> {
        let visible = |(node, dot): (usize, &Option<Dot>)| {
            let dot = dot.filter(|dot| !dot.is_hidden)?;
            Some((node, dot.at.distance(place)))
        };
        let near = self.dots.iter().enumerate().filter_map(visible);
        near.filter(|(_, distance)| *distance <= REACH)
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(node, _)| node)
    }

    /// Returns the position of a node on the screen.
    pub fn position(&self, node: usize) -> Option<Vec2> {
        self.dots.get(node).copied().flatten().map(|dot| dot.at)
    }

    /// Returns the dots in the order of painting, with rings around the nodes `lit` and a mark around one node.
    pub fn shapes(&self, marked: Option<usize>, lit: &[usize]) -> Vec<Shape> {
        let mut shapes = Vec::new();
        let mut circle = |at, radius, ring, ink: Ink, opacity| {
            let colour = ink.at(opacity);
            shapes.push(Shape::Circle {
                at,
                radius,
                ring,
                colour,
            });
        };
        let (accent, warning) = (Ink::Hue(Hue::Blue), Ink::Hue(Hue::Orange));
        let radius = self.radius();
        for dot in self.dots.iter().flatten().filter(|_| radius > 0.0) {
            let opacity = if dot.is_hidden { HIDDEN_OPACITY } else { 1.0 };
            let ink = if dot.is_beyond { warning } else { Ink::WHITE };
            circle(dot.at, radius + 0.75, None, Ink::BLACK, 0.45 * opacity);
            circle(dot.at, radius, None, ink, opacity);
        }
        for at in lit.iter().filter_map(|&node| self.position(node)) {
            circle(at, 4.5, Some(2.5), Ink::Ground, 0.8);
            circle(at, 4.5, Some(1.5), accent, 1.0);
        }
        if let Some(at) = marked.and_then(|node| self.position(node)) {
            circle(at, 3.0, None, accent, 1.0);
            circle(at, 6.5, Some(3.5), Ink::Ground, 0.8);
            circle(at, 6.5, Some(1.5), Ink::Hue(Hue::Ink), 1.0);
        }
        shapes
    }

    /// Dots shrink if there are many of them, and disappear if they would cover the surface.
    fn radius(&self) -> f32 {
        let size = Bounds::of(self.dots.iter().flatten().map(|dot| dot.at)).size();
        let spacing = (size.x * size.y / self.dots.len().max(1) as f32).sqrt();
        if self.dots.len() > CROWD && spacing < CROWDED {
            0.0
        } else {
            (0.07 * spacing).clamp(0.8, 1.8)
        }
    }
}

/// Walks from the node towards the eye and checks whether the surface rises above the line of sight.
fn is_hidden(node: DVec3, field: &Field<'_>, stage: &Projector<'_>) -> bool {
    let Projector::Space(projection) = stage else {
        return false;
    };
    let plot_box = projection.plot_box;
    let (low, high) = (plot_box.min_mm.z, plot_box.max_mm.z);
    let sight = plot_box.place_mm(projection.eye) - node;
    // A tolerance keeps nodes on a crest visible although the grid is coarser than the surface.
    let tolerance = 0.01 * (high - low);
    line_of_sight(node, sight, field.grid)
        .take_while(|(place, _)| place.z <= high)
        .any(|(place, point)| {
            // A gap hides nothing.
            let value = field.values[point];
            value.is_finite() && value.min(high) > place.z + tolerance
        })
}

/// Places from a little off `node` towards the eye, as long as they lie over the grid; each with the grid point before
/// it.
fn line_of_sight(node: DVec3, sight: DVec3, grid: &Grid) -> impl Iterator<Item = (DVec3, usize)> {
    let (x_mm, y_mm) = (grid.x_mm(), grid.y_mm());
    // Half a cell along the axis on which cells are crossed faster: for arrays of any shape, the number of steps to the
    // edge is proportional to the number of points.
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
    use std::sync::Arc;

    use decoupler_core::surface::SurfaceMap;

    use super::*;
    use crate::figure::{
        SequentialMap,
        surface::{
            OrbitCamera, Quantity, Surface, ViewMode,
            camera::{PlotBox, Projection},
        },
    };

    #[test]
    fn a_stretched_array_takes_no_more_steps_than_a_square_one() {
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

    #[test]
    fn a_gap_hides_no_node() {
        let places = Vec::from_iter((0..4).map(f64::from));
        let map = Arc::new(SurfaceMap::new(&places, &places).unwrap());
        let camera = OrbitCamera::default();
        let hidden = |elsewhere: f64| {
            // Level around the node, `elsewhere` at all other places.
            let grid = map.grid();
            let values = grid
                .x_mm()
                .iter()
                .flat_map(|&x| grid.y_mm().iter().map(move |&y| (x, y)));
            let values = values.map(|(x, y)| if (x - 1.0).hypot(y - 1.0) < 0.2 { 4.2 } else { elsewhere });
            let surface = Surface {
                title: String::new(),
                values: values.collect(),
                nodes: Arc::new([]),
                map: Arc::clone(&map),
                quantity: Quantity::Height,
                range: 4.0..=5.0,
                mode: ViewMode::ThreeD,
                colours: SequentialMap::default(),
            };
            let field = Field::new(&surface);
            let (min_mm, max_mm) = field.box_mm();
            let screen = Bounds::of([Vec2::ZERO, Vec2::splat(400.0)]);
            let projection = Projection::fit(PlotBox::new(min_mm, max_mm, 1.0), camera, screen);
            is_hidden(DVec3::new(1.0, 1.0, 4.2), &field, &Projector::Space(&projection))
        };
        assert!(hidden(5.0), "walls around it hide it");
        assert!(!hidden(f64::NAN), "nothing does");
    }
}
