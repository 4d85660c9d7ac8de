//! Surface widget.

use eframe::egui::{
    self, EventFilter, Key, Label, Modifiers, PointerButton, Pos2, Rect, RectAlign, Response, RichText, Sense, Stroke,
    StrokeKind, Tooltip, Ui, Vec2, WidgetInfo,
};

use super::painted::{Highlights, Painted};
use crate::window::{
    plotting::{to_egui, to_glam},
    theme::{Theme, type_size},
};
use decoupler_files::figure::surface::{OrbitCamera, Section, Sight, Surface, ViewMode};

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
    /// Node to mark, for instance the one under the pointer in a neighbouring view.
    pub marked_node: Option<usize>,
    /// Nodes to highlight, for instance those of a selected bar.
    pub lit_nodes: &'a [usize],
    /// Line of the section shown in a neighbouring figure.
    pub section: Option<&'a Section>,
    /// Dark or light theme.
    pub theme: &'a Theme,
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
    pub fn show(self, ui: &mut Ui, camera: OrbitCamera) -> SurfaceViewResponse {
        self.show_with(ui, camera, Hand::Turns)
    }

    /// As [`Self::show`], but the primary button, scrolling and the keys are left to the caller; drags with Shift or another
    /// button rotate.
    pub fn show_touched(self, ui: &mut Ui, camera: OrbitCamera) -> SurfaceViewResponse {
        self.show_with(ui, camera, Hand::Touches)
    }

    fn show_with(self, ui: &mut Ui, camera: OrbitCamera, hand: Hand) -> SurfaceViewResponse {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        let camera = match self.surface.mode {
            ViewMode::ThreeD => operate(ui, &response, camera, hand),
            ViewMode::Top => camera,
        };
        self.describe(ui, &response);
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
            let stroke = Stroke::new(1.0, self.theme.palette.accent.gamma_multiply(0.6));
            ui.painter().rect_stroke(
                rect,
                f32::from(crate::window::theme::radius()),
                stroke,
                StrokeKind::Inside,
            );
        }
        shown
    }

    fn paint(&self, ui: &mut Ui, rect: Rect, shown: &mut SurfaceViewResponse) {
        let painter = ui.painter_at(rect);
        let painted = Painted::of(self.surface, shown.camera, self.theme, ui, &shown.response);
        shown.sight = Some(painted.sight);
        let is_idle = !shown.response.is_pointer_button_down_on();
        let pointer = shown.response.hover_pos().filter(|_| is_idle);
        shown.hovered_node = pointer.and_then(|pointer| painted.dots.nearest(to_glam(pointer)));
        shown.hovered_at = shown
            .hovered_node
            .and_then(|node| painted.dots.position(node))
            .map(to_egui);
        let highlights = Highlights {
            marked: shown.hovered_node.or(self.marked_node),
            lit: self.lit_nodes,
        };
        painted.paint(&painter, &self.theme.palette, self.section, highlights);
        if let Some(note) = &painted.note {
            // Below the axes, partly in the margin of the card, to keep the size of the picture.
            let size = type_size().small;
            let line = Rect::from_x_y_ranges(rect.x_range(), rect.bottom() - 5.0..=rect.bottom() + size);
            let text = RichText::new(note.as_str())
                .size(size)
                .color(self.theme.palette.warning);
            ui.put(line, Label::new(text).truncate());
        }
    }

    /// Describes the surface to assistive technology: "z 4.0 to 5.0 mm".
    fn describe(&self, ui: &Ui, response: &Response) {
        response.widget_info(|| WidgetInfo::labeled(egui::accesskit::Role::Image, true, self.label));
        ui.ctx().accesskit_node_builder(response.id, |node| {
            node.set_description(self.surface.summary());
            node.set_value(self.surface.range_text());
        });
    }
}

/// Action of the primary button on a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hand {
    /// Rotates the surface.
    Turns,
    /// Handled by the caller.
    Touches,
}

/// Moves the camera: drags rotate, drags with Shift or another button pan, scrolling zooms, and a double click resets. With
/// the focus, the arrow keys, plus, minus and Home do the same.
fn operate(ui: &Ui, response: &Response, camera: OrbitCamera, hand: Hand) -> OrbitCamera {
    let mut camera = camera.clamped();
    if response.clicked() || response.drag_started() {
        response.request_focus();
    }
    let drag = response.drag_delta();
    if response.dragged() && drag != Vec2::ZERO {
        let is_shift = ui.input(|input| input.modifiers.shift);
        let is_primary = response.dragged_by(PointerButton::Primary);
        camera = match hand {
            Hand::Touches if is_primary && !is_shift => camera,
            Hand::Turns if is_shift || !is_primary => {
                camera.panned(drag.x / response.rect.width(), drag.y / response.rect.height())
            }
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
    if response.double_clicked() && hand == Hand::Turns {
        OrbitCamera::default()
    } else {
        camera
    }
}
