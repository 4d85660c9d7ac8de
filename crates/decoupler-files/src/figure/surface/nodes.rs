//! The nodes as dots on the surface, and picking of nodes with the pointer.

use glam::{DVec3, Vec2};

use super::{
    Surface,
    camera::{Ray, Sight},
    field::Field,
};
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
    pub(super) fn new(surface: &Surface, field: &Field<'_>, sight: &Sight) -> Self {
        let (low, high) = field.box_mm();
        let dot = |node: &DVec3| {
            node.is_finite().then(|| {
                let within = node.clamp(low, high);
                let is_beyond = match sight.is_above {
                    false => within != *node,
                    true => within.truncate() != node.truncate(),
                };
                Dot {
                    at: sight.drawn(within),
                    is_hidden: !sight.is_above && is_hidden(within, surface, field, sight),
                    is_beyond,
                }
            })
        };
        Self {
            dots: surface.nodes.iter().map(dot).collect(),
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

/// Returns true if the surface is in the line of sight from the eye to a node.
fn is_hidden(node: DVec3, surface: &Surface, field: &Field<'_>, sight: &Sight) -> bool {
    let shown = field.shown();
    // From a little above: nodes on a crest stay visible although the grid is coarser than the surface.
    let from_mm = node + DVec3::Z * (0.01 * (shown.end() - shown.start()));
    let direction = sight.eye_mm() - from_mm;
    surface.pick(&Ray { from_mm, direction }).is_some()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use decoupler_core::surface::SurfaceMap;

    use super::*;
    use crate::figure::{
        SequentialMap,
        surface::{OrbitCamera, Quantity, ViewMode, camera::PlotBox},
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
            let (min_mm, max_mm) = field.box_mm();
            let screen = Bounds::of([Vec2::ZERO, Vec2::splat(400.0)]);
            let sight = Sight::fit(PlotBox::new(min_mm, max_mm, 1.0), Some(camera), screen);
            is_hidden(DVec3::new(1.0, 1.0, 4.2), &surface, &field, &sight)
        };
        assert!(hidden(5.0), "walls around it hide it");
        assert!(!hidden(f64::NAN), "nothing does");
    }
}
