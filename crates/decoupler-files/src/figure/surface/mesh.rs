//! The height field as one mesh with contour lines, painted from far to near: near parts hide far ones.

use std::ops::RangeInclusive;

use glam::{DVec3, Vec2};

use super::{Surface, ViewMode, camera::Sight};
use crate::figure::{
    Ink,
    axis::{multiples, step_for},
    colour_map::{ColourMap, is_light},
    drawing::{Colour, Shape},
};

const CONTOUR_LEVELS: usize = 10;
const CONTOUR_OPACITY: f32 = 0.34;
/// Opacity of the hatching and the rim of a plateau.
const HATCH_OPACITY: f32 = 0.5;
/// Approximate number of hatching lines along the longer side of a surface.
const HATCHES: usize = 22;

/// The surface with its contour lines.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// The grid points, `x points × y points`.
    pub vertices: Vec<Vertex>,
    /// In the order of painting.
    pub pieces: Vec<Piece>,
    /// True if a part of the surface is beyond the box and drawn at its edge.
    pub(super) has_plateau: bool,
}

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Position on the screen.
    pub at: Vec2,
    /// Its colour under the light: opaque within the nodes' rectangle, fading towards the rim of the extrapolated margin.
    pub colour: Colour,
}

/// A part of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Piece {
    /// A cell by its vertices, going round it.
    Cell([usize; 4]),
    /// A piece of a contour line or of hatching, about one point wide.
    Line([Vec2; 2], Colour),
}

impl Mesh {
    /// The surface in the colours of `map`.
    pub(super) fn new(surface: &Surface, sight: &Sight, map: &ColourMap) -> Self {
        let (x_mm, y_mm, eye_mm) = (surface.map.grid().x_mm(), surface.map.grid().y_mm(), sight.eye_mm());
        let mut mesh = Self {
            vertices: vertices(surface, sight, map),
            ..Self::default()
        };
        let (rows, levels) = (far_to_near(y_mm, eye_mm.y), contour_levels(&surface.usable_range()));
        // Lines are painted one strip late; the next strip would cover half of their width otherwise.
        let mut late = Vec::new();
        for ix in far_to_near(x_mm, eye_mm.x) {
            let mut lines = Vec::new();
            for &iy in &rows {
                let Some(cell_mm) = surface.cell_mm(ix, iy) else {
                    continue;
                };
                let cell = corners(ix, iy).map(|[ix, iy]| surface.map.grid().index(ix, iy));
                mesh.pieces.push(Piece::Cell(cell));
                let opacity = cell.map(|corner| mesh.vertices[corner].colour.opacity);
                let opacity = opacity.into_iter().fold(1.0, f32::min);
                let mut draw = |ends: [DVec3; 2], strength: f32| {
                    let is_black = is_light(map.at(surface.share(ends[0].z)));
                    let ink = if is_black { Ink::BLACK } else { Ink::WHITE };
                    let ends = ends.map(|end| sight.drawn(surface.drawn(end)));
                    lines.push(Piece::Line(ends, ink.at(strength * opacity)));
                };
                let drawn_mm = cell_mm.map(|corner| surface.drawn(corner));
                for &level in &levels {
                    crossings(drawn_mm, level, |ends| draw(ends, CONTOUR_OPACITY));
                }
                if surface.mode == ViewMode::ThreeD {
                    // Along the diagonals of every few cells; diagonals of neighbours meet.
                    let stride = (x_mm.len().max(y_mm.len()) / HATCHES).max(1);
                    let diagonal = [cell_mm[1], cell_mm[3]];
                    let is_hatched = (ix + iy).is_multiple_of(stride);
                    for (end, side) in surface.shown().into_iter().zip([-1.0, 1.0]) {
                        let is_beyond = |corner: &DVec3| side * (corner.z - end) > 0.0;
                        mesh.has_plateau |= cell_mm.iter().any(is_beyond);
                        crossings(cell_mm, end, |ends| draw(ends, HATCH_OPACITY));
                        if is_hatched && diagonal.iter().all(is_beyond) {
                            draw(diagonal, HATCH_OPACITY);
                        }
                    }
                }
            }
            mesh.pieces.append(&mut late);
            late = lines;
        }
        mesh.pieces.append(&mut late);
        mesh
    }

