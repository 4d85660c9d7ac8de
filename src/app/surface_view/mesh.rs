//! The height field as one mesh, painted from far to near so that what is near hides what is far.

use std::ops::RangeInclusive;

use eframe::egui::{Color32, Mesh, Pos2};
use glam::{DVec3, Vec3};

use super::contour::cross_cell;
use super::edge::to_egui;
use super::plan::PlanAxes;
use super::projection::Projection;
use super::ribbon;
use crate::app::theme::ColourMap;
use crate::app::ticks::{multiples, step_for};
use crate::surface::Grid;

/// Opacity of the extrapolated margin where it begins; it fades to nothing at its rim.
const MARGIN_OPACITY: f32 = 0.6;
const AMBIENT: f32 = 0.66;
const DIRECT: f32 = 0.38;
const CONTOUR_LEVELS: usize = 10;
const CONTOUR_OPACITY: f32 = 0.34;

/// How places become points.
pub(super) enum Stage<'a> {
    /// In space, lit.
    Space(&'a Projection),
    /// From above.
    Plan(&'a PlanAxes),
}

impl Stage<'_> {
    /// Where a place with a value is on the screen.
    pub(super) fn point(&self, place: DVec3) -> Pos2 {
        match self {
            Self::Space(projection) => to_egui(projection.point(place)),
            Self::Plan(plan) => plan.point(place.truncate()),
        }
    }

    fn eye_mm(&self) -> Option<DVec3> {
        match self {
            Self::Space(projection) => Some(projection.plot_box.place_mm(projection.eye)),
            Self::Plan(_) => None,
        }
    }
}

/// A surface and how it is coloured.
pub(super) struct Surface<'a> {
    pub(super) grid: &'a Grid,
    /// `x points × y points`; NaN leaves a gap.
    pub(super) values: &'a [f64],
    /// Values at the ends of the colours.
    pub(super) range: &'a RangeInclusive<f64>,
    /// Values that the box has room for.
    pub(super) shown: RangeInclusive<f64>,
    pub(super) colours: &'a ColourMap,
}

