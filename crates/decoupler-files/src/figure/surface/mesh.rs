//! The height field as one mesh, painted from far to near: near parts hide far ones.

use std::ops::RangeInclusive;

use glam::{DVec3, Vec2, Vec3};

use super::{
    camera::{Shade, Sight},
    cut::{cross_cell, cut_cell, plateau_marks},
    field::{CellPart, Field},
};
use crate::figure::{
    axis::{multiples, step_for},
    colour_map::{ColourMap, Rgb, is_light},
    drawing::{Ink, Shape},
};

const CONTOUR_LEVELS: usize = 10;
const CONTOUR_OPACITY: f32 = 0.34;
/// Opacity of the hatching and the rim of a plateau.
const HATCH_OPACITY: f32 = 0.5;

/// A piece of a contour line or of hatching, about one point wide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContourLine {
    /// First end.
    pub from: Vec2,
    /// Second end.
    pub to: Vec2,
    /// Black on light colours, white on dark ones.
    pub is_black: bool,
    /// 1 is opaque.
    pub opacity: f32,
}

/// The surface with its contour lines.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// The grid points, `x points × y points`, followed by the corners of cells cut at the ends of the value axis.
    pub vertices: Vec<Vertex>,
    /// Corners of the cells and of the pieces of cut cells in the order of painting, each going round; a triangle has its
    /// last one twice.
    cells: Vec<[usize; 4]>,
    /// Contour lines in the order of painting.
    lines: Vec<ContourLine>,
    /// End of each strip of cells and of its lines.
    strips: Vec<[usize; 2]>,
    /// True if a part of the surface is beyond the box and drawn at its edge.
    pub(super) has_plateau: bool,
}

impl Mesh {
    /// The surface in the colours of `map`.
    pub(super) fn new(field: &Field<'_>, sight: &Sight, map: &ColourMap) -> Self {
        let (x_mm, y_mm) = (field.grid.x_mm(), field.grid.y_mm());
        let mut mesh = Self {
            vertices: vertices(field, sight, map),
            cells: Vec::with_capacity(x_mm.len() * y_mm.len()),
            ..Self::default()
        };
        if mesh.vertices.is_empty() {
            return mesh;
        }
        let eye_mm = sight.eye_mm();
        let rows = far_to_near(y_mm, eye_mm.y);
        let levels = contour_levels(&field.range);
        let mut lineless = Vec::new();
        for ix in far_to_near(x_mm, eye_mm.x) {
            let mut strip = Vec::with_capacity(rows.len());
            for &iy in &rows {
                match field.part(ix, iy) {
                    CellPart::Nothing => continue,
                    CellPart::Whole | CellPart::Plateau => mesh.cells.push(field.corners(ix, iy)),
                    CellPart::Cut => mesh.cut(ix, iy, field, sight),
                }
                strip.push((ix, iy));
            }
            // Lines are painted one strip late; the next strip would cover half of their width otherwise.
            mesh.end_strip(&lineless, field, sight, (&levels, map));
            lineless = strip;
        }
        mesh.end_strip(&lineless, field, sight, (&levels, map));
        mesh
    }

    /// Appends the part of a cell within the box.
    fn cut(&mut self, ix: usize, iy: usize, field: &Field<'_>, sight: &Sight) {
        let of_cell = field.corners(ix, iy).map(|corner| self.vertices[corner]);
        let (low, high) = (*field.shown().start(), *field.shown().end());
        let keeps_plateau = field.keeps_plateau(ix, iy);
        for polygon in cut_cell(field.corners_mm(ix, iy), low, high, keeps_plateau) {
            let first = self.vertices.len();
            self.vertices.extend(polygon.iter().map(|corner| Vertex {
                at: sight.drawn(corner.place),
                ..mixed(&of_cell, corner.shares)
            }));
            let last = polygon.len() - 1;
            for second in (1..last).step_by(2) {
                let corners = [0, second, second + 1, (second + 2).min(last)];
                self.cells.push(corners.map(|corner| first + corner));
            }
        }
    }