    /// Returns the cells, each in the colour of its first corner, and the lines, in the order of painting.
    pub fn shapes(&self) -> impl Iterator<Item = Shape> {
        self.pieces.iter().map(|piece| match *piece {
            Piece::Cell(cell) => {
                let corners = cell.map(|corner| self.vertices[corner]);
                Shape::Area(corners.map(|corner| corner.at).into(), corners[0].colour)
            }
            Piece::Line([from, to], colour) => Shape::line(from, to, colour, 1.0),
        })
    }
}

/// The grid points at the corners of a cell, going round it.
pub(super) fn corners(ix: usize, iy: usize) -> [[usize; 2]; 4] {
    [[ix, iy], [ix + 1, iy], [ix + 1, iy + 1], [ix, iy + 1]]
}

/// Calls `draw` with the ends of each piece of the contour line at `level` in a cell whose corners go round it (marching
/// squares).
fn crossings(corners: [DVec3; 4], level: f64, mut draw: impl FnMut([DVec3; 2])) {
    let is_low = corners.map(|corner| corner.z < level);
    let sides = [0, 1, 2, 3].map(|side| (side, (side + 1) % 4)).into_iter();
    let crossed = sides.filter(|&(from, to)| is_low[from] != is_low[to]);
    let end = |(from, to): (usize, usize)| {
        let (from, to) = (corners[from], corners[to]);
        from.lerp(to, (level - from.z) / (to.z - from.z))
    };
    let ends = Vec::from_iter(crossed.map(end));
    // At a saddle the value in the middle decides which corners are connected.
    let middle_is_low = || corners.iter().map(|corner| corner.z).sum::<f64>() < 4.0 * level;
    match ends[..] {
        [w, x] => draw([w, x]),
        [w, x, y, z] if middle_is_low() == is_low[0] => [[w, x], [y, z]].into_iter().for_each(draw),
        [w, x, y, z] => [[z, w], [x, y]].into_iter().for_each(draw),
        _ => {}
    }
}

/// Returns the values of the contour lines, strictly within the range: a sensor at rest is at its upper end, where
/// overshoots of a micrometre would cover it with lines.
fn contour_levels(range: &RangeInclusive<f64>) -> Vec<f64> {
    let step = step_for(range, CONTOUR_LEVELS);
    let is_within = |level: &f64| level - range.start() > 1e-3 * step && range.end() - level > 1e-3 * step;
    multiples(range, step).into_iter().filter(is_within).collect()
}

/// Cells of an axis, farthest first: from both ends towards the eye.
fn far_to_near(points_mm: &[f64], eye_mm: f64) -> Vec<usize> {
    let cells = points_mm.len() - 1;
    let before = (0..cells).take_while(|&cell| points_mm[cell + 1] <= eye_mm).count();
    (0..before).chain((before..cells).rev()).collect()
}

