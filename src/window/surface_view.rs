//! Widget that shows a [`Surface`] and lets the user rotate it, and its colour scale.
//!
//! The painted surface is cached between frames: it does not change when the pointer moves. Its thin anti-aliased lines
//! are part of the mesh, so that faces drawn later hide them.

use std::sync::Arc;

use decoupler_files::{
    export::format_number,
    figure::surface::{Drawing, OrbitCamera, Piece, Sight, Surface, SurfaceFigure, ViewMode},
};
use eframe::egui::{
    self, Color32, EventFilter, Key, Label, Mesh, Modifiers, PointerButton, Pos2, Rect, RectAlign, Response, RichText,
    Sense, Stroke, StrokeKind, Tooltip, Ui, Vec2, WidgetInfo, accesskit::Role, vec2,
};

use crate::window::{
    plotting::{bounds, colour, measure, paint, to_egui, to_glam},
    theme::{Palette, Theme, radius, type_size},
};

/// Points of a drag that one press of an arrow key is worth.
const POINTS_PER_KEY: f32 = 12.5;
const ZOOM_PER_KEY: f32 = 1.15;
const ZOOM_PER_POINT: f32 = 0.0025;

/// Surface plot that fills the available space.
#[derive(Clone, Debug)]
pub struct SurfaceView<'a> {
    /// Name for assistive technology and tests, such as "Actual surface"; must be unique among its siblings.
    pub label: &'a str,
    /// Surface that is drawn.
    pub surface: &'a Surface,
    /// Figure of the surface, with the camera, the marked and highlighted nodes, and the line of a section.
    pub figure: &'a SurfaceFigure,
    /// True if the primary button, scrolling and the keys are left to the caller; drags with Shift or another button rotate.
    pub is_touched: bool,
}

/// Response of a [`SurfaceView`] to the pointer.
#[derive(Clone, Debug)]
pub struct SurfaceViewResponse {
    /// Camera after drags, scrolling and keys.
    pub camera: OrbitCamera,
    /// Node under the pointer.
    pub hovered_node: Option<usize>,
    /// Position of that node on the screen.
    pub hovered_at: Option<Pos2>,
    /// Inverse projection from points on the screen; `None` if there is no room for a picture.
    pub sight: Option<Sight>,
    /// Response of the whole card.
    pub response: Response,
}

impl SurfaceViewResponse {
    /// Shows a tooltip for the node under the pointer, if there is one: `content` receives the index of the node. The tooltip is
    /// above the node, where it does not hide the surface around it; next to it at the edge of the window.
    pub fn node_tooltip_ui(&self, content: impl FnOnce(&mut Ui, usize)) {
        if let (Some(node), Some(at)) = (self.hovered_node, self.hovered_at) {
            let anchor = Rect::from_center_size(at, Vec2::splat(20.0));
            let (ctx, layer) = (self.response.ctx.clone(), self.response.layer_id);
            let mut tooltip = Tooltip::always_open(ctx, layer, self.response.id.with("node"), anchor).gap(12.0);
            let alternatives = &[RectAlign::RIGHT, RectAlign::LEFT, RectAlign::BOTTOM];
            tooltip.popup = tooltip.popup.align(RectAlign::TOP).align_alternatives(alternatives);
            tooltip.show(|ui| content(ui, node));
        }
    }
}

