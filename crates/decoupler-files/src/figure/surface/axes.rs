//! The axes around a surface: in space a box with back walls, from above a frame; each with ticks, numbers and names.

use std::ops::RangeInclusive;

use glam::{DVec3, Vec2};

use super::camera::{OrbitCamera, PlotBox, Sight};
use crate::figure::{
    Ink,
    axis::{PlotAxis, step_for, tick_text},
    drawing::{Bounds, Labels, Measure, Shape},
};

/// Length of a tick, in points.
const TICK: f32 = 4.0;
/// Room between a tick and its number, in points.
const GAP: f32 = 3.0;
/// Room kept free around every label, in points.
const CLEARANCE: f32 = 4.0;
/// Axes seen end-on have no ticks.
const SHORTEST_AXIS: f32 = 36.0;

/// Laid-out axes.
pub(super) struct Axes<'a> {
    pub(super) sight: Sight,
    pub(super) labels: Labels<'a>,
    /// Everything behind the surface.
    pub(super) lines: Vec<Shape>,
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
        let lay_out = |camera, [before, after]: [Vec2; 2]| {
            let (min, max) = (card.min + before, card.max - after);
            let size = (max - min).max(Vec2::splat(20.0));
            let target = Bounds::centred(0.5 * (min + max), size);
            Self::in_sight(measure, Sight::fit(plot_box, camera, target), z_range, names)
        };
        // The room for labels and the position of the box depend on each other; a few iterations settle both. They only add
        // room, because labels come and go with the scale.
        let mut room = [Vec2::splat(2.0); 2];
        for _ in 0..5 {
            let axes = lay_out(camera.map(OrbitCamera::centred), room);
            let labels = Bounds::of(axes.labels.bounds().flat_map(|label| [label.min, label.max]));
            let inner = axes.sight.bounds();
            room = [room[0].max(inner.min - labels.min), room[1].max(labels.max - inner.max)];
        }
        lay_out(camera, room)
    }

    fn in_sight(measure: Measure<'a>, sight: Sight, z_range: &RangeInclusive<f64>, names: [&str; 3]) -> Self {
        let plot_box = sight.plot_box;
        let [near_x, near_y] = [usize::from(sight.eye.x > 0.0), 2 * usize::from(sight.eye.y > 0.0)];
        // The z axis is on the left one of the two vertical edges of the outline.
        let outline = [near_x | (2 - near_y), (1 - near_x) | near_y].map(|corner| plot_box.corner_mm(corner));
        let is_left = sight.point(outline[0]).x < sight.point(outline[1]).x;
        let upright = outline[usize::from(!is_left)];
        let starts = [plot_box.corner_mm(near_y), plot_box.corner_mm(near_x), upright];
        let mut labels = Labels::new(measure);
        let mut put = |anchor: Vec2, away: Vec2, gap: f32, slide: usize, text: &str| {
            let reach = gap + 0.5 * away.abs().dot(measure(text));
            let middles = (0..=slide).map(|step| anchor + away * (reach + 4.0 * step as f32));
            labels.place(text, CLEARANCE, middles, |_| Some(0))
        };
        let edges = [0, 1, 2].map(|axis| {
            let range = match axis {
                2 => z_range.clone(),
                _ => plot_box.min_mm[axis]..=plot_box.max_mm[axis],
            };
            let edge = Edge::new(&sight, axis, starts[axis], &range, measure);
            for (place_mm, text) in &edge.numbers {
                put(sight.drawn(*place_mm), edge.away, TICK + GAP, 0, text);
            }
            edge
        });
        // Names are placed last, beyond the numbers: that of an upright axis above it.
        for (axis, edge) in edges.iter().enumerate().filter(|(_, edge)| !edge.numbers.is_empty()) {
            let (share, away, gap) = match axis == 2 || (sight.is_above && axis == 1) {
                true => (1.0, Vec2::NEG_Y, GAP + 1.0),
                false => (0.5, edge.away, TICK + 2.0 * GAP),
            };
            let value = plot_box.min_mm.lerp(plot_box.max_mm, share)[axis];
            let anchor = sight.drawn(moved(starts[axis], axis, value));
            put(anchor, away, gap, 20, names[axis]);
        }
        let near = near_x | near_y;
        let mut lines = Vec::new();
        let mut segment = |ends: [DVec3; 2], ink: Ink| {
            let [from, to] = ends.map(|place| sight.drawn(place));
            lines.push(Shape::line(from, to, ink, 1.0));
        };
        let back = plot_box.corner_mm(3 - near);
        // At each tick of x and y, a line across the floor and one up a back wall; at each tick of z, one across each wall.
        for (axis, edge) in edges.iter().enumerate().filter(|_| !sight.is_above) {
            let [one, other] = [[1, 2], [0, 2], [0, 1]][axis];
            for (place_mm, _) in &edge.numbers {
                for (along, fixed) in [(one, other), (other, one)] {
                    let from = moved(moved(plot_box.min_mm, axis, place_mm[axis]), fixed, back[fixed]);
                    segment([from, moved(from, along, plot_box.max_mm[along])], Ink::Grid);
                }
            }
        }
        // The outline of the floor and of both back walls: without the edges at the upper corner near the eye.
        let hidden = near | 4;
        for (from, axis) in (0..8).flat_map(|corner| [0, 1, 2].map(|axis| (corner, axis))) {
            let to = from | (1 << axis);
            let is_hidden = from == hidden || to == hidden || (sight.is_above && to >= 4);
            if to != from && !is_hidden {
                segment([from, to].map(|corner| plot_box.corner_mm(corner)), Ink::Edge);
            }
        }
        for Edge { away, numbers } in &edges {
            let ticks = numbers.iter().map(|(place_mm, _)| sight.drawn(*place_mm));
            lines.extend(ticks.map(|from| Shape::line(from, from + away * TICK, Ink::Edge, 1.0)));
        }
        Self { sight, labels, lines }
    }
}

