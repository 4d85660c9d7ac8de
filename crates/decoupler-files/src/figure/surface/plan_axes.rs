//! The frame around a surface seen from above: equal scales on both axes.

use glam::{DVec2, Vec2};

use super::{
    edge::{GAP, TICK},
    labels::Labels,
    shapes::{Bounds, Ink, Line},
};
use crate::figure::ticks::{multiples, round_steps, tick_text};

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
    pub(super) fn new(
        measure: &'a dyn Fn(&str) -> Vec2,
        card: Bounds,
        min_mm: DVec2,
        max_mm: DVec2,
        names: [&str; 2],
    ) -> Self {
        let labels = Labels::new(measure);
        let size_mm = max_mm - min_mm;
        let line = labels.size("0").y;
        let width = |value: f64, step: f64| labels.size(&tick_text(value, step)).x;
        // Numbers and name on the left and below, a little air on the right and above.
        let left = TICK + GAP + width(min_mm.y, 0.5).max(width(max_mm.y, 0.5));
        let free = Bounds {
            min: card.min + Vec2::new(left, line + 2.0 * GAP),
            max: card.max - Vec2::new(12.0, TICK + 3.0 * GAP + 2.0 * line),
        };
        // A card too small for its labels still shows a point.
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
            plan.labels.beside(anchor, away, TICK + GAP, 0.0, &text);
        }
        let frame = plan.frame;
        let below = Vec2::new(frame.middle().x, frame.max.y);
        plan.labels
            .beside(below, Vec2::Y, TICK + 2.0 * GAP + line, 24.0, names[0]);
        plan.labels.beside(frame.min, Vec2::NEG_Y, GAP, 24.0, names[1]);
        plan
    }

    /// Each tick: the place of it, which way it points, its number.
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
    pub(super) fn lines(&self) -> Vec<Line> {
        let line = |from: Vec2, to: Vec2| Line {
            from,
            to,
            ink: Ink::Edge,
        };
        // Around the outermost cells, not over them.
        let Bounds { min, max } = self.frame.grown(0.5);
        let (right_top, left_bottom) = (Vec2::new(max.x, min.y), Vec2::new(min.x, max.y));
        let outline = [
            line(min, right_top),
            line(right_top, max),
            line(max, left_bottom),
            line(left_bottom, min),
        ];
        let ticks = self.marks([1.0; 2]).into_iter();
        outline
            .into_iter()
            .chain(ticks.map(|(from, away, _)| line(from, from + away * TICK)))
            .collect()
    }
}