impl Surface<'_> {
    /// Two corners of the box: the grid, and the values that it has room for.
    pub(super) fn box_mm(&self) -> (DVec3, DVec3) {
        let ends = |axis: &[f64]| (axis[0], axis[axis.len() - 1]);
        let ((x0, x1), (y0, y1)) = (ends(self.grid.x_mm()), ends(self.grid.y_mm()));
        (
            DVec3::new(x0, y0, *self.shown.start()),
            DVec3::new(x1, y1, *self.shown.end()),
        )
    }

    /// The surface with its contour lines.
    pub(super) fn mesh(&self, stage: &Stage<'_>) -> Mesh {
        let (nx, ny) = (self.grid.x_mm().len(), self.grid.y_mm().len());
        let mut mesh = Mesh::default();
        mesh.reserve_vertices(2 * nx * ny);
        mesh.reserve_triangles(3 * nx * ny);
        self.vertices(&mut mesh, stage);
        let eye_mm = stage.eye_mm().unwrap_or(DVec3::INFINITY);
        let (columns, rows) = (
            far_to_near(self.grid.x_mm(), eye_mm.x),
            far_to_near(self.grid.y_mm(), eye_mm.y),
        );
        let levels = contour_levels(self.range);
        let mut previous = None;
        for &ix in &columns {
            for &iy in &rows {
                self.cell(&mut mesh, ix, iy);
            }
            // Lines lag one strip behind, or the next strip would cover half of their width.
            if let Some(previous) = previous.replace(ix) {
                self.lines(&mut mesh, previous, &rows, &levels);
            }
        }
        if let Some(last) = previous {
            self.lines(&mut mesh, last, &rows, &levels);
        }
        mesh
    }

    fn colour(&self, value: f64) -> Color32 {
        self.colours
            .at(((value - self.range.start()) / (self.range.end() - self.range.start())) as f32)
    }

    /// 1 within the nodes' rectangle, fading to the rim of the extrapolated margin.
    fn opacity(&self, ix: usize, iy: usize) -> f32 {
        let outside = |index: usize, inside: &RangeInclusive<usize>, count: usize| {
            if index < *inside.start() {
                (inside.start() - index) as f32 / *inside.start() as f32
            } else {
                index.saturating_sub(*inside.end()) as f32 / (count - 1 - inside.end()).max(1) as f32
            }
        };
        let along_x = outside(ix, &self.grid.inside_x(), self.grid.x_mm().len());
        let along_y = outside(iy, &self.grid.inside_y(), self.grid.y_mm().len());
        let beyond = along_x.max(along_y);
        if beyond > 0.0 {
            MARGIN_OPACITY * (1.0 - beyond).max(0.0).powf(1.3)
        } else {
            1.0
        }
    }

    /// One vertex for every grid point, in their order.
    fn vertices(&self, mesh: &mut Mesh, stage: &Stage<'_>) {
        let (x_mm, y_mm) = (self.grid.x_mm(), self.grid.y_mm());
        let places = x_mm.iter().enumerate().flat_map(|(ix, &x)| {
            let along_y = y_mm.iter().zip(&self.values[self.grid.index(ix, 0)..]).enumerate();
            along_y.map(move |(iy, (&y, &value))| (ix, iy, DVec3::new(x, y, value)))
        });
        let colour = |ix: usize, iy: usize, value: f64, light: f32| {
            let opacity = self.opacity(ix, iy);
            let colour = lit(self.colour(value), light);
            if opacity < 1.0 {
                colour.gamma_multiply(opacity)
            } else {
                colour
            }
        };
        match stage {
            Stage::Plan(plan) => {
                for (ix, iy, place) in places {
                    mesh.colored_vertex(plan.point(place.truncate()), colour(ix, iy, place.z, 1.0));
                }
            }
            Stage::Space(projection) => {
                let plot_box = projection.plot_box;
                let (low, high) = (plot_box.min_mm.z, plot_box.max_mm.z);
                let in_box = |place: DVec3| plot_box.unit(place.with_z(place.z.clamp(low, high)));
                let units: Vec<Vec3> = places.clone().map(|(_, _, place)| in_box(place)).collect();
                let shade = Shade::new(&units, y_mm.len(), projection.eye);
                for ((ix, iy, place), unit) in places.zip(&units) {
                    let at = to_egui(projection.point_of_unit(*unit));
                    mesh.colored_vertex(at, colour(ix, iy, place.z, shade.at(ix, iy)));
                }
            }
        }
    }

    /// Corners of a cell, going round it.
    fn corners(&self, ix: usize, iy: usize) -> [usize; 4] {
        [(ix, iy), (ix + 1, iy), (ix + 1, iy + 1), (ix, iy + 1)].map(|(ix, iy)| self.grid.index(ix, iy))
    }

    /// Whether a cell has values; in the margin also whether they stay in the box, for extrapolation knows no bounds.
    fn is_drawn(&self, ix: usize, iy: usize, corners: [usize; 4]) -> bool {
        let is_inside = self.grid.is_inside(ix, iy) && self.grid.is_inside(ix + 1, iy + 1);
        let is_shown = |value: f64| value.is_finite() && (is_inside || self.shown.contains(&value));
        corners.iter().all(|&corner| is_shown(self.values[corner]))
    }

    fn cell(&self, mesh: &mut Mesh, ix: usize, iy: usize) {
        let corners = self.corners(ix, iy);
        if self.is_drawn(ix, iy, corners) {
            let [a, b, c, d] = corners.map(|corner| corner as u32);
            mesh.add_triangle(a, b, c);
            mesh.add_triangle(a, c, d);
        }
    }

    /// Contour lines in the strip of cells at `ix`.
    fn lines(&self, mesh: &mut Mesh, ix: usize, rows: &[usize], levels: &[f64]) {
        for &iy in rows {
            let corners = self.corners(ix, iy);
            if !self.is_drawn(ix, iy, corners) {
                continue;
            }
            let values = corners.map(|corner| self.values[corner]);
            let (low, high) = values
                .iter()
                .fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
            let places = corners.map(|corner| mesh.vertices[corner].pos);
            let opacity = mesh.vertices[corners[0]]
                .color
                .a()
                .min(mesh.vertices[corners[2]].color.a());
            let ink =
                |value: f64| contrast(self.colour(value)).gamma_multiply(CONTOUR_OPACITY * f32::from(opacity) / 255.0);
            for &level in levels.iter().filter(|level| (low..high).contains(level)) {
                cross_cell(values, level, |ends| {
                    let [from, to] = ends.map(|(a, b, part)| places[a].lerp(places[b], part));
                    ribbon::line(mesh, from, to, ink(level));
                });
            }
        }
    }
}