/// One vertex for every grid point, in their order.
fn vertices(surface: &Surface, sight: &Sight, map: &ColourMap) -> Vec<Vertex> {
    /// Brightness in the shade, and what the light adds.
    const LIGHT: [f32; 2] = [0.66, 0.38];
    /// Opacity at the start of the extrapolated margin; it fades to 0 at the rim.
    const MARGIN_OPACITY: f32 = 0.6;
    let (nx, ny) = (surface.map.grid().x_mm().len(), surface.map.grid().y_mm().len());
    let drawn = |ix: usize, iy: usize| surface.drawn(surface.place_mm([ix, iy]));
    // The light follows the viewer: from above, over the left shoulder.
    let towards_eye = sight.eye.with_z(0.0).normalize_or(DVec3::X);
    let left = DVec3::new(towards_eye.y, -towards_eye.x, 0.0);
    let light = (towards_eye * 0.35 + left * 0.55 + DVec3::Z * 0.9).normalize();
    // Lambert's law.
    let lit = |ix: usize, iy: usize| {
        let slope = |from: DVec3, to: DVec3| (to - from) * sight.plot_box.per_mm;
        let along_x = slope(drawn(ix.saturating_sub(1), iy), drawn((ix + 1).min(nx - 1), iy));
        let along_y = slope(drawn(ix, iy.saturating_sub(1)), drawn(ix, (iy + 1).min(ny - 1)));
        // NaN becomes 0 in `max`, at points that are not drawn.
        let normal = along_x.cross(along_y).normalize_or(DVec3::Z);
        LIGHT[0] + LIGHT[1] * normal.dot(light).max(0.0) as f32
    };
    let vertex = |index: usize| {
        let (ix, iy) = (index / ny, index % ny);
        let light = if sight.is_above { 1.0 } else { lit(ix, iy) };
        let beyond = surface.map.beyond(ix, iy) as f32;
        let colour = map.at(surface.share(surface.place_mm([ix, iy]).z));
        let opacity = match beyond > 0.0 {
            true => MARGIN_OPACITY * (1.0 - beyond).max(0.0).powf(1.3),
            false => 1.0,
        };
        let colour = Ink::Rgb(colour.map(|part| (f32::from(part) * light) as u8)).at(opacity);
        let at = sight.drawn(drawn(ix, iy));
        Vertex { at, colour }
    };
    (0..nx * ny).map(vertex).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use decoupler_core::surface::SurfaceMap;

    use super::*;
    use crate::figure::drawing::Bounds;
    use crate::figure::surface::{Drawing, OrbitCamera, Quantity, camera::PlotBox};

    /// Returns the distance from the eye to a triangle at a place on the screen; `None` outside it.
    fn distance_at(place: Vec2, corners: [(Vec2, f32); 3]) -> Option<f32> {
        let [a, b, c] = corners.map(|(at, _)| at);
        let whole = (b - a).perp_dot(c - a);
        let parts = [(b, c), (c, a), (a, b)].map(|(from, to)| (to - from).perp_dot(place - from) / whole);
        let mean = || {
            parts
                .iter()
                .zip(&corners)
                .map(|(part, (_, distance))| part * distance)
                .sum()
        };
        parts.iter().all(|part| *part > 0.0).then(mean)
    }

    #[test]
    fn near_cells_are_painted_over_far_ones() {
        let places: Vec<f64> = (0..6).map(f64::from).collect();
        let map = Arc::new(SurfaceMap::new(&places, &places).expect("a lattice"));
        let values = map.evaluate(
            &(0..36)
                .map(|node| 4.5 + 0.5 * (1.9 * f64::from(node)).sin())
                .collect::<Vec<_>>(),
        );
        let surface = Surface {
            title: String::new(),
            values: values.into(),
            nodes: Arc::new([]),
            map,
            quantity: Quantity::Height,
            range: 4.0..=5.0,
            mode: ViewMode::ThreeD,
            colours: Default::default(),
        };
        let colours = surface.colours.colours();
        let [min_mm, max_mm] = surface.box_mm();
        let plot_box = PlotBox::new([min_mm, max_mm], 1.0);
        let screen = Bounds::of([Vec2::ZERO, Vec2::splat(400.0)]);
        let mut hidden = 0;
        for turn in 0..6 {
            let camera = OrbitCamera::default().dragged(140.0 * turn as f32, 12.0 * turn as f32 - 40.0);
            let sight = Sight::fit(plot_box, Some(camera), screen);
            let mesh = Mesh::new(&surface, &sight, colours);
            let distance = |index: usize| {
                let (x_mm, y_mm) = (surface.map.grid().x_mm(), surface.map.grid().y_mm());
                let z = surface.values[index].clamp(min_mm.z, max_mm.z);
                let place = DVec3::new(x_mm[index / y_mm.len()], y_mm[index % y_mm.len()], z);
                plot_box.unit(place).distance(sight.eye) as f32
            };
            let corners: Vec<(Vec2, f32)> = (0..surface.values.len())
                .map(|index| (mesh.vertices[index].at, distance(index)))
                .collect();
            for probe in 0..100 {
                let place = Vec2::new(20.3 + 39.7 * (probe / 10) as f32, 20.7 + 39.1 * (probe % 10) as f32);
                let cells = mesh.pieces.iter().filter_map(|piece| match piece {
                    Piece::Cell(cell) => Some(cell),
                    Piece::Line(..) => None,
                });
                let painted = cells.flat_map(|cell| {
                    let [a, b, c, d] = cell.map(|corner| corners[corner]);
                    [[a, b, c], [a, c, d]]
                        .into_iter()
                        .filter_map(|corners| distance_at(place, corners))
                });
                let painted: Vec<f32> = painted.collect();
                hidden += painted.len().saturating_sub(1);
                let nearest = painted.iter().copied().fold(f32::INFINITY, f32::min);
                // Neighbouring cells may meet here.
                assert!(painted.last().is_none_or(|last| *last < nearest + 0.03), "{painted:?}");
            }
        }
        assert!(hidden > 100, "{hidden}: there is something to hide");
    }

    #[test]
    fn contour_lines_are_between_the_ends_of_the_range() {
        let near = |levels: Vec<f64>, expected: &[f64]| {
            assert_eq!(levels.len(), expected.len(), "{levels:?}");
            let pairs = levels.iter().zip(expected);
            pairs.for_each(|(level, expected)| assert!((level - expected).abs() < 1e-12, "{levels:?}"));
        };
        near(
            contour_levels(&(4.0..=5.0)),
            &[4.1, 4.2, 4.3, 4.4, 4.5, 4.6, 4.7, 4.8, 4.9],
        );
        near(
            contour_levels(&(-0.25..=0.25)),
            &[-0.2, -0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2],
        );
        near(
            contour_levels(&(3.95..=4.05)),
            &[3.96, 3.97, 3.98, 3.99, 4.0, 4.01, 4.02, 4.03, 4.04],
        );
    }

    #[test]
    fn cells_are_drawn_towards_the_eye() {
        let points = [0.0, 1.0, 2.0, 3.0, 4.0];
        for (eye, order, sentence) in [
            (9.0, [0, 1, 2, 3], "the eye beyond the far end"),
            (-9.0, [3, 2, 1, 0], "the eye before the near end"),
            (2.5, [0, 1, 3, 2], "the eye over a cell, which comes last"),
        ] {
            assert_eq!(far_to_near(&points, eye), order, "{sentence}");
        }
    }

    /// A flat sheet at height 5 over 6 × 6 nodes, whose middle overshoots to `top`.
    fn overshot(top: f64, mode: ViewMode) -> Surface {
        let places: Vec<f64> = (0..6).map(f64::from).collect();
        let map = Arc::new(SurfaceMap::new(&places, &places).expect("a lattice"));
        let is_middle = |node: usize| (2..4).contains(&(node / 6)) && (2..4).contains(&(node % 6));
        let heights: Vec<f64> = (0..36).map(|node| if is_middle(node) { top } else { 5.0 }).collect();
        let values = map.evaluate(&heights);
        let node = |node: usize| DVec3::new(places[node / 6], places[node % 6], heights[node]);
        Surface {
            title: String::new(),
            values: values.into(),
            nodes: (0..36).map(node).collect(),
            map,
            quantity: Quantity::Height,
            range: 4.0..=5.0,
            mode,
            colours: Default::default(),
        }
    }

    fn laid_out(surface: &Surface) -> Drawing {
        let card = Bounds::of_size(Vec2::ZERO, Vec2::splat(400.0));
        let measure = |text: &str| Vec2::new(6.0 * text.chars().count() as f32, 14.0);
        surface.lay_out(OrbitCamera::default(), card, &measure, surface.colours.colours())
    }

    /// Returns true if any painted piece of the surface covers a place of the screen.
    fn covers(drawing: &Drawing, place: Vec2) -> bool {
        let mesh = &drawing.mesh;
        let covers = |corners: [Vec2; 3]| {
            let [a, b, c] = corners;
            let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| (to - from).perp_dot(place - from));
            sides.iter().all(|side| *side >= 0.0) || sides.iter().all(|side| *side <= 0.0)
        };
        mesh.pieces.iter().any(|piece| match piece {
            Piece::Cell(cell) => {
                let [a, b, c, d] = cell.map(|corner| mesh.vertices[corner].at);
                covers([a, b, c]) || covers([a, c, d])
            }
            Piece::Line(..) => false,
        })
    }

    #[test]
    fn an_overshoot_leaves_no_hole_and_is_marked() {
        for (top, mode) in [(5.6, ViewMode::ThreeD), (3.4, ViewMode::ThreeD), (5.6, ViewMode::Top)] {
            let surface = overshot(top, mode);
            let drawing = laid_out(&surface);
            let end = if top > 5.0 { 5.08 } else { 3.92 };
            for step in 0..121 {
                let place = DVec3::new(2.0 + 0.1 * f64::from(step / 11), 2.0 + 0.1 * f64::from(step % 11), end);
                let at = drawing.sight.point(place).as_vec2();
                assert!(covers(&drawing, at), "{top} {mode:?}: a hole at {place}");
            }
            let note = drawing.note.unwrap_or_default();
            assert_eq!(note.contains("hatched"), mode == ViewMode::ThreeD, "{note}");
        }
    }

    #[test]
    fn only_the_plateau_is_hatched() {
        let surface = overshot(5.6, ViewMode::ThreeD);
        let drawing = laid_out(&surface);
        let mut marks = 0;
        for piece in &drawing.mesh.pieces {
            let Piece::Line(ends, colour) = piece else { continue };
            if colour.opacity < HATCH_OPACITY {
                continue;
            }
            marks += 1;
            for end in ends {
                let place = drawing.sight.ray(end.as_dvec2()).at_level(5.08).unwrap();
                let near = |at: f64| (1.0..=4.0).contains(&at);
                assert!(near(place.x) && near(place.y), "{place} is not near the overshoot");
            }
        }
        assert!(marks > 20, "{marks}");
        let within = overshot(5.05, ViewMode::ThreeD);
        assert!(laid_out(&within).note.is_none(), "within the box there is no overshoot");
    }

    fn pieces(values: [f64; 4]) -> Vec<[DVec3; 2]> {
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let mut pieces = Vec::new();
        let corner = |at: usize| DVec3::new(corners[at][0], corners[at][1], values[at]);
        crossings([0, 1, 2, 3].map(corner), 0.5, |piece| pieces.push(piece));
        pieces
    }

    #[test]
    fn a_slope_is_crossed_once() {
        let along_y = [DVec3::new(0.5, 0.0, 0.5), DVec3::new(0.5, 1.0, 0.5)];
        assert_eq!(pieces([0.0, 1.0, 1.0, 0.0]), [along_y]);
        assert!(pieces([0.0, 0.1, 0.2, 0.3]).is_empty());
    }

    #[test]
    fn a_saddle_is_crossed_twice_around_its_lower_or_upper_corners() {
        let near = |piece: &[DVec3; 2], corner: [f64; 2]| {
            let middle = (0.5 * (piece[0] + piece[1])).truncate();
            middle.distance(corner.into()) < 0.5
        };
        // Middle low: the high corners 1 and 3 are cut off.
        let low = pieces([0.0, 0.8, 0.0, 0.8]);
        assert!(
            low.len() == 2 && near(&low[0], [1.0, 0.0]) && near(&low[1], [0.0, 1.0]),
            "{low:?}"
        );
        // Middle high: the low corners 0 and 2 are.
        let high = pieces([0.1, 1.0, 0.1, 1.0]);
        assert!(
            high.len() == 2 && near(&high[0], [0.0, 0.0]) && near(&high[1], [1.0, 1.0]),
            "{high:?}"
        );
    }
}
