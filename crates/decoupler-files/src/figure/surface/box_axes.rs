//! The box around a surface in space (back walls, ticks, numbers and names), and the frame around a surface seen from
//! above, with equal scales on both axes.

use std::ops::RangeInclusive;

use glam::{DVec2, DVec3, Vec2};

use super::{
    camera::{OrbitCamera, PlotBox, Projection},
    cut::{Edge, GAP, SHORTEST_AXIS, TICK},
    drawing::Labels,
};
use crate::figure::{
    axis::{multiples, round_steps, tick_text},
    drawing::{Bounds, Ink, Measure, Shape, Stroke},
};

/// A laid-out box.
pub(super) struct BoxAxes<'a> {
    pub(super) projection: Projection,
    pub(super) labels: Labels<'a>,
    edges: [Edge; 3],
    back: [usize; 2],
}

impl<'a> BoxAxes<'a> {
    /// Fits the box and its labels into `card`; `z_range` is the range of the z axis; the box extends slightly beyond
    /// it.
    pub(super) fn new(
        measure: Measure<'a>,
        card: Bounds,
        plot_box: PlotBox,
        camera: OrbitCamera,
        z_range: &RangeInclusive<f64>,
        names: [&str; 3],
    ) -> Self {
        let build = |camera, target| Self::lay_out(measure, plot_box, camera, target, z_range, names);
        // The room for labels and the position of the box depend on each other; a few iterations settle both. The last
        // ones only add room, because labels come and go with the scale.
        let (mut target, mut before, mut after) = (card.grown(-32.0), Vec2::ZERO, Vec2::ZERO);
        for round in 0..6 {
            let axes = build(camera.centred(), target);
            let (labels, inner) = (axes.labels.bounds(), axes.projection.bounds());
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

    fn lay_out(
        measure: Measure<'a>,
        plot_box: PlotBox,
        camera: OrbitCamera,
        target: Bounds,
        z_range: &RangeInclusive<f64>,
        names: [&str; 3],
    ) -> Self {
        let projection = Projection::fit(plot_box, camera, target);
        let near = [usize::from(projection.eye.x > 0.0), usize::from(projection.eye.y > 0.0)];
        let back = [1 - near[0], 1 - near[1]];
        // The z axis is on the left one of the two vertical edges of the outline.
        let outline = [[near[0], back[1]], [back[0], near[1]]];
        let screen_x = |corner: [usize; 2]| projection.point(plot_box.corner_mm(corner[0], corner[1], 0)).x;
        let upright = if screen_x(outline[0]) < screen_x(outline[1]) {
            outline[0]
        } else {
            outline[1]
        };
        let starts = [
            plot_box.corner_mm(0, near[1], 0),
            plot_box.corner_mm(near[0], 0, 0),
            plot_box.corner_mm(upright[0], upright[1], 0),
        ];

        let mut labels = Labels::new(measure);
        let mut reaches = [0.0_f32; 3];
        let edges = [0, 1, 2].map(|axis| {
            let range = if axis == 2 {
                z_range.clone()
            } else {
                plot_box.min_mm[axis]..=plot_box.max_mm[axis]
            };
            let mut edge = Edge::new(&projection, axis, starts[axis], range, &labels);
            for &value in &edge.ticks {
                let text = tick_text(value, edge.step);
                if labels.place_next_to(edge.point(&projection, value), edge.away, TICK + GAP, 0.0, &text) {
                    let reach = edge.away.abs().dot(labels.size(&text));
                    reaches[axis] = reaches[axis].max(reach);
                }
            }
            if edge.length(&projection) < SHORTEST_AXIS {
                edge.ticks.clear();
            }
            edge
        });
        // Names are placed last, beyond the numbers.
        for edge in edges.iter().filter(|edge| !edge.ticks.is_empty()) {
            if edge.axis == 2 {
                let top = edge.point(&projection, plot_box.max_mm.z);
                labels.place_next_to(top, Vec2::NEG_Y, GAP + 1.0, 40.0, names[2]);
            } else {
                let middle = 0.5 * (plot_box.min_mm[edge.axis] + plot_box.max_mm[edge.axis]);
                let gap = TICK + 2.0 * GAP + reaches[edge.axis];
                labels.place_next_to(edge.point(&projection, middle), edge.away, gap, 40.0, names[edge.axis]);
            }
        }
        Self {
            projection,
            labels,
            edges,
            back,
        }
    }

    /// Returns everything behind the surface.
    pub(super) fn lines(&self) -> Vec<Shape> {
        let plot_box = self.projection.plot_box;
        let mut lines = Vec::new();
        let mut segment = |from: DVec3, to: DVec3, ink: Ink| {
            let [from, to] = [from, to].map(|place| self.projection.point(place));
            lines.push(Shape::line(from, to, ink, 1.0));
        };
        let (low, high) = (plot_box.min_mm, plot_box.max_mm);
        let back = plot_box.corner_mm(self.back[0], self.back[1], 0);
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
        // Outline of the floor and of both back walls.
        let corner = |x: usize, y: usize, z: usize| plot_box.corner_mm(x, y, z);
        let [back_x, back_y] = self.back;
        for end in 0..2 {
            segment(corner(0, end, 0), corner(1, end, 0), Ink::Edge);
            segment(corner(end, 0, 0), corner(end, 1, 0), Ink::Edge);
            segment(corner(end, back_y, 0), corner(end, back_y, 1), Ink::Edge);
        }
        segment(corner(0, back_y, 1), corner(1, back_y, 1), Ink::Edge);
        segment(corner(back_x, 0, 1), corner(back_x, 1, 1), Ink::Edge);
        segment(corner(back_x, 1 - back_y, 0), corner(back_x, 1 - back_y, 1), Ink::Edge);
        for edge in &self.edges {
            for &value in &edge.ticks {
                let from = edge.point(&self.projection, value);
                lines.push(Shape::line(from, from + edge.away * TICK, Ink::Edge, 1.0));
            }
        }
        lines
    }
}

/// A laid-out plan: x to the right, y upwards.
pub(super) struct PlanAxes<'a> {
    pub(super) labels: Labels<'a>,
    frame: Bounds,
    min_mm: DVec2,
    points_per_mm: f64,
    ticks: [Vec<f64>; 2],
}

impl<'a> PlanAxes<'a> {
    /// Fits the rectangle `min_mm..max_mm` and its labels into `card`.
    pub(super) fn new(measure: Measure<'a>, card: Bounds, min_mm: DVec2, max_mm: DVec2, names: [&str; 2]) -> Self {
        let labels = Labels::new(measure);
        let size_mm = max_mm - min_mm;
        let line = labels.size("0").y;
        let width = |value: f64, step: f64| labels.size(&tick_text(value, step)).x;
        // Numbers and names on the left and below, a small margin on the right and above.
        let left = TICK + GAP + width(min_mm.y, 0.5).max(width(max_mm.y, 0.5));
        let free = Bounds {
            min: card.min + Vec2::new(left, line + 2.0 * GAP),
            max: card.max - Vec2::new(12.0, TICK + 3.0 * GAP + 2.0 * line),
        };
        // A card that is too small for its labels still has a visible plot.
        let points_per_mm = (free.size().max(Vec2::ONE).as_dvec2() / size_mm).min_element();
        let step = |width_mm: f64, apart: &dyn Fn(f64) -> f32| {
            let wide_enough = |step: &f64| step * points_per_mm >= f64::from(apart(*step));
            round_steps(width_mm / 20.0).find(wide_enough).unwrap_or(width_mm)
        };
        let steps = [
            step(size_mm.x, &|step| {
                width(min_mm.x, step).max(width(max_mm.x, step)) + 14.0
            }),
            step(size_mm.y, &|_| line + 12.0),
        ];
        let mut plan = Self {
            labels,
            frame: Bounds::centred(free.middle(), (size_mm * points_per_mm).as_vec2()),
            min_mm,
            points_per_mm,
            ticks: [0, 1].map(|axis| multiples(&(min_mm[axis]..=max_mm[axis]), steps[axis])),
        };
        for (anchor, away, text) in plan.marks(steps) {
            plan.labels.place_next_to(anchor, away, TICK + GAP, 0.0, &text);
        }
        let frame = plan.frame;
        let below = Vec2::new(frame.middle().x, frame.max.y);
        plan.labels
            .place_next_to(below, Vec2::Y, TICK + 2.0 * GAP + line, 24.0, names[0]);
        plan.labels.place_next_to(frame.min, Vec2::NEG_Y, GAP, 24.0, names[1]);
        plan
    }

