//! The scale of colours beside one or more surfaces.

use std::ops::RangeInclusive;

use eframe::egui::{self, Mesh, Rect, Response, Sense, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};

use super::edge::TICK;
use super::labels::Labels;
use super::view::Colours;
use crate::app::theme::Theme;
use crate::app::ticks::{multiples, round_steps, tick_text};

const BAR_WIDTH: f32 = 12.0;
const STRIPS: usize = 128;

/// A vertical colour bar with ticks.
#[derive(Clone, Debug)]
pub struct ColourBar<'a> {
    /// What the colours mean, with the unit: "z (mm)".
    pub title: &'a str,
    /// The values at both ends.
    pub range: RangeInclusive<f64>,
    /// Which map.
    pub colours: Colours,
    /// Dark or light.
    pub theme: &'a Theme,
}

impl ColourBar<'_> {
    /// Width that the bar takes with its numbers, in points.
    pub const WIDTH: f32 = 64.0;

    /// Draws the bar `height` points high.
    pub fn show(self, ui: &mut Ui, height: f32) -> Response {
        let (rect, response) = ui.allocate_exact_size(vec2(Self::WIDTH, height), Sense::hover());
        let (low, high) = (*self.range.start(), *self.range.end());
        response.widget_info(|| {
            WidgetInfo::labeled(
                egui::accesskit::Role::Image,
                true,
                format!("Colour scale of {}", self.title),
            )
        });
        let painter = ui.painter_at(rect);
        let mut labels = Labels::new(self.theme.palette.dim);
        let line = labels.size(&painter, self.title).y;
        let bar = Rect::from_min_max(
            pos2(rect.left() + 8.0, rect.top() + line + 12.0),
            pos2(rect.left() + 8.0 + BAR_WIDTH, rect.bottom() - line),
        );
        if bar.height() < 20.0 || high.partial_cmp(&low) != Some(std::cmp::Ordering::Greater) {
            return response;
        }
        let map = self.colours.map(self.theme);
        let mut mesh = Mesh::default();
        for strip in 0..=STRIPS {
            let part = strip as f32 / STRIPS as f32;
            let y = bar.bottom() - part * bar.height();
            mesh.colored_vertex(pos2(bar.left(), y), map.at(part));
            mesh.colored_vertex(pos2(bar.right(), y), map.at(part));
            if strip > 0 {
                let at = 2 * strip as u32;
                mesh.add_triangle(at - 2, at - 1, at);
                mesh.add_triangle(at - 1, at, at + 1);
            }
        }
        painter.add(mesh);
        let stroke = Stroke::new(1.0, self.theme.palette.line.lerp_to_gamma(self.theme.palette.dim, 0.45));
        painter.rect_stroke(bar, 0.0, stroke, StrokeKind::Outside);

        let points_per_unit = f64::from(bar.height()) / (high - low);
        let step = round_steps((high - low) / 10.0)
            .find(|step| step * points_per_unit >= f64::from(line + 14.0))
            .unwrap_or(high - low);
        for value in multiples(&self.range, step) {
            let y = bar.bottom() - ((value - low) * points_per_unit) as f32;
            painter.hline(bar.right()..=bar.right() + TICK, y, stroke);
            labels.beside(
                &painter,
                pos2(bar.right(), y),
                vec2(1.0, 0.0),
                TICK + 3.0,
                0.0,
                &tick_text(value, step),
            );
        }
        let title_width = labels.size(&painter, self.title).x;
        let title_at = pos2(rect.left() + 4.0 + 0.5 * title_width, bar.top() - 6.0);
        labels.beside(&painter, title_at, vec2(0.0, -1.0), 2.0, 8.0, self.title);
        labels.paint(&painter);
        response
    }
}
