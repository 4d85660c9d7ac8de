//! A surface in space: seen from the front right and above, without perspective, so that heights can be compared.

use std::ops::RangeInclusive;

use glam::{DVec2, DVec3};

use super::{
    canvas::{Anchor, Area, At, Canvas, Stroke},
    colours::{DIM, GRID, INK, lit, viridis},
    surface_panel::SurfacePanel,
};
use crate::{
    figure::{
        share,
        ticks::{multiples, step_for, tick_text},
    },
    surface::Grid,
};

/// Direction of view: angle from the x axis, and angle above the horizon, in radians.
const AZIMUTH: f64 = -0.92;
const ELEVATION: f64 = 0.52;
/// Height of the box, its longer side being 1.
const TALL: f64 = 0.5;
/// The shorter side of the box at least.
const NARROWEST: f64 = 0.6;
/// Room for ticks and names around the box.
const MARGIN: [f64; 2] = [36.0, 24.0];

/// Projection from millimetres to the canvas.
pub(super) struct Relief {
    area: Area,
    low: DVec3,
    size: DVec3,
    sides: DVec3,
    scale: f64,
    middle: DVec2,
}

impl Relief {
    /// The box over these ranges, as large as `area` holds.
    pub fn new(area: Area, x: &RangeInclusive<f64>, y: &RangeInclusive<f64>, z: &RangeInclusive<f64>) -> Self {
        let low = DVec3::new(*x.start(), *y.start(), *z.start());
        let size = DVec3::new(x.end() - x.start(), y.end() - y.start(), z.end() - z.start());
        let longer = size.x.max(size.y);
        let side = |length: f64| (length / longer).max(NARROWEST);
        let mut relief = Self {
            area,
            low,
            size,
            sides: DVec3::new(side(size.x), side(size.y), TALL),
            scale: 1.0,
            middle: DVec2::ZERO,
        };
        let corners: Vec<DVec2> = CORNERS.iter().map(|&corner| relief.flat(corner)).collect();
        let least = corners.iter().copied().reduce(DVec2::min).unwrap_or_default();
        let most = corners.iter().copied().reduce(DVec2::max).unwrap_or_default();
        let extent = most - least;
        relief.scale = ((area.width - 2.0 * MARGIN[0]) / extent.x).min((area.height - 2.0 * MARGIN[1]) / extent.y);
        relief.middle = 0.5 * (least + most);
        relief
    }

    /// A point of the unit box on the plane of the picture, y upwards.
    fn flat(&self, unit: DVec3) -> DVec2 {
        let point = (unit - DVec3::splat(0.5)) * self.sides;
        let (sin, cos) = AZIMUTH.sin_cos();
        let away = point.x * cos + point.y * sin;
        DVec2::new(
            point.y * cos - point.x * sin,
            point.z * ELEVATION.cos() - away * ELEVATION.sin(),
        )
    }

    fn unit_at(&self, unit: DVec3) -> At {
        let place = (self.flat(unit) - self.middle) * self.scale;
        let [x, y] = self.area.centre();
        [x + place.x, y - place.y]
    }

    fn at(&self, point_mm: DVec3) -> At {
        self.unit_at((point_mm - self.low) / self.size)
    }

