//! The axes around a surface: in space a box with back walls, from above a frame; each with ticks, numbers and names.

use std::ops::RangeInclusive;

use glam::{DVec3, Vec2};

use super::{
    camera::{OrbitCamera, PlotBox, Sight},
    drawing::Labels,
};
use crate::figure::{
    axis::{multiples, round_steps, tick_text},
    drawing::{Bounds, Ink, Measure, Shape},
};

/// Length of a tick, in points.
const TICK: f32 = 4.0;
/// Room between a tick and its number, in points.
const GAP: f32 = 3.0;
/// Axes seen end-on have no ticks.
const SHORTEST_AXIS: f32 = 36.0;

/// Laid-out axes.
pub(super) struct Axes<'a> {
    pub(super) sight: Sight,
    pub(super) labels: Labels<'a>,
    edges: [Edge; 3],
    back: [usize; 2],
}

impl<'a> Axes<'a> {
    /// Fits the box and its labels into `card`; without a camera it is seen from above. `z_range` is the range of the z axis;
    /// the box extends slightly beyond it.
    pub(super) fn new(
        measure: Measure<'a>,
        card: Bounds,
        plot_box: PlotBox,
        camera: Option<OrbitCamera>,
        z_range: &RangeInclusive<f64>,
        names: [&str; 3],
    ) -> Self {
        let build = |camera, target| Self::lay_out(measure, Sight::fit(plot_box, camera, target), z_range, names);
        // The room for labels and the position of the box depend on each other; a few iterations settle both. The last
        // ones only add room, because labels come and go with the scale.
        let (mut target, mut before, mut after) = (card.grown(-32.0), Vec2::ZERO, Vec2::ZERO);
        for round in 0..6 {
            let axes = build(camera.map(OrbitCamera::centred), target);
            let (labels, inner) = (axes.labels.bounds(), axes.sight.bounds());
            let least = if round < 3 {
                [Vec2::splat(2.0); 2]
            } else {
                [before, after]
            };
            before = (inner.min - labels.min).max(least[0]);
            after = (labels.max - inner.max).max(least[1]);
            target = Bounds {
                min: card.min + before,
                max: card.max - after,
            };
            if target.size().min_element() < 20.0 {
                target = Bounds::centred(card.middle(), target.size().max(Vec2::splat(20.0)));
            }
        }
        build(camera, target)
    }

    fn lay_out(measure: Measure<'a>, sight: Sight, z_range: &RangeInclusive<f64>, names: [&str; 3]) -> Self {
        let plot_box = sight.plot_box;
        let near = [usize::from(sight.eye.x > 0.0), usize::from(sight.eye.y > 0.0)];
        let back = [1 - near[0], 1 - near[1]];
        // The z axis is on the left one of the two vertical edges of the outline.
        let outline = [[near[0], back[1]], [back[0], near[1]]].map(|[x, y]| plot_box.corner_mm(x, y, 0));
        let is_left = sight.point(outline[0]).x < sight.point(outline[1]).x;
        let starts = [
            plot_box.corner_mm(0, near[1], 0),
            plot_box.corner_mm(near[0], 0, 0),
            outline[usize::from(!is_left)],
        ];
        let mut labels = Labels::new(measure);
        let mut reaches = [0.0_f32; 3];
        let edges = [0, 1, 2].map(|axis| {
            let range = match axis {
                2 => z_range.clone(),
                _ => plot_box.min_mm[axis]..=plot_box.max_mm[axis],
            };
            let edge = Edge::new(&sight, axis, starts[axis], range, &labels);
            for &value in &edge.ticks {
                let text = tick_text(value, edge.step);
                if labels.place_next_to(edge.point(&sight, value), edge.away, TICK + GAP, 0.0, &text) {
                    let reach = edge.away.abs().dot(labels.size(&text));
                    reaches[axis] = reaches[axis].max(reach);
                }
            }
            edge
        });
        // Names are placed last, beyond the numbers: that of an upright axis above it.
        for edge in edges.iter().filter(|edge| !edge.ticks.is_empty()) {
            let (axis, name) = (edge.axis, names[edge.axis]);
            let (low, high) = (plot_box.min_mm[axis], plot_box.max_mm[axis]);
            if axis == 2 || (sight.is_above && axis == 1) {
                labels.place_next_to(edge.point(&sight, high), Vec2::NEG_Y, GAP + 1.0, 40.0, name);
            } else {
                let gap = TICK + 2.0 * GAP + reaches[axis];
                labels.place_next_to(edge.point(&sight, 0.5 * (low + high)), edge.away, gap, 40.0, name);
            }
        }
        Self {
            sight,
            labels,
            edges,
            back,
        }
    }

