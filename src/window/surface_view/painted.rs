//! Painted surface, cached between frames: it does not change when the pointer moves.
//!
//! Thin anti-aliased lines are part of the mesh, so that faces drawn later hide them.

use std::sync::Arc;

use decoupler_files::{
    export::format_number,
    figure::surface::{
        self, Bounds, Card, ColourScale, Disc, Dots, Ink, Line, OrbitCamera, Section, Sight, Surface, Text, ViewMode,
    },
};
use eframe::egui::{
    self, Color32, FontId, Mesh, Painter, Pos2, Rect, Response, Sense, Shape, Stroke, StrokeKind, Ui, WidgetInfo, pos2,
    vec2,
};
use glam::Vec2;

use crate::window::theme::{Palette, Theme, rgb, type_size};

/// Nodes that are marked or highlighted.
#[derive(Clone, Copy)]
pub(super) struct Highlights<'a> {
    pub(super) marked: Option<usize>,
    pub(super) lit: &'a [usize],
}

/// Laid-out surface with the arguments that it depends on.
pub(super) struct Painted {
    surface: Surface,
    camera: OrbitCamera,
    rect: Rect,
    pixels_per_point: f32,
    is_dark: bool,
    lines: Vec<Line>,
    texts: Vec<Text>,
    mesh: Arc<Mesh>,
    pub(super) dots: Dots,
    pub(super) sight: Sight,
    pub(super) note: Option<String>,
}

impl Painted {
    /// Returns the cached surface of the last frame if nothing has changed, else lays it out again.
    pub(super) fn of(surface: &Surface, camera: OrbitCamera, theme: &Theme, ui: &Ui, response: &Response) -> Arc<Self> {
        let (id, rect) = (response.id, response.rect);
        let kept: Option<Arc<Self>> = ui.data(|data| data.get_temp(id));
        let camera = match surface.mode {
            ViewMode::ThreeD => camera,
            ViewMode::Top => OrbitCamera::default(),
        };
        let place = (camera, rect, ui.pixels_per_point(), theme.is_dark);
        let is_same = |kept: &Arc<Self>| {
            (kept.camera, kept.rect, kept.pixels_per_point, kept.is_dark) == place && kept.surface.looks_like(surface)
        };
        kept.filter(is_same).unwrap_or_else(|| {
            let painted = Arc::new(Self::new(surface, theme, ui, rect, camera));
            ui.data_mut(|data| data.insert_temp(id, Arc::clone(&painted)));
            painted
        })
    }

    fn new(surface: &Surface, theme: &Theme, ui: &Ui, rect: Rect, camera: OrbitCamera) -> Self {
        let drawing = surface.lay_out(
            camera,
            &Card {
                bounds: bounds(rect),
                measure: &|text| measure(ui.painter(), text),
                colours: theme.colours(&surface.quantity, surface.colours),
            },
        );
        Self {
            surface: surface.clone(),
            camera,
            rect,
            pixels_per_point: ui.pixels_per_point(),
            is_dark: theme.is_dark,
            lines: drawing.lines,
            texts: drawing.texts,
            mesh: Arc::new(mesh(&drawing.mesh)),
            dots: drawing.dots,
            sight: drawing.sight,
            note: drawing.note,
        }
    }

    /// Paints the axes with their labels, the surface, the line of its section, and the nodes, one of them marked and some
    /// highlighted.
    pub(super) fn paint(
        &self,
        painter: &Painter,
        palette: &Palette,
        section: Option<&Section>,
        highlights: Highlights<'_>,
    ) {
        paint_frame(painter, palette, &self.lines, &self.texts);
        painter.add(Shape::Mesh(Arc::clone(&self.mesh)));
        for piece in section
            .map(|section| section.pieces(&self.surface, &self.sight))
            .unwrap_or_default()
        {
            let points: Vec<Pos2> = piece.iter().map(|at| to_egui(at.as_vec2())).collect();
            for (width, colour) in [(3.5, palette.panel.gamma_multiply(0.7)), (1.8, palette.warning)] {
                painter.add(Shape::line(points.clone(), Stroke::new(width, colour)));
            }
        }
        for Disc {
            at,
            radius,
            ring,
            ink,
            opacity,
        } in self.dots.discs(highlights.marked, highlights.lit)
        {
            let (at, colour) = (to_egui(at), colour(ink, palette).gamma_multiply(opacity));
            match ring {
                Some(width) => painter.circle_stroke(at, radius, Stroke::new(width, colour)),
                None => painter.circle_filled(at, radius, colour),
            };
        }
    }
}