/// One axis as drawn: an edge of the box with its ticks.
struct Edge {
    /// Unit vector on the screen away from the box.
    away: Vec2,
    /// Places of the ticks, with their numbers; empty if the edge is too short.
    numbers: Vec<(DVec3, String)>,
}

impl Edge {
    fn new(sight: &Sight, axis: usize, from_mm: DVec3, range: &RangeInclusive<f64>, measure: Measure<'_>) -> Self {
        let ends = [*range.start(), *range.end()];
        let ends_mm = ends.map(|end| moved(from_mm, axis, end));
        let [start, end] = ends_mm.map(|end_mm| sight.drawn(end_mm));
        let (length, along) = ((end - start).length(), (end - start).normalize_or_zero());
        let across = Vec2::new(along.y, -along.x);
        let is_outwards = across.dot(0.5 * (start + end) - sight.bounds().middle()) >= 0.0;
        let sizes = ends.map(|end| measure(&tick_text(end, step_for(range, 8))));
        let size = sizes[0].max(sizes[1]) + Vec2::new(8.0, 5.0);
        let apart = (size / along.abs().max(Vec2::splat(1e-3))).min_element().max(20.0);
        // In perspective, the far end of an edge is shorter than the average.
        let numbers = match length >= SHORTEST_AXIS {
            true => PlotAxis::linear("").numbers(range, apart / (0.8 * length)),
            false => Vec::new(),
        };
        let at = |(share, text)| (ends_mm[0].lerp(ends_mm[1], share), text);
        Self {
            away: if is_outwards { across } else { -across },
            numbers: numbers.into_iter().map(at).collect(),
        }
    }
}

/// The place with this coordinate on an axis.
fn moved(mut place_mm: DVec3, axis: usize, value: f64) -> DVec3 {
    place_mm[axis] = value;
    place_mm
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
                    let plot_box = PlotBox::new([low, low + DVec3::new(wide, deep, 1.16)], size.y / size.x);
                    let names = ["x (mm)", "y (mm)", "error (mm)"];
                    let axes = Axes::new(&measure, card, plot_box, Some(camera), &(4.0..=5.0), names);
                    let covered = axes.sight.bounds().size() / size;
                    let texts: Vec<Bounds> = axes.labels.bounds().collect();
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
