//! The frame around a surface seen from above: equal scales on both axes.

use eframe::egui::{Painter, Pos2, Rect, Stroke, StrokeKind, pos2, vec2};
use glam::DVec2;

use super::edge::{GAP, TICK};
use super::labels::Labels;
use crate::app::theme::Theme;
use crate::app::ticks::{multiples, round_steps, tick_text};

/// A laid-out plan: x to the right, y upwards.
pub(super) struct PlanAxes {
    pub(super) labels: Labels,
    frame: Rect,
    min_mm: DVec2,
    points_per_mm: f64,
    ticks: [Vec<f64>; 2],
}

impl PlanAxes {
    /// Fits the rectangle `min_mm..max_mm` and its labels into `card`.
    pub(super) fn new(
        painter: &Painter,
        card: Rect,
        min_mm: DVec2,
        max_mm: DVec2,
        names: [&str; 2],
        theme: &Theme,
    ) -> Self {
        let mut labels = Labels::new(theme.palette.dim);
        let size_mm = max_mm - min_mm;
        let line = labels.size(painter, "0").y;
        let widest = |step: f64| {
            [min_mm.y, max_mm.y]
                .map(|y| labels.size(painter, &tick_text(y, step)).x)
                .into_iter()
                .fold(0.0, f32::max)
        };
        // Numbers and name on the left and below, a little air on the right and above.
        let left = TICK + GAP + widest(0.5);
        let free = Rect::from_min_max(
            card.min + vec2(left, line + 2.0 * GAP),
            card.max - vec2(12.0, TICK + 3.0 * GAP + 2.0 * line),
        );
        // A card too small for its labels still shows a point.
        let points_per_mm =
            (f64::from(free.width().max(1.0)) / size_mm.x).min(f64::from(free.height().max(1.0)) / size_mm.y);
        let frame = Rect::from_center_size(
            free.center(),
            vec2((size_mm.x * points_per_mm) as f32, (size_mm.y * points_per_mm) as f32),
        );
        let step = |width_mm: f64, apart: &dyn Fn(f64) -> f32| {
            let wide_enough = |step: &f64| step * points_per_mm >= f64::from(apart(*step));
            round_steps(width_mm / 20.0).find(wide_enough).unwrap_or(width_mm)
        };
        let size = |value: f64, step: f64| labels.size(painter, &tick_text(value, step)).x;
        let steps = [
            step(size_mm.x, &|step| size(min_mm.x, step).max(size(max_mm.x, step)) + 14.0),
            step(size_mm.y, &|_| line + 12.0),
        ];
        let ticks = [
            multiples(&(min_mm.x..=max_mm.x), steps[0]),
            multiples(&(min_mm.y..=max_mm.y), steps[1]),
        ];

        let mut plan = Self {
            labels: Labels::new(theme.palette.dim),
            frame,
            min_mm,
            points_per_mm,
            ticks,
        };
        for &x in &plan.ticks[0] {
            let anchor = pos2(plan.point(DVec2::new(x, min_mm.y)).x, frame.bottom());
            labels.beside(
                painter,
                anchor,
                vec2(0.0, 1.0),
                TICK + GAP,
                0.0,
                &tick_text(x, steps[0]),
            );
        }
        for &y in &plan.ticks[1] {
            let anchor = pos2(frame.left(), plan.point(DVec2::new(min_mm.x, y)).y);
            labels.beside(
                painter,
                anchor,
                vec2(-1.0, 0.0),
                TICK + GAP,
                0.0,
                &tick_text(y, steps[1]),
            );
        }
        let below = frame.center_bottom();
        labels.beside(painter, below, vec2(0.0, 1.0), TICK + 2.0 * GAP + line, 24.0, names[0]);
        labels.beside(painter, frame.left_top(), vec2(0.0, -1.0), GAP, 24.0, names[1]);
        plan.labels = labels;
        plan
    }

    /// Where a place is on the screen.
    pub(super) fn point(&self, place_mm: DVec2) -> Pos2 {
        let from_corner = (place_mm - self.min_mm) * self.points_per_mm;
        self.frame.left_bottom() + vec2(from_corner.x as f32, -from_corner.y as f32)
    }

    pub(super) fn paint(&self, painter: &Painter, theme: &Theme) {
        let stroke = Stroke::new(1.0, theme.palette.line.lerp_to_gamma(theme.palette.dim, 0.45));
        painter.rect_stroke(self.frame, 0.0, stroke, StrokeKind::Outside);
        for &x in &self.ticks[0] {
            let at = self.point(DVec2::new(x, self.min_mm.y));
            painter.vline(at.x, self.frame.bottom()..=self.frame.bottom() + TICK, stroke);
        }
        for &y in &self.ticks[1] {
            let at = self.point(DVec2::new(self.min_mm.x, y));
            painter.hline(self.frame.left() - TICK..=self.frame.left(), at.y, stroke);
        }
        self.labels.paint(painter);
    }
}