/// Values of the contour lines, strictly within the range: a sensor at rest lies at its upper end, where overshoots of a
/// micrometre would draw lines all over it.
fn contour_levels(range: &RangeInclusive<f64>) -> Vec<f64> {
    let step = step_for(range, CONTOUR_LEVELS);
    let is_within = |level: &f64| level - range.start() > 1e-3 * step && range.end() - level > 1e-3 * step;
    multiples(range, step).into_iter().filter(is_within).collect()
}

/// Lambert's law, with a light that follows the viewer: from above, over the left shoulder.
struct Shade<'a> {
    units: &'a [Vec3],
    nx: usize,
    ny: usize,
    light: Vec3,
}

impl<'a> Shade<'a> {
    fn new(units: &'a [Vec3], ny: usize, eye: Vec3) -> Self {
        let towards_eye = Vec3::new(eye.x, eye.y, 0.0).normalize_or(Vec3::X);
        let left = Vec3::new(towards_eye.y, -towards_eye.x, 0.0);
        let light = (towards_eye * 0.35 + left * 0.55 + Vec3::Z * 0.9).normalize();
        Self {
            units,
            nx: units.len() / ny,
            ny,
            light,
        }
    }

    fn at(&self, ix: usize, iy: usize) -> f32 {
        let unit = |ix: usize, iy: usize| self.units[ix * self.ny + iy];
        let slope_x = unit((ix + 1).min(self.nx - 1), iy) - unit(ix.saturating_sub(1), iy);
        let slope_y = unit(ix, (iy + 1).min(self.ny - 1)) - unit(ix, iy.saturating_sub(1));
        // NaN falls through `max` as darkness, on points that are not drawn.
        AMBIENT + DIRECT * slope_x.cross(slope_y).normalize_or(Vec3::Z).dot(self.light).max(0.0)
    }
}

/// Cells of an axis, farthest first: from both ends towards the eye.
fn far_to_near(points_mm: &[f64], eye_mm: f64) -> Vec<usize> {
    let cells = points_mm.len() - 1;
    let before = (0..cells).take_while(|&cell| points_mm[cell + 1] <= eye_mm).count();
    (0..before).chain((before..cells).rev()).collect()
}

fn lit(colour: Color32, light: f32) -> Color32 {
    let part = |part: u8| (f32::from(part) * light) as u8;
    Color32::from_rgb(part(colour.r()), part(colour.g()), part(colour.b()))
}

/// Black on light colours, white on dark ones.
fn contrast(colour: Color32) -> Color32 {
    let luma = 0.299 * f32::from(colour.r()) + 0.587 * f32::from(colour.g()) + 0.114 * f32::from(colour.b());
    if luma > 110.0 { Color32::BLACK } else { Color32::WHITE }
}

#[cfg(test)]
mod tests {
    use super::{contour_levels, far_to_near};

    #[test]
    fn contour_lines_lie_between_the_ends_of_the_range() {
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
