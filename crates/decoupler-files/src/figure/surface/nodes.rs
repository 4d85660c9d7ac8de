//! The nodes as dots on the surface, and the place on the surface under the pointer.

use glam::{DVec3, Vec2};

use super::{
    Surface, ViewMode,
    camera::{Ray, Sight},
    section::cell,
};
use crate::figure::{
    Ink,
    drawing::{Bounds, Shape, Stroke},
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
    pub(super) fn new(surface: &Surface, sight: &Sight) -> Self {
        let [low, high] = surface.box_mm();
        let dot = |node: &DVec3| {
            let within = node.clamp(low, high);
            let is_map = surface.mode == ViewMode::Top;
            node.is_finite().then(|| Dot {
                at: sight.drawn(within),
                is_hidden: !is_map && is_hidden(within, surface, sight),
                is_beyond: within.truncate() != node.truncate() || (!is_map && within.z != node.z),
            })
        };
        Self(surface.nodes.iter().map(dot).collect())
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
        let ring = |at, radius, [under, over]: [f32; 2], ink: Ink| {
            let strokes = [Stroke::new(Ink::Ground.at(0.8), under), Stroke::new(ink, over)];
            strokes.map(|stroke| Shape::Ring(at, radius, stroke))
        };
        let (mut shapes, radius) = (Vec::new(), self.radius());
        for dot in self.0.iter().flatten().filter(|_| radius > 0.0) {
            let opacity = if dot.is_hidden { HIDDEN_OPACITY } else { 1.0 };
            let ink = if dot.is_beyond { Ink::Orange } else { Ink::WHITE };
            shapes.push(Shape::Disc(dot.at, radius + 0.75, Ink::BLACK.at(0.45 * opacity)));
            shapes.push(Shape::Disc(dot.at, radius, ink.at(opacity)));
        }
        for at in lit.iter().filter_map(|&node| self.position(node)) {
            shapes.extend(ring(at, 4.5, [2.5, 1.5], Ink::Blue));
        }
        if let Some(at) = marked.and_then(|node| self.position(node)) {
            shapes.push(Shape::Disc(at, 3.0, Ink::Blue.into()));
            shapes.extend(ring(at, 6.5, [3.5, 1.5], Ink::Text));
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
fn is_hidden(node: DVec3, surface: &Surface, sight: &Sight) -> bool {
    // From a little above: nodes on a crest stay visible although the grid is coarser than the surface.
    let from_mm = node + DVec3::Z * (0.01 * (surface.shown()[1] - surface.shown()[0]));
    let direction = sight.eye_mm() - from_mm;
    surface.pick(&Ray { from_mm, direction }).is_some()
}

/// Tolerance, as a fraction of a triangle, that keeps rays from slipping between two triangles.
const CRACK: f64 = 1e-9;

impl Surface {
    /// Returns the place where `ray` first hits the surface as it is drawn; `None` if it misses it.
    pub fn pick(&self, ray: &Ray) -> Option<DVec3> {
        let grid = self.map.grid();
        crossings(self, ray).windows(2).find_map(|pair| {
            let middle = ray.at(0.5 * (pair[0] + pair[1]));
            let (ix, iy) = (cell(grid.x_mm(), middle.x)?, cell(grid.y_mm(), middle.y)?);
            let corners @ [a, b, c, d] = self.cell_mm(ix, iy)?.map(|corner| self.drawn(corner));
            // Most cells are well above or below the ray.
            let [here, there] = [pair[0], pair[1]].map(|share| ray.at(share).z);
            let is_below = corners.iter().all(|corner| corner.z + CRACK < here.min(there));
            let is_above = corners.iter().all(|corner| corner.z - CRACK > here.max(there));
            if (is_below || is_above) && !ray.is_vertical() {
                return None;
            }
            let hits = [[a, b, c], [a, c, d]].map(|corners| share_at(ray, corners));
            let nearest = hits.into_iter().flatten().min_by(f64::total_cmp);
            nearest.map(|share| ray.at(share))
        })
    }
}

/// Parameters of the ray at its origin and where, seen from above, it crosses the lines of the grid, in ascending order.
fn crossings(surface: &Surface, ray: &Ray) -> Vec<f64> {
    if ray.is_vertical() {
        // It stays over one cell.
        return vec![-1.0, 1.0];
    }
    let (x_mm, y_mm) = (surface.map.grid().x_mm(), surface.map.grid().y_mm());
    let on_x = x_mm.iter().map(|x| (x - ray.from_mm.x) / ray.direction.x);
    let on_y = y_mm.iter().map(|y| (y - ray.from_mm.y) / ray.direction.y);
    let ahead = on_x.chain(on_y).filter(|share| *share > 0.0 && share.is_finite());
    let mut crossings = Vec::from_iter(ahead.chain([0.0]));
    crossings.sort_by(f64::total_cmp);
    crossings
}

/// Returns the parameter of the ray at which it hits a triangle (Möller and Trumbore 1997).
fn share_at(ray: &Ray, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (ab, ac, from) = (b - a, c - a, ray.from_mm - a);
    let across = ray.direction.cross(ac);
    let scale = 1.0 / ab.dot(across);
    let (along_b, other) = (scale * from.dot(across), from.cross(ab));
    let along_c = scale * ray.direction.dot(other);
    let is_inside = along_b >= -CRACK && along_c >= -CRACK && along_b + along_c <= 1.0 + CRACK;
    let share = scale * ac.dot(other);
    (is_inside && share.is_finite()).then_some(share)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use decoupler_core::surface::SurfaceMap;

    use super::*;
    use crate::figure::{
        SequentialMap,
        surface::{OrbitCamera, Quantity, camera::PlotBox},
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
            let screen = Bounds::of([Vec2::ZERO, Vec2::splat(400.0)]);
            let sight = Sight::fit(PlotBox::new(surface.box_mm(), 1.0), Some(camera), screen);
            is_hidden(DVec3::new(1.0, 1.0, 4.2), &surface, &sight)
        };
        assert!(hidden(5.0), "walls around it hide it");
        assert!(!hidden(f64::NAN), "nothing does");
    }
}

#[cfg(test)]
mod picking_tests {
    use std::sync::Arc;

    use glam::{DVec2, Vec2};

    use super::*;
    use crate::figure::{
        Bounds, SequentialMap,
        surface::{OrbitCamera, Quantity, Sight, ViewMode},
    };
    use decoupler_core::surface::SurfaceMap;

    /// A surface over 5 × 4 nodes at x = 8, 9 … and y = 3, 5 …
    fn surface(mode: ViewMode, height: impl Fn(f64, f64) -> f64) -> Surface {
        let (x, y) = ([8.0, 9.0, 10.0, 11.0, 12.0], [3.0, 5.0, 7.0, 9.0]);
        let map = Arc::new(SurfaceMap::new(&x, &y).unwrap());
        let nodes: Vec<DVec3> = x
            .iter()
            .flat_map(|&x| y.iter().map(move |&y| (x, y)))
            .map(|(x, y)| DVec3::new(x, y, height(x, y)))
            .collect();
        let values = map.evaluate(&nodes.iter().map(|node| node.z).collect::<Vec<_>>());
        Surface {
            title: String::new(),
            values: values.into(),
            nodes: nodes.into(),
            map,
            quantity: Quantity::Height,
            range: 4.0..=5.0,
            mode,
            colours: SequentialMap::default(),
        }
    }

    fn sight(surface: &Surface, camera: OrbitCamera) -> (Sight, super::super::Dots) {
        let card = Bounds::of_size(Vec2::new(10.0, 20.0), Vec2::new(360.0, 380.0));
        let measure = |text: &str| Vec2::new(6.0 * text.chars().count() as f32, 14.0);
        let drawing = surface.lay_out(camera, card, &measure, SequentialMap::default().colours());
        (drawing.sight, drawing.dots)
    }

    fn cameras() -> impl Iterator<Item = OrbitCamera> {
        (0..24).map(|turn| {
            let turned = OrbitCamera::default().dragged(61.0 * turn as f32, 11.0 * turn as f32 - 100.0);
            turned.panned(0.1, -0.05).zoomed(1.0 + 0.1 * turn as f32)
        })
    }

    /// The camera's limits allow views along the slopes, but not from below.
    fn slope(x: f64, y: f64) -> f64 {
        4.5 + 0.02 * (x - 10.0) - 0.03 * (y - 6.0)
    }

    #[test]
    fn a_place_is_picked_where_it_is_seen() {
        for (mode, camera) in cameras().flat_map(|camera| [(ViewMode::ThreeD, camera), (ViewMode::Top, camera)]) {
            let surface = surface(mode, slope);
            let (sight, dots) = sight(&surface, camera);
            for step in 0..60 {
                let (x, y) = (7.6 + 0.08 * f64::from(step), 2.1 + 0.129 * f64::from(step * 7 % 60));
                let place = DVec3::new(x, y, slope(x, y));
                let picked = surface.pick(&sight.ray(sight.point(place))).unwrap();
                assert!(picked.distance(place) < 1e-9, "{picked} for {place}, {camera:?}");
            }
            // The line of sight matches the picture.
            for (node, place) in surface.nodes.iter().enumerate() {
                let apart = sight.point(*place).as_vec2().distance(dots.position(node).unwrap());
                assert!(apart < 0.02, "{apart} points at {camera:?}");
            }
        }
    }

    #[test]
    fn near_parts_hide_far_ones() {
        // A ridge along y: behind it is a valley that a low eye cannot see into.
        let ridge = surface(ViewMode::ThreeD, |x, _| if x == 10.0 { 5.0 } else { 4.0 });
        let low = OrbitCamera {
            yaw: 0.0,
            pitch: 0.12,
            ..OrbitCamera::default()
        };
        let (sight, _) = sight(&ridge, low);
        let ray = sight.ray(sight.point(DVec3::new(9.0, 6.0, 4.0)));
        let picked = ridge.pick(&ray).unwrap();
        assert!(picked.x > 9.8, "the ridge hides the valley: {picked}");
        let (eye, end) = (ray.from_mm, DVec3::new(9.0, 6.0, 4.0));
        assert!(
            (picked - eye).normalize().dot((end - eye).normalize()) > 1.0 - 1e-12,
            "on the line of sight"
        );
        assert!(
            ridge.pick(&sight.ray(DVec2::new(12.0, 22.0))).is_none(),
            "next to the surface"
        );
    }

    #[test]
    fn gaps_have_no_place() {
        let mut surface = surface(ViewMode::Top, slope);
        let (sight, _) = sight(&surface, OrbitCamera::default());
        let ray = sight.ray(sight.point(DVec3::new(10.0, 6.0, 4.5)));
        assert!(surface.pick(&ray).is_some());
        surface.values = surface.values.iter().map(|_| f64::NAN).collect();
        assert!(surface.pick(&ray).is_none());
        surface.values = Arc::new([]);
        assert!(surface.pick(&ray).is_none());
    }

    #[test]
    fn a_level_is_reached_where_the_line_of_sight_has_that_height() {
        for camera in cameras() {
            let (sight, _) = sight(&surface(ViewMode::ThreeD, slope), camera);
            let place = DVec3::new(9.3, 4.4, 4.25);
            let met = sight.ray(sight.point(place)).at_level(4.25).unwrap();
            assert!(met.distance(place) < 1e-9, "{met}");
        }
        let level = Ray {
            from_mm: DVec3::ZERO,
            direction: DVec3::X,
        };
        assert_eq!(level.at_level(1.0), None);
        let away = Ray {
            from_mm: DVec3::Z,
            direction: DVec3::Z,
        };
        assert_eq!(away.at_level(5.0), Some(DVec3::new(0.0, 0.0, 5.0)));
    }

    #[test]
    fn a_node_is_moved_to_the_height_of_the_pointer() {
        let mut seen = 0;
        for camera in cameras() {
            let surface = surface(ViewMode::ThreeD, slope);
            let (sight, _) = sight(&surface, camera);
            let foot = DVec3::new(9.0, 7.0, 5.0);
            for height_mm in [4.0, 4.37, 5.0] {
                let at = sight.point(foot.with_z(height_mm));
                let along = (sight.point(foot.with_z(4.0)) - sight.point(foot)).normalize();
                // A pointer next to the line counts as on it.
                for offset in [0.0, 9.0] {
                    match sight.height_mm(foot, 1.0, at + offset * along.perp()) {
                        Some(found_mm) => {
                            assert!((found_mm - height_mm).abs() < 1e-9, "{found_mm} for {height_mm}");
                            seen += 1;
                        }
                        None => assert!(camera.pitch > 1.2, "{camera:?}"),
                    }
                }
            }
        }
        assert!(seen > 60, "{seen}");
        let (above, _) = sight(&surface(ViewMode::Top, slope), OrbitCamera::default());
        assert_eq!(above.height_mm(DVec3::new(9.0, 7.0, 5.0), 1.0, DVec2::ZERO), None);
    }
    #[test]
    fn a_plateau_beyond_the_axis_is_picked_at_its_edge() {
        let steep = |x: f64, _: f64| 4.5 + 0.6 * (x - 10.0);
        let surface = surface(ViewMode::ThreeD, steep);
        // From high enough to look down on it: the box ends at 3.92 and 5.08.
        for camera in cameras().filter(|camera| camera.pitch > 0.6) {
            let (sight, _) = sight(&surface, camera);
            for step in 0..50 {
                // The rim is at 10.967, and the slope to it ends at the next point of the grid.
                let place = DVec3::new(
                    11.05 + 0.02 * f64::from(step),
                    3.1 + 0.11 * f64::from(step * 7 % 50),
                    5.08,
                );
                let picked = surface.pick(&sight.ray(sight.point(place))).unwrap();
                assert!(picked.distance(place) < 1e-9, "{picked} for {place}, {camera:?}");
            }
        }
    }
}