impl SurfaceView<'_> {
    /// Draws the surface in the remaining space and lets the user rotate it.
    pub fn show(self, ui: &mut Ui) -> SurfaceViewResponse {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        let camera = match self.surface.mode {
            ViewMode::ThreeD => operate(ui, &response, self.figure.camera, self.is_touched),
            ViewMode::Top => self.figure.camera,
        };
        // Described to assistive technology as "z 4.0 to 5.0 mm".
        response.widget_info(|| WidgetInfo::labeled(Role::Image, true, self.label));
        ui.ctx().accesskit_node_builder(response.id, |node| {
            node.set_description(self.surface.summary());
            node.set_value(self.surface.range_text());
        });
        let mut shown = SurfaceViewResponse {
            camera,
            hovered_node: None,
            hovered_at: None,
            sight: None,
            response,
        };
        if ui.is_rect_visible(rect) && rect.width() > 60.0 && rect.height() > 60.0 {
            self.paint(ui, rect, &mut shown);
        }
        if shown.response.has_focus() {
            let stroke = Stroke::new(1.0, Theme::of(ui).palette.accent.gamma_multiply(0.6));
            ui.painter()
                .rect_stroke(rect, f32::from(radius()), stroke, StrokeKind::Inside);
        }
        shown
    }

    /// Paints the axes with their labels, the surface, the line of its section, and the nodes, one of them marked and some
    /// highlighted.
    fn paint(&self, ui: &mut Ui, rect: Rect, shown: &mut SurfaceViewResponse) {
        let (painter, theme) = (ui.painter_at(rect), Theme::of(ui));
        let palette = &theme.palette;
        let painted = Painted::of(self.surface, shown.camera, theme, ui, &shown.response);
        let Drawing { dots, sight, note, .. } = &painted.drawing;
        let is_idle = !shown.response.is_pointer_button_down_on();
        let pointer = shown.response.hover_pos().filter(|_| is_idle);
        shown.sight = Some(*sight);
        shown.hovered_node = pointer.and_then(|pointer| dots.nearest(to_glam(pointer)));
        shown.hovered_at = shown.hovered_node.and_then(|node| dots.position(node)).map(to_egui);
        paint(&painter, palette, &painted.drawing.frame);
        painter.add(egui::Shape::Mesh(Arc::clone(&painted.mesh)));
        if let Some(section) = &self.figure.section {
            paint(&painter, palette, &section.shapes(&painted.surface, sight));
        }
        let marked = shown.hovered_node.or(self.figure.marked_node);
        paint(&painter, palette, &dots.shapes(marked, &self.figure.lit_nodes));
        if let Some(note) = note {
            // Below the axes, partly in the margin of the card, to keep the size of the picture.
            let size = type_size().small;
            let line = Rect::from_x_y_ranges(rect.x_range(), rect.bottom() - 5.0..=rect.bottom() + size);
            let text = RichText::new(note.as_str()).size(size).color(palette.warning);
            ui.put(line, Label::new(text).truncate());
        }
    }
}

/// Moves the camera: drags rotate, drags with Shift or another button pan, scrolling zooms, and a double click resets. With
/// the focus, the arrow keys, plus, minus and Home do the same. If the surface is touched, the primary button is the
/// caller's, and what else it would pan rotates.
fn operate(ui: &Ui, response: &Response, camera: OrbitCamera, is_touched: bool) -> OrbitCamera {
    let mut camera = camera.clamped();
    if response.clicked() || response.drag_started() {
        response.request_focus();
    }
    let drag = response.drag_delta();
    if response.dragged() && drag != Vec2::ZERO {
        let is_plain = response.dragged_by(PointerButton::Primary) && !ui.input(|input| input.modifiers.shift);
        camera = match (is_touched, is_plain) {
            (true, true) => camera,
            (false, false) => camera.panned(drag.x / response.rect.width(), drag.y / response.rect.height()),
            _ => camera.dragged(drag.x, drag.y),
        };
    }
    if response.contains_pointer() {
        let (scroll, pinch) = ui.input_mut(|input| {
            // Consumed, so that no enclosing scroll area scrolls as well.
            let scroll = std::mem::take(&mut input.smooth_scroll_delta);
            (scroll.y, input.zoom_delta())
        });
        if scroll != 0.0 || pinch != 1.0 {
            camera = camera.zoomed((scroll * ZOOM_PER_POINT).exp() * pinch);
        }
    }
    if response.has_focus() {
        let arrows = EventFilter {
            horizontal_arrows: true,
            vertical_arrows: true,
            ..EventFilter::default()
        };
        ui.memory_mut(|memory| memory.set_focus_lock_filter(response.id, arrows));
        ui.input_mut(|input| {
            let mut presses = |key| input.count_and_consume_key(Modifiers::NONE, key) as f32;
            let right = presses(Key::ArrowRight) - presses(Key::ArrowLeft);
            let down = presses(Key::ArrowDown) - presses(Key::ArrowUp);
            let nearer = presses(Key::Plus) + presses(Key::Equals) - presses(Key::Minus);
            if right != 0.0 || down != 0.0 || nearer != 0.0 {
                let turned = camera.dragged(right * POINTS_PER_KEY, down * POINTS_PER_KEY);
                camera = turned.zoomed(ZOOM_PER_KEY.powf(nearer));
            }
            if presses(Key::Home) > 0.0 {
                camera = OrbitCamera::default();
            }
        });
    }
    if response.double_clicked() && !is_touched {
        camera = OrbitCamera::default();
    }
    camera
}

