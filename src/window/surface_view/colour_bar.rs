use eframe::egui::{self, Mesh, Rect, Response, Sense, Stroke, StrokeKind, Ui, WidgetInfo, pos2, vec2};

use super::painted::{bounds, measure, paint_frame, to_egui};
use crate::window::theme::{Theme, rgb};
use decoupler_files::{export::format_number, figure::surface::ColourScale};

const STRIPS: usize = 128;

/// The scale of colours next to one or more surfaces, as a vertical bar with ticks.
#[derive(Clone, Debug)]
pub struct ColourBar<'a> {
    /// Scale of the colours.
    pub scale: &'a ColourScale,
    /// Dark or light.
    pub theme: &'a Theme,
}

impl ColourBar<'_> {
    /// Width that the bar takes with its numbers, in points.
    pub const WIDTH: f32 = ColourScale::WIDTH;

    /// Draws the bar `height` points high.
    pub fn show(self, ui: &mut Ui, height: f32) -> Response {
        let (rect, response) = ui.allocate_exact_size(vec2(Self::WIDTH, height), Sense::click());
        let name = self.scale.quantity.axis_name();
        let label = format!("Colour scale of {name}");
        response.widget_info(|| WidgetInfo::labeled(egui::accesskit::Role::Button, true, &label));
        ui.ctx().accesskit_node_builder(response.id, |node| {
            let (low, high) = (
                format_number(*self.scale.range.start()),
                format_number(*self.scale.range.end()),
            );
            node.set_value(format!("{low} to {high}"));
        });
        if response.has_focus() || response.hovered() {
            let palette = &self.theme.palette;
            let colour = if response.has_focus() {
                palette.accent
            } else {
                palette.line
            };
            let corner = f32::from(crate::window::theme::radius());
            ui.painter()
                .rect_stroke(rect, corner, Stroke::new(1.0, colour), StrokeKind::Inside);
        }
        let painter = ui.painter_at(rect);
        let Some(drawing) = self.scale.lay_out(bounds(rect), &|text| measure(&painter, text)) else {
            return response;
        };
        let bar = Rect::from_min_max(to_egui(drawing.bar.min), to_egui(drawing.bar.max));
        let map = self.theme.colours(&self.scale.quantity, self.scale.colours);
        let mut mesh = Mesh::default();
        for strip in 0..=STRIPS {
            let part = strip as f32 / STRIPS as f32;
            let y = bar.bottom() - part * bar.height();
            mesh.colored_vertex(pos2(bar.left(), y), rgb(map.at(part)));
            mesh.colored_vertex(pos2(bar.right(), y), rgb(map.at(part)));
            if strip > 0 {
                let at = 2 * strip as u32;
                mesh.add_triangle(at - 2, at - 1, at);
                mesh.add_triangle(at - 1, at, at + 1);
            }
        }
        painter.add(mesh);
        let palette = &self.theme.palette;
        let stroke = Stroke::new(1.0, palette.line.lerp_to_gamma(palette.dim, 0.45));
        painter.rect_stroke(bar, 0.0, stroke, StrokeKind::Outside);
        paint_frame(&painter, palette, &drawing.lines, &drawing.texts);
        response
    }
}
