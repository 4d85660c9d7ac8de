//! The box around a surface in space: back walls, ticks, numbers and names.

use std::ops::RangeInclusive;

use eframe::egui::{Painter, Rect, Stroke, Vec2, vec2};
use glam::DVec3;

use super::camera::OrbitCamera;
use super::edge::{Edge, GAP, SHORTEST_AXIS, TICK, to_egui, to_glam};
use super::labels::Labels;
use super::projection::{Bounds, PlotBox, Projection};
use crate::app::theme::Theme;
use crate::app::ticks::tick_text;

/// A laid-out box.
pub(super) struct SpaceAxes {
    pub(super) projection: Projection,
    pub(super) labels: Labels,
    edges: [Edge; 3],
    back: [usize; 2],
}

impl SpaceAxes {
    /// Fits the box and its labels into `card`; `z_range` is what the z axis counts, which the box surpasses a little.
    pub(super) fn new(
        painter: &Painter,
        card: Rect,
        plot_box: PlotBox,
        camera: OrbitCamera,
        z_range: &RangeInclusive<f64>,
        names: [&str; 3],
        theme: &Theme,
    ) -> Self {
        let build = |camera, target| Self::lay_out(painter, plot_box, camera, target, z_range, names, theme);
        // The labels' room depends on where the box is and the other way round; a few rounds settle it. The last ones
        // only give more room, for labels come and go with the scale.
        let (mut target, mut before, mut after) = (card.shrink(32.0), Vec2::ZERO, Vec2::ZERO);
        for round in 0..6 {
            let axes = build(camera.centred(), target);
            let (labels, inner) = (axes.labels.bounds(), axes.projection.bounds());
            let least = if round < 3 {
                [Vec2::splat(2.0); 2]
            } else {
                [before, after]
            };
            before = vec2(inner.min.x - labels.left(), inner.min.y - labels.top()).max(least[0]);
            after = vec2(labels.right() - inner.max.x, labels.bottom() - inner.max.y).max(least[1]);
            target = Rect::from_min_max(card.min + before, card.max - after);
            if target.width() < 20.0 || target.height() < 20.0 {
                target = Rect::from_center_size(card.center(), target.size().max(Vec2::splat(20.0)));
            }
        }
        build(camera, target)
    }

    fn lay_out(
        painter: &Painter,
        plot_box: PlotBox,
        camera: OrbitCamera,
        target: Rect,
        z_range: &RangeInclusive<f64>,
        names: [&str; 3],
        theme: &Theme,
    ) -> Self {
        let target = Bounds {
            min: to_glam(target.min),
            max: to_glam(target.max),
        };
        let projection = Projection::fit(plot_box, camera, target);
        let near = [usize::from(projection.eye.x > 0.0), usize::from(projection.eye.y > 0.0)];
        let back = [1 - near[0], 1 - near[1]];
        // The z axis stands on the left of the two upright edges of the outline.
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

        let mut labels = Labels::new(theme.palette.dim);
        let mut reaches = [0.0_f32; 3];
        let edges = [0, 1, 2].map(|axis| {
            let range = if axis == 2 {
                z_range.clone()
            } else {
                plot_box.min_mm[axis]..=plot_box.max_mm[axis]
            };
            let mut edge = Edge::new(&projection, axis, starts[axis], range, &labels, painter);
            for &value in &edge.ticks {
                let text = tick_text(value, edge.step);
                if labels.beside(
                    painter,
                    edge.point(&projection, value),
                    edge.away,
                    TICK + GAP,
                    0.0,
                    &text,
                ) {
                    let size = labels.size(painter, &text);
                    let reach = edge.away.x.abs() * size.x + edge.away.y.abs() * size.y;
                    reaches[axis] = reaches[axis].max(reach);
                }
            }
            if edge.length(&projection) < SHORTEST_AXIS {
                edge.ticks.clear();
            }
            edge
        });
        // Names come last: they find room beyond the numbers.
        for edge in edges.iter().filter(|edge| !edge.ticks.is_empty()) {
            if edge.axis == 2 {
                let top = edge.point(&projection, plot_box.max_mm.z);
                labels.beside(painter, top, vec2(0.0, -1.0), GAP + 1.0, 40.0, names[2]);
            } else {
                let middle = 0.5 * (plot_box.min_mm[edge.axis] + plot_box.max_mm[edge.axis]);
                let gap = TICK + 2.0 * GAP + reaches[edge.axis];
                labels.beside(
                    painter,
                    edge.point(&projection, middle),
                    edge.away,
                    gap,
                    40.0,
                    names[edge.axis],
                );
            }
        }
        Self {
            projection,
            labels,
            edges,
            back,
        }
    }