    /// Returns the place, direction and number of each tick.
    fn marks(&self, steps: [f64; 2]) -> Vec<(Vec2, Vec2, String)> {
        let x = self.ticks[0].iter().map(|&x| {
            let at = self.point(DVec2::new(x, self.min_mm.y)).x;
            (Vec2::new(at, self.frame.max.y), Vec2::Y, tick_text(x, steps[0]))
        });
        let y = self.ticks[1].iter().map(|&y| {
            let at = self.point(DVec2::new(self.min_mm.x, y)).y;
            (Vec2::new(self.frame.min.x, at), Vec2::NEG_X, tick_text(y, steps[1]))
        });
        x.chain(y).collect()
    }

    /// Returns the position of a place on the screen.
    pub(super) fn point(&self, place_mm: DVec2) -> Vec2 {
        let from_corner = ((place_mm - self.min_mm) * self.points_per_mm).as_vec2();
        Vec2::new(self.frame.min.x + from_corner.x, self.frame.max.y - from_corner.y)
    }

    /// A corner in millimetres, its point on the screen, and the scale.
    pub(super) fn corner(&self) -> (DVec2, Vec2, f64) {
        let corner = Vec2::new(self.frame.min.x, self.frame.max.y);
        (self.min_mm, corner, self.points_per_mm)
    }

    /// The outline with its ticks.
    pub(super) fn lines(&self) -> Vec<Shape> {
        // Drawn around the outermost cells, not over them.
        let outline = self.frame.grown(0.5).outline(Stroke::new(Ink::Edge, 1.0));
        let ticks = self.marks([1.0; 2]).into_iter();
        let ticks = ticks.map(|(from, away, _)| Shape::line(from, from + away * TICK, Ink::Edge, 1.0));
        std::iter::once(outline).chain(ticks).collect()
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
                    let axes = BoxAxes::new(&measure, card, plot_box, camera, &(4.0..=5.0), names);
                    let covered = axes.projection.bounds().size() / size;
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