    /// Appends the lines in `cells` and ends the strip: contour lines at `levels`, and marks of parts beyond the box.
    fn end_strip(
        &mut self,
        cells: &[(usize, usize)],
        field: &Field<'_>,
        sight: &Sight,
        (levels, map): (&[f64], &ColourMap),
    ) {
        let line = |ends: [DVec3; 2], opacity| {
            let [from, to] = ends.map(|place| sight.drawn(place));
            ContourLine {
                from,
                to,
                is_black: is_light(map.at(field.share(ends[0].z))),
                opacity,
            }
        };
        for &(ix, iy) in cells {
            let contours = self.lines.len();
            plateau_marks(field, ix, iy, |ends| self.lines.push(line(ends, HATCH_OPACITY)));
            self.has_plateau |= self.lines.len() > contours;
            let corners_mm = field.corners_mm(ix, iy);
            let values = corners_mm.map(|corner| corner.z);
            let ends = |(low, high): (f64, f64), value: &f64| (low.min(*value), high.max(*value));
            let (low, high) = values.iter().fold((f64::MAX, f64::MIN), ends);
            let [a, _, c, _] = field.corners(ix, iy).map(|corner| self.vertices[corner].opacity);
            for &level in levels.iter().filter(|level| (low..high).contains(level)) {
                cross_cell(values, level, |ends| {
                    let ends = ends.map(|(a, b, part)| corners_mm[a].lerp(corners_mm[b], f64::from(part)));
                    self.lines.push(line(ends, CONTOUR_OPACITY * a.min(c)));
                });
            }
        }
        self.strips.push([self.cells.len(), self.lines.len()]);
    }

    /// Cells and contour lines from far to near: each slice of cells is followed by the lines drawn after it.
    pub fn strips(&self) -> impl Iterator<Item = (&[[usize; 4]], &[ContourLine])> {
        let starts = std::iter::once(&[0, 0]).chain(&self.strips);
        starts
            .zip(&self.strips)
            .map(|(start, end)| (&self.cells[start[0]..end[0]], &self.lines[start[1]..end[1]]))
    }

    /// Returns the cells, each in the mean colour of its corners, and the contour lines, from far to near.
    pub fn shapes(&self) -> impl Iterator<Item = Shape> {
        let cell = |cell: &[usize; 4]| {
            let corners = cell.map(|corner| self.vertices[corner]);
            let part = |part: usize| corners.iter().map(|corner| u16::from(corner.colour[part])).sum::<u16>() / 4;
            let colour = Ink::Rgb([0, 1, 2].map(|at| part(at) as u8));
            let opacity = corners.iter().map(|corner| corner.opacity).sum::<f32>() / 4.0;
            Shape::Area(corners.map(|corner| corner.at).into(), colour.at(opacity))
        };
        let line = |line: &ContourLine| {
            let ink = if line.is_black { Ink::BLACK } else { Ink::WHITE };
            Shape::line(line.from, line.to, ink.at(line.opacity), 1.0)
        };
        let strips = self.strips();
        strips.flat_map(move |(cells, lines)| cells.iter().map(cell).chain(lines.iter().map(line)))
    }

