//! The nodes as dots on the surface, and picking of nodes with the pointer.

use glam::{DVec3, Vec2};

use super::{
    ViewMode,
    camera::{Ray, Sight},
    field::Field,
};
use crate::figure::{
    Hue,
    drawing::{Bounds, Ink, Shape, Stroke},
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
pub struct Dots(Vec<Option<Dot>>);

impl Dots {
    pub(super) fn new(field: &Field<'_>, sight: &Sight) -> Self {
        let [low, high] = field.box_mm();
        let dot = |node: &DVec3| {
            let within = node.clamp(low, high);
            let is_map = field.surface.mode == ViewMode::Top;
            node.is_finite().then(|| Dot {
                at: sight.drawn(within),
                is_hidden: !is_map && is_hidden(within, field, sight),
                is_beyond: within.truncate() != node.truncate() || (!is_map && within.z != node.z),
            })
        };
        Self(field.surface.nodes.iter().map(dot).collect())
    }

    /// Number of nodes beyond the axes, which are drawn at their edge.
    pub(super) fn beyond(&self) -> usize {
        self.0.iter().flatten().filter(|dot| dot.is_beyond).count()
    }

    /// Returns the visible node nearest to `place`, if it is near.
    pub fn nearest(&self, place: Vec2) -> Option<usize> {
        let distance = |dot: &Option<Dot>| Some(dot.filter(|dot| !dot.is_hidden)?.at.distance(place));
        let nodes = self.0.iter().enumerate();
        let near = nodes.filter_map(|(node, dot)| Some((node, distance(dot).filter(|it| *it <= REACH)?)));
        near.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(node, _)| node)
    }

    /// Returns the position of a node on the screen.
    pub fn position(&self, node: usize) -> Option<Vec2> {
        Some((*self.0.get(node)?)?.at)
    }

    /// Returns the dots in the order of painting, with rings around the nodes `lit` and a mark around one node.
    pub fn shapes(&self, marked: Option<usize>, lit: &[usize]) -> Vec<Shape> {
        let mut shapes = Vec::new();
        let accent = Ink::Hue(Hue::Blue);
        let ring = |at, radius, width: [f32; 2], ink: Ink| {
            let under = Stroke::new(Ink::Ground.at(0.8), width[0]);
            [
                Shape::Ring(at, radius, under),
                Shape::Ring(at, radius, Stroke::new(ink, width[1])),
            ]
        };
        let radius = self.radius();
        for dot in self.0.iter().flatten().filter(|_| radius > 0.0) {
            let opacity = if dot.is_hidden { HIDDEN_OPACITY } else { 1.0 };
            let ink = if dot.is_beyond {
                Ink::Hue(Hue::Orange)
            } else {
                Ink::WHITE
            };
            shapes.push(Shape::Disc(dot.at, radius + 0.75, Ink::BLACK.at(0.45 * opacity)));
            shapes.push(Shape::Disc(dot.at, radius, ink.at(opacity)));
        }
        for at in lit.iter().filter_map(|&node| self.position(node)) {
            shapes.extend(ring(at, 4.5, [2.5, 1.5], accent));
        }
        if let Some(at) = marked.and_then(|node| self.position(node)) {
            shapes.push(Shape::Disc(at, 3.0, accent.into()));
            shapes.extend(ring(at, 6.5, [3.5, 1.5], Ink::Hue(Hue::Ink)));
        }
        shapes
    }

    /// Dots shrink if there are many of them, and disappear if they would cover the surface.
    fn radius(&self) -> f32 {
        let size = Bounds::of(self.0.iter().flatten().map(|dot| dot.at)).size();
        let spacing = (size.x * size.y / self.0.len().max(1) as f32).sqrt();
        match self.0.len() > CROWD && spacing < CROWDED {
            true => 0.0,
            false => (0.07 * spacing).clamp(0.8, 1.8),
        }
    }
}

/// Returns true if the surface is in the line of sight from the eye to a node.
fn is_hidden(node: DVec3, field: &Field<'_>, sight: &Sight) -> bool {
    // From a little above: nodes on a crest stay visible although the grid is coarser than the surface.
    let from_mm = node + DVec3::Z * (0.01 * (field.shown[1] - field.shown[0]));
    let direction = sight.eye_mm() - from_mm;
    field.surface.pick(&Ray { from_mm, direction }).is_some()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use decoupler_core::surface::SurfaceMap;

    use super::*;
    use crate::figure::{
        SequentialMap,
        surface::{OrbitCamera, Quantity, Surface, camera::PlotBox},
    };

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
            let screen = Bounds::of([Vec2::ZERO, Vec2::splat(400.0)]);
            let sight = Sight::fit(PlotBox::new(field.box_mm(), 1.0), Some(camera), screen);
            is_hidden(DVec3::new(1.0, 1.0, 4.2), &field, &sight)
        };
        assert!(hidden(5.0), "walls around it hide it");
        assert!(!hidden(f64::NAN), "nothing does");
    }
}