    /// Everything that lies behind the surface, and the labels around it.
    pub(super) fn paint(&self, painter: &Painter, theme: &Theme) {
        let plot_box = self.projection.plot_box;
        let faint = Stroke::new(1.0, theme.palette.line);
        let strong = Stroke::new(1.0, theme.palette.line.lerp_to_gamma(theme.palette.dim, 0.45));
        let segment = |from: DVec3, to: DVec3, stroke: Stroke| {
            painter.line_segment(
                [to_egui(self.projection.point(from)), to_egui(self.projection.point(to))],
                stroke,
            );
        };
        let (low, high) = (plot_box.min_mm, plot_box.max_mm);
        let (back_x, back_y) = (
            plot_box.corner_mm(self.back[0], 0, 0).x,
            plot_box.corner_mm(0, self.back[1], 0).y,
        );

        for &x in &self.edges[0].ticks {
            segment(DVec3::new(x, low.y, low.z), DVec3::new(x, high.y, low.z), faint);
            segment(DVec3::new(x, back_y, low.z), DVec3::new(x, back_y, high.z), faint);
        }
        for &y in &self.edges[1].ticks {
            segment(DVec3::new(low.x, y, low.z), DVec3::new(high.x, y, low.z), faint);
            segment(DVec3::new(back_x, y, low.z), DVec3::new(back_x, y, high.z), faint);
        }
        for &z in &self.edges[2].ticks {
            segment(DVec3::new(low.x, back_y, z), DVec3::new(high.x, back_y, z), faint);
            segment(DVec3::new(back_x, low.y, z), DVec3::new(back_x, high.y, z), faint);
        }
        // Outline of the floor and of both back walls.
        for end in 0..2 {
            segment(plot_box.corner_mm(0, end, 0), plot_box.corner_mm(1, end, 0), strong);
            segment(plot_box.corner_mm(end, 0, 0), plot_box.corner_mm(end, 1, 0), strong);
            segment(
                plot_box.corner_mm(0, self.back[1], end),
                plot_box.corner_mm(1, self.back[1], end),
                strong,
            );
            segment(
                plot_box.corner_mm(self.back[0], 0, end),
                plot_box.corner_mm(self.back[0], 1, end),
                strong,
            );
            segment(
                plot_box.corner_mm(end, self.back[1], 0),
                plot_box.corner_mm(end, self.back[1], 1),
                strong,
            );
        }
        let front_y = 1 - self.back[1];
        segment(
            plot_box.corner_mm(self.back[0], front_y, 0),
            plot_box.corner_mm(self.back[0], front_y, 1),
            strong,
        );
        for edge in &self.edges {
            for &value in &edge.ticks {
                let point = edge.point(&self.projection, value);
                painter.line_segment([point, point + edge.away * TICK], strong);
            }
        }
        self.labels.paint(painter);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use eframe::egui::{Context, RawInput, pos2};

    #[test]
    fn labels_neither_overlap_nor_leave_the_card() {
        let ctx = Context::default();
        crate::app::theme::install(&ctx, true);
        let card_sizes = [vec2(350.0, 540.0), vec2(480.0, 420.0), vec2(260.0, 240.0)];
        let boxes = [(10.0, 20.0), (10.0, 6.0), (1.0, 1.0), (40.0, 80.0), (1.0, 40.0)];
        let mut layouts = 0;
        let output = ctx.run_ui(RawInput::default(), |ui| {
            for size in card_sizes {
                for (wide, deep) in boxes {
                    for step in 0..40 {
                        let camera = OrbitCamera::default().dragged(21.0 * step as f32, 7.0 * step as f32 - 80.0);
                        let card = Rect::from_min_size(pos2(10.0, 10.0), size);
                        let low = DVec3::new(7.5, 5.5, 3.92);
                        let plot_box = PlotBox::new(low, low + DVec3::new(wide, deep, 1.16), size.y / size.x);
                        let names = ["x (mm)", "y (mm)", "error (mm)"];
                        let theme = Theme::dark();
                        let axes = SpaceAxes::new(ui.painter(), card, plot_box, camera, &(4.0..=5.0), names, theme);
                        let rects: Vec<Rect> = axes.labels.rects().collect();
                        assert!(rects.len() >= 5, "{camera:?}");
                        for (index, rect) in rects.iter().enumerate() {
                            assert!(
                                card.expand(4.0).contains_rect(*rect),
                                "{rect:?} of {card:?}, {camera:?}"
                            );
                            assert!(
                                !rects[..index].iter().any(|other| other.intersects(*rect)),
                                "{camera:?}"
                            );
                        }
                        let covered = axes.projection.bounds().size();
                        assert!(
                            covered.x > 0.55 * size.x || covered.y > 0.55 * size.y,
                            "{covered} of {size:?}"
                        );
                        layouts += 1;
                    }
                }
            }
        });
        output.drop_without_applying_deltas();
        assert!(layouts >= 600);
    }
}