/// Laid-out surface with what it depends on.
struct Painted {
    surface: Surface,
    place: Place,
    drawing: Drawing,
    mesh: Arc<Mesh>,
}

/// Camera, card, pixels per point, and whether the theme is dark.
type Place = (OrbitCamera, Rect, f32, bool);

impl Painted {
    /// Returns the surface of the last frame if nothing has changed, else lays it out again.
    fn of(surface: &Surface, camera: OrbitCamera, theme: &Theme, ui: &Ui, response: &Response) -> Arc<Self> {
        let kept: Option<Arc<Self>> = ui.data(|data| data.get_temp(response.id));
        let camera = match surface.mode {
            ViewMode::ThreeD => camera,
            ViewMode::Top => OrbitCamera::default(),
        };
        let place = (camera, response.rect, ui.pixels_per_point(), theme.is_dark);
        let is_same = |kept: &Arc<Self>| kept.place == place && kept.surface.looks_like(surface);
        kept.filter(is_same).unwrap_or_else(|| {
            let measure = |text: &str| measure(ui.painter(), text);
            let mut drawing = surface.lay_out(camera, bounds(response.rect), &measure, &theme.errors);
            let painted = Arc::new(Self {
                surface: surface.clone(),
                place,
                mesh: Arc::new(mesh(&std::mem::take(&mut drawing.mesh), &theme.palette)),
                drawing,
            });
            ui.data_mut(|data| data.insert_temp(response.id, Arc::clone(&painted)));
            painted
        })
    }
}

fn mesh(drawn: &decoupler_files::figure::surface::Mesh, palette: &Palette) -> Mesh {
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

/// Appends a line about one point wide whose colour fades out at both edges.
fn add_line(mesh: &mut Mesh, from: Pos2, to: Pos2, colour: Color32) {
    /// Half the width over which the edge fades out, in points.
    const REACH: f32 = 1.0;
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

/// Draws the colour scale of one or more surfaces: a vertical bar with ticks, `height` points high.
pub fn colour_bar_ui(ui: &mut Ui, scale: &Surface, height: f32) -> Response {
    let (rect, response) = ui.allocate_exact_size(vec2(Surface::SCALE_WIDTH, height), Sense::click());
    let label = format!("Colour scale of {}", scale.quantity.axis_name());
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, &label));
    ui.ctx().accesskit_node_builder(response.id, |node| {
        let [low, high] = [scale.range.start(), scale.range.end()].map(|end| format_number(*end));
        node.set_value(format!("{low} to {high}"));
    });
    let Theme { palette, errors, .. } = Theme::of(ui);
    if response.has_focus() || response.hovered() {
        let colour = if response.has_focus() {
            palette.accent
        } else {
            palette.line
        };
        let stroke = Stroke::new(1.0, colour);
        ui.painter()
            .rect_stroke(rect, f32::from(radius()), stroke, StrokeKind::Inside);
    }
    let painter = ui.painter_at(rect);
    let measure = |text: &str| measure(&painter, text);
    paint(&painter, palette, &scale.lay_out_scale(bounds(rect), &measure, errors));
    response
}
