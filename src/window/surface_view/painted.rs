//! Painted surface, cached between frames: it does not change when the pointer moves.
//!
//! Thin anti-aliased lines are part of the mesh, so that faces drawn later hide them.

use std::sync::Arc;

use decoupler_files::{
    export::format_number,
    figure::{
        Shape,
        surface::{self, Dots, OrbitCamera, Piece, Section, Sight, Surface, ViewMode},
    },
};
use eframe::egui::{
    self, Color32, Mesh, Painter, Pos2, Rect, Response, Sense, Stroke, StrokeKind, Ui, WidgetInfo, vec2,
};

use crate::window::{
    plotting::{bounds, colour, measure, paint, to_egui},
    theme::{Palette, Theme},
};

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
    frame: Vec<Shape>,
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
        let measure = |text: &str| measure(ui.painter(), text);
        let drawing = surface.lay_out(camera, bounds(rect), &measure, &theme.errors);
        Self {
            surface: surface.clone(),
            camera,
            rect,
            pixels_per_point: ui.pixels_per_point(),
            is_dark: theme.is_dark,
            frame: drawing.frame,
            mesh: Arc::new(mesh(&drawing.mesh, &theme.palette)),
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
        paint(painter, palette, &self.frame);
        painter.add(egui::Shape::Mesh(Arc::clone(&self.mesh)));
        if let Some(section) = section {
            paint(painter, palette, &section.shapes(&self.surface, &self.sight));
        }
        paint(painter, palette, &self.dots.shapes(highlights.marked, highlights.lit));
    }
}

fn mesh(drawn: &surface::Mesh, palette: &Palette) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.reserve_triangles(2 * drawn.pieces.len());
    for vertex in &drawn.vertices {
        mesh.colored_vertex(to_egui(vertex.at), colour(vertex.colour, palette));
    }
    for piece in &drawn.pieces {
        match piece {
            Piece::Cell(cell) => {
                let [a, b, c, d] = cell.map(|corner| corner as u32);
                mesh.add_triangle(a, b, c);
                mesh.add_triangle(a, c, d);
            }
            Piece::Line([from, to], line) => {
                add_line(&mut mesh, to_egui(*from), to_egui(*to), colour(*line, palette));
            }
        }
    }
    mesh
}

/// Half the width over which the edge of a line fades out, in points.
const REACH: f32 = 1.0;

/// Appends a line about one point wide whose colour fades out at both edges.
fn add_line(mesh: &mut Mesh, from: Pos2, to: Pos2, colour: Color32) {
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

/// Colour scale next to one or more surfaces: a vertical bar with ticks.
#[derive(Clone, Debug)]
pub struct ColourBar<'a> {
    /// Scale of the values.
    pub scale: &'a Surface,
    /// Dark or light theme.
    pub theme: &'a Theme,
}

impl ColourBar<'_> {
    /// Width of the bar with its numbers, in points.
    pub const WIDTH: f32 = Surface::SCALE_WIDTH;

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
        let measure = |text: &str| measure(&painter, text);
        let shapes = self.scale.lay_out_scale(bounds(rect), &measure, &self.theme.errors);
        paint(&painter, &self.theme.palette, &shapes);
        response
    }
}