    /// The three far sides with their grid, ticks and names.
    pub fn draw_box(&self, canvas: &mut Canvas, z_name: &str) {
        let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let (grid, edge) = (Stroke::new(GRID, 0.5), Stroke::new(DIM, 0.6));
        let high = self.low + self.size;
        let ranges = [self.low.x..=high.x, self.low.y..=high.y, self.low.z..=high.z];
        let [x_ticks, y_ticks, z_ticks] = ranges.map(|range| {
            let step = step_for(&range, 5);
            let ticks = multiples(&range, step).into_iter();
            let ticks = ticks.map(|value| (share(value, &range), tick_text(value, step)));
            ticks.collect::<Vec<_>>()
        });
        let mut chain = |corners: &[DVec3], stroke: Stroke| {
            let places: Vec<At> = corners.iter().map(|&corner| self.unit_at(corner)).collect();
            canvas.polyline(&places, stroke);
        };
        // The eye sees the floor, the side of least x and that of most y.
        for &(at, _) in &x_ticks {
            chain(
                &[corner(at, 0.0, 0.0), corner(at, 1.0, 0.0), corner(at, 1.0, 1.0)],
                grid,
            );
        }
        for &(at, _) in &y_ticks {
            chain(
                &[corner(1.0, at, 0.0), corner(0.0, at, 0.0), corner(0.0, at, 1.0)],
                grid,
            );
        }
        for &(at, _) in &z_ticks {
            chain(
                &[corner(0.0, 0.0, at), corner(0.0, 1.0, at), corner(1.0, 1.0, at)],
                grid,
            );
        }
        chain(
            &[
                corner(0.0, 0.0, 1.0),
                corner(0.0, 0.0, 0.0),
                corner(1.0, 0.0, 0.0),
                corner(1.0, 1.0, 0.0),
            ],
            edge,
        );
        for (at, text) in x_ticks {
            let [x, y] = self.unit_at(corner(at, 0.0, 0.0));
            canvas.text([x - 2.0, y + 9.0], Anchor::End, INK, &text);
        }
        for (at, text) in y_ticks {
            let [x, y] = self.unit_at(corner(1.0, at, 0.0));
            canvas.text([x + 4.0, y + 7.0], Anchor::Start, INK, &text);
        }
        for (at, text) in z_ticks {
            let [x, y] = self.unit_at(corner(0.0, 0.0, at));
            canvas.text([x - 4.0, y], Anchor::End, INK, &text);
        }
        let [x, y] = self.unit_at(corner(0.45, 0.0, 0.0));
        canvas.text([x - 12.0, y + 24.0], Anchor::End, INK, "x (mm)");
        let [x, y] = self.unit_at(corner(1.0, 0.55, 0.0));
        canvas.text([x + 20.0, y + 18.0], Anchor::Start, INK, "y (mm)");
        let [x, y] = self.unit_at(corner(0.0, 0.0, 0.5));
        canvas.upright_text([x - 28.0, y], INK, z_name);
    }

    /// The surface from far to near, then its nodes.
    pub fn draw_surface(
        &self,
        canvas: &mut Canvas,
        grid: &Grid,
        [columns, rows]: &[Vec<usize>; 2],
        panel: &SurfacePanel,
        range: &RangeInclusive<f64>,
    ) {
        let point = |ix: usize, iy: usize| {
            let z = panel.values_mm[grid.index(ix, iy)];
            z.is_finite()
                .then(|| DVec3::new(grid.x_mm()[ix], grid.y_mm()[iy], z.clamp(*range.start(), *range.end())))
        };
        for x in columns.windows(2) {
            for y in rows.windows(2).rev() {
                let corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])].map(|(ix, iy)| point(ix, iy));
                let [Some(a), Some(b), Some(c), Some(d)] = corners else {
                    continue;
                };
                let middle = 0.25 * (a.z + b.z + c.z + d.z);
                let [a_unit, b_unit, c_unit, d_unit] =
                    [a, b, c, d].map(|corner| (corner - self.low) / self.size * self.sides);
                let normal = (c_unit - a_unit).cross(d_unit - b_unit).normalize_or(DVec3::Z);
                let light = 0.72 + 0.28 * normal.dot(DVec3::new(-0.35, -0.5, 0.8).normalize()).max(0.0);
                let colour = lit(viridis(share(middle, range)), light);
                canvas.facet(&[a, b, c, d].map(|corner| self.at(corner)), colour);
            }
        }
    }
}

const CORNERS: [DVec3; 8] = [
    DVec3::new(0.0, 0.0, 0.0),
    DVec3::new(1.0, 0.0, 0.0),
    DVec3::new(0.0, 1.0, 0.0),
    DVec3::new(1.0, 1.0, 0.0),
    DVec3::new(0.0, 0.0, 1.0),
    DVec3::new(1.0, 0.0, 1.0),
    DVec3::new(0.0, 1.0, 1.0),
    DVec3::new(1.0, 1.0, 1.0),
];