    /// Returns everything behind the surface.
    pub(super) fn lines(&self) -> Vec<Shape> {
        let plot_box = self.sight.plot_box;
        let mut lines = Vec::new();
        let mut segment = |from: DVec3, to: DVec3, ink: Ink| {
            let [from, to] = [from, to].map(|place| self.sight.drawn(place));
            lines.push(Shape::line(from, to, ink, 1.0));
        };
        let corner = |x: usize, y: usize, z: usize| plot_box.corner_mm(x, y, z);
        let [back_x, back_y] = self.back;
        if !self.sight.is_above {
            let (low, high, back) = (plot_box.min_mm, plot_box.max_mm, corner(back_x, back_y, 0));
            // At each tick of x and y, a line across the floor and one up a back wall; at each tick of z, one across each
            // wall.
            for (axis, edge) in self.edges.iter().enumerate() {
                let other = [[1, 2], [0, 2], [0, 1]][axis];
                for &value in &edge.ticks {
                    for (along, fixed) in [(other[0], other[1]), (other[1], other[0])] {
                        let mut from = low;
                        from[axis] = value;
                        from[fixed] = back[fixed];
                        let mut to = from;
                        to[along] = high[along];
                        segment(from, to, Ink::Grid);
                    }
                }
            }
            // Outline of both back walls.
            for end in 0..2 {
                segment(corner(end, back_y, 0), corner(end, back_y, 1), Ink::Edge);
            }
            segment(corner(0, back_y, 1), corner(1, back_y, 1), Ink::Edge);
            segment(corner(back_x, 0, 1), corner(back_x, 1, 1), Ink::Edge);
            segment(corner(back_x, 1 - back_y, 0), corner(back_x, 1 - back_y, 1), Ink::Edge);
        }
        for end in 0..2 {
            segment(corner(0, end, 0), corner(1, end, 0), Ink::Edge);
            segment(corner(end, 0, 0), corner(end, 1, 0), Ink::Edge);
        }
        for edge in &self.edges {
            for &value in &edge.ticks {
                let from = edge.point(&self.sight, value);
                lines.push(Shape::line(from, from + edge.away * TICK, Ink::Edge, 1.0));
            }
        }
        lines
    }
}

/// One axis as drawn: an edge of the box with its ticks.
struct Edge {
    axis: usize,
    from_mm: DVec3,
    /// Unit vector on the screen away from the box.
    away: Vec2,
    /// Empty if the edge is too short.
    ticks: Vec<f64>,
    step: f64,
}

impl Edge {
    fn new(sight: &Sight, axis: usize, from_mm: DVec3, range: RangeInclusive<f64>, labels: &Labels<'_>) -> Self {
        let mut edge = Self {
            axis,
            from_mm,
            away: Vec2::ZERO,
            ticks: Vec::new(),
            step: 1.0,
        };
        let [start, end] = [range.start(), range.end()].map(|end| edge.point(sight, *end));
        let along = (end - start).normalize_or_zero();
        let across = Vec2::new(along.y, -along.x);
        let is_outwards = across.dot(0.5 * (start + end) - sight.bounds().middle()) >= 0.0;
        edge.away = if is_outwards { across } else { -across };
        let length = (end - start).length();
        let width = range.end() - range.start();
        if length < SHORTEST_AXIS || width.is_nan() || width <= 0.0 {
            return edge;
        }
        // In perspective, the far end of an edge is shorter than the average.
        let points_per_mm = 0.8 * f64::from(length) / width;
        edge.step = round_steps(width / 12.0)
            .find(|&step| {
                let sizes = [range.start(), range.end()].map(|&value| labels.size(&tick_text(value, step)));
                let size = sizes[0].max(sizes[1]);
                let apart = ((size.x + 8.0) / along.x.abs().max(1e-3)).min((size.y + 5.0) / along.y.abs().max(1e-3));
                step * points_per_mm >= f64::from(apart.max(20.0))
            })
            .unwrap_or(width);
        edge.ticks = multiples(&range, edge.step);
        edge
    }

    fn point(&self, sight: &Sight, value: f64) -> Vec2 {
        let mut place_mm = self.from_mm;
        place_mm[self.axis] = value;
        sight.drawn(place_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_do_not_overlap_or_leave_the_card() {
        let measure = |text: &str| Vec2::new(6.0 * text.chars().count() as f32, 14.0);
        let card_sizes = [(350.0, 540.0), (480.0, 420.0), (260.0, 240.0), (210.0, 240.0)];
        let boxes = [(10.0, 20.0), (10.0, 6.0), (1.0, 1.0), (40.0, 80.0), (1.0, 40.0)];
        for size in card_sizes.map(Vec2::from) {
            for (wide, deep) in boxes {
                for step in 0..40 {
                    let camera = OrbitCamera::default().dragged(21.0 * step as f32, 7.0 * step as f32 - 80.0);
                    let card = Bounds {
                        min: Vec2::splat(10.0),
                        max: Vec2::splat(10.0) + size,
                    };
                    let low = DVec3::new(7.5, 5.5, 3.92);
                    let plot_box = PlotBox::new(low, low + DVec3::new(wide, deep, 1.16), size.y / size.x);
                    let names = ["x (mm)", "y (mm)", "error (mm)"];
                    let axes = Axes::new(&measure, card, plot_box, Some(camera), &(4.0..=5.0), names);
                    let covered = axes.sight.bounds().size() / size;
                    let texts: Vec<Bounds> = axes.labels.bounds_of_each().collect();
                    assert!(texts.len() >= 5, "{camera:?}");
                    for (index, bounds) in texts.iter().enumerate() {
                        let beyond = (card.min - bounds.min).max(bounds.max - card.max).max_element();
                        assert!(beyond < 4.0, "{bounds:?} of {card:?}, {camera:?}");
                        let overlaps = |other: &Bounds| other.intersects(bounds);
                        assert!(!texts[..index].iter().any(overlaps), "{camera:?}");
                    }
                    assert!(covered.max_element() > 0.5, "{covered} of {size:?}");
                }
            }
        }
    }
}