/// Paints lines, and texts at whole pixels, to keep small text crisp.
pub(super) fn paint_frame(painter: &Painter, palette: &Palette, lines: &[Line], texts: &[Text]) {
    for line in lines {
        let ends = [line.from, line.to].map(to_egui);
        painter.line_segment(ends, Stroke::new(1.0, colour(line.ink, palette)));
    }
    let pixel = painter.pixels_per_point();
    for Text { bounds, text } in texts {
        let corner = to_egui((bounds.min * pixel).round() / pixel);
        let galley = painter.layout_no_wrap(text.clone(), label_font(), palette.dim);
        painter.galley(corner, galley, palette.dim);
    }
}

/// Returns the size of a label.
pub(super) fn measure(painter: &Painter, text: &str) -> Vec2 {
    let galley = painter.layout_no_wrap(text.to_owned(), label_font(), Color32::WHITE);
    Vec2::new(galley.size().x, galley.size().y)
}

fn label_font() -> FontId {
    FontId::proportional(type_size().small)
}

fn mesh(drawn: &surface::Mesh) -> Mesh {
    let [cells, lines] = drawn.counts();
    let mut mesh = Mesh::default();
    mesh.reserve_vertices(drawn.vertices.len() + VERTICES * lines);
    mesh.reserve_triangles(2 * cells + TRIANGLES * lines);
    for vertex in &drawn.vertices {
        let colour = rgb(vertex.colour);
        let colour = if vertex.opacity < 1.0 {
            colour.gamma_multiply(vertex.opacity)
        } else {
            colour
        };
        mesh.colored_vertex(to_egui(vertex.at), colour);
    }
    for (cells, lines) in drawn.strips() {
        for &cell in cells {
            let [a, b, c, d] = drawn.corners(cell).map(|corner| corner as u32);
            mesh.add_triangle(a, b, c);
            mesh.add_triangle(a, c, d);
        }
        for line in lines {
            let colour = if line.is_black { Color32::BLACK } else { Color32::WHITE };
            let colour = colour.gamma_multiply(line.opacity);
            add_line(&mut mesh, to_egui(line.from), to_egui(line.to), colour);
        }
    }
    mesh
}

fn colour(ink: Ink, palette: &Palette) -> Color32 {
    match ink {
        Ink::Grid => palette.line,
        Ink::Edge => palette.line.lerp_to_gamma(palette.dim, 0.45),
        Ink::Label => palette.dim,
        Ink::Text => palette.text,
        Ink::Ground => palette.panel,
        Ink::Node => Color32::WHITE,
        Ink::Rim => Color32::BLACK,
        Ink::Warning => palette.warning,
        Ink::Accent => palette.accent,
    }
}

pub(super) fn bounds(rect: Rect) -> Bounds {
    Bounds {
        min: to_glam(rect.min),
        max: to_glam(rect.max),
    }
}

pub(super) fn to_egui(point: Vec2) -> Pos2 {
    Pos2::new(point.x, point.y)
}

pub(super) fn to_glam(point: Pos2) -> Vec2 {
    Vec2::new(point.x, point.y)
}

/// Half the width over which the edge of a line fades out, in points.
const REACH: f32 = 1.0;

/// Number of vertices and triangles per line.
pub(super) const VERTICES: usize = 6;
pub(super) const TRIANGLES: usize = 4;

/// Appends a line about one point wide whose colour fades out at both edges.
pub(super) fn add_line(mesh: &mut Mesh, from: Pos2, to: Pos2, colour: Color32) {
    let along = to - from;
    let length = along.length();
    if length < 1e-3 || !length.is_finite() {
        return;
    }
    let across = along.rot90() * (REACH / length);
    let first = mesh.vertices.len() as u32;
    for (side, colour) in [(-1.0, Color32::TRANSPARENT), (0.0, colour), (1.0, Color32::TRANSPARENT)] {
        mesh.colored_vertex(from + across * side, colour);
        mesh.colored_vertex(to + across * side, colour);
    }
    for strip in [first, first + 2] {
        mesh.add_triangle(strip, strip + 1, strip + 2);
        mesh.add_triangle(strip + 2, strip + 1, strip + 3);
    }
}

const STRIPS: usize = 128;

/// Colour scale next to one or more surfaces: a vertical bar with ticks.
#[derive(Clone, Debug)]
pub struct ColourBar<'a> {
    /// Scale of the values.
    pub scale: &'a ColourScale,
    /// Dark or light theme.
    pub theme: &'a Theme,
}

impl ColourBar<'_> {
    /// Width of the bar with its numbers, in points.
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