    /// Number of cells and of contour lines.
    pub fn counts(&self) -> [usize; 2] {
        [self.cells.len(), self.lines.len()]
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

/// Opacity at the start of the extrapolated margin; it fades to 0 at the rim.
const MARGIN_OPACITY: f32 = 0.6;

/// A point of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Position on the screen.
    pub at: Vec2,
    /// Its colour under the light.
    pub colour: Rgb,
    /// 1 within the nodes' rectangle; fades towards the rim of the extrapolated margin.
    pub opacity: f32,
}

/// One vertex for every grid point, in their order.
pub(super) fn vertices(field: &Field<'_>, sight: &Sight, map: &ColourMap) -> Vec<Vertex> {
    let (x_mm, y_mm) = (field.grid.x_mm(), field.grid.y_mm());
    let across = y_mm.len();
    let places = field.values.iter().enumerate().map(|(index, &value)| {
        let (ix, iy) = (index / across, index % across);
        (ix, iy, DVec3::new(x_mm[ix], y_mm[iy], value))
    });
    let vertex = |ix: usize, iy: usize, at: Vec2, value: f64, light: f32| {
        let beyond = field.beyond(ix, iy);
        Vertex {
            at,
            colour: map.at(field.share(value)).map(|part| (f32::from(part) * light) as u8),
            opacity: if beyond > 0.0 {
                MARGIN_OPACITY * (1.0 - beyond).max(0.0).powf(1.3)
            } else {
                1.0
            },
        }
    };
    if sight.is_above {
        return places
            .map(|(ix, iy, place)| vertex(ix, iy, sight.drawn(place), place.z, 1.0))
            .collect();
    }
    let plot_box = sight.plot_box;
    let in_box = |place: DVec3| place.with_z(place.z.clamp(plot_box.min_mm.z, plot_box.max_mm.z));
    let units: Vec<Vec3> = places
        .clone()
        .map(|(_, _, place)| plot_box.unit(in_box(place)))
        .collect();
    let shade = Shade::new(&units, across, sight.eye.as_vec3());
    places
        .map(|(ix, iy, place)| vertex(ix, iy, sight.drawn(in_box(place)), place.z, shade.at(ix, iy)))
        .collect()
}

/// Interpolates a vertex between others by its share of each.
pub(super) fn mixed(vertices: &[Vertex; 4], shares: [f64; 4]) -> Vertex {
    let mix = |of: &dyn Fn(&Vertex) -> f32| -> f32 {
        vertices
            .iter()
            .zip(shares)
            .map(|(vertex, share)| of(vertex) * share as f32)
            .sum()
    };
    Vertex {
        at: Vec2::ZERO,
        colour: [0, 1, 2].map(|part| mix(&|vertex| f32::from(vertex.colour[part])).round() as u8),
        opacity: mix(&|vertex| vertex.opacity),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use decoupler_core::surface::SurfaceMap;

    use super::*;
    use crate::figure::drawing::Bounds;
    use crate::figure::surface::{OrbitCamera, Quantity, Surface, ViewMode, camera::PlotBox};

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
        let (field, colours) = (Field::new(&surface), surface.colours.colours());
        let (min_mm, max_mm) = field.box_mm();
        let plot_box = PlotBox::new(min_mm, max_mm, 1.0);
        let screen = Bounds::of([Vec2::ZERO, Vec2::splat(400.0)]);
        let mut hidden = 0;
        for turn in 0..6 {
            let camera = OrbitCamera::default().dragged(140.0 * turn as f32, 12.0 * turn as f32 - 40.0);
            let sight = Sight::fit(plot_box, Some(camera), screen);
            let mesh = Mesh::new(&field, &sight, colours);
            let distance = |index: usize| {
                let (x_mm, y_mm) = (field.grid.x_mm(), field.grid.y_mm());
                let z = field.values[index].clamp(min_mm.z, max_mm.z);
                let place = DVec3::new(x_mm[index / y_mm.len()], y_mm[index % y_mm.len()], z);
                plot_box.unit(place).distance(sight.eye.as_vec3())
            };
            let corners: Vec<(Vec2, f32)> = (0..field.values.len())
                .map(|index| (mesh.vertices[index].at, distance(index)))
                .collect();
            for probe in 0..100 {
                let place = Vec2::new(20.3 + 39.7 * (probe / 10) as f32, 20.7 + 39.1 * (probe % 10) as f32);
                let cells = mesh.strips().flat_map(|(cells, _)| cells);
                // Cells cut at the ends of the axis have additional corners.
                let whole = cells.filter(|cell| cell.iter().all(|corner| *corner < field.values.len()));
                let painted = whole.flat_map(|cell| {
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
}
