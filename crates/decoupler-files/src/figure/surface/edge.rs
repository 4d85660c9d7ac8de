//! One axis of the box around a surface: the edge that carries its ticks.

use std::ops::RangeInclusive;

use glam::{DVec3, Vec2};

use super::{labels::Labels, projection::Projection};
use crate::figure::ticks::{multiples, round_steps, tick_text};

/// Length of a tick, in points.
pub(super) const TICK: f32 = 4.0;
/// Room between a tick and its number, in points.
pub(super) const GAP: f32 = 3.0;
/// Axes seen end-on get no ticks.
pub(super) const SHORTEST_AXIS: f32 = 36.0;

/// One axis as drawn: an edge of the box with its ticks.
pub(super) struct Edge {
    pub(super) axis: usize,
    from_mm: DVec3,
    pub(super) away: Vec2,
    pub(super) ticks: Vec<f64>,
    pub(super) step: f64,
}

impl Edge {
    pub(super) fn new(
        projection: &Projection,
        axis: usize,
        from_mm: DVec3,
        range: RangeInclusive<f64>,
        labels: &Labels<'_>,
    ) -> Self {
        let mut edge = Self {
            axis,
            from_mm,
            away: Vec2::ZERO,
            ticks: Vec::new(),
            step: 1.0,
        };
        let (start, end) = (
            edge.point(projection, *range.start()),
            edge.point(projection, *range.end()),
        );
        let along = (end - start).normalize_or_zero();
        let middle = projection.bounds().middle();
        let across = Vec2::new(along.y, -along.x);
        edge.away = if across.dot(start + 0.5 * (end - start) - middle) < 0.0 {
            -across
        } else {
            across
        };
        let length = (end - start).length();
        let width = range.end() - range.start();
        if length < SHORTEST_AXIS || width.is_nan() || width <= 0.0 {
            return edge;
        }
        // The perspective makes the far end of an edge shorter than its average.
        let points_per_mm = 0.8 * f64::from(length) / width;
        edge.step = round_steps(width / 12.0)
            .find(|&step| {
                let widest = [range.start(), range.end()].map(|&value| labels.size(&tick_text(value, step)));
                let size = widest[0].max(widest[1]);
                let apart = ((size.x + 8.0) / along.x.abs().max(1e-3)).min((size.y + 5.0) / along.y.abs().max(1e-3));
                step * points_per_mm >= f64::from(apart.max(20.0))
            })
            .unwrap_or(width);
        edge.ticks = multiples(&range, edge.step);
        edge
    }

    pub(super) fn point(&self, projection: &Projection, value: f64) -> Vec2 {
        let mut place_mm = self.from_mm;
        place_mm[self.axis] = value;
        projection.point(place_mm)
    }

    pub(super) fn length(&self, projection: &Projection) -> f32 {
        let (low, high) = (
            projection.plot_box.min_mm[self.axis],
            projection.plot_box.max_mm[self.axis],
        );
        (self.point(projection, high) - self.point(projection, low)).length()
    }
}
