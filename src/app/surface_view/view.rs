//! The widget.

use std::ops::RangeInclusive;

use eframe::egui::{
    self, EventFilter, Key, Modifiers, PointerButton, Pos2, Rect, Response, Sense, Stroke, StrokeKind, Tooltip, Ui,
    Vec2, WidgetInfo,
};
use glam::{DVec2, DVec3};

use super::axes::SpaceAxes;
use super::camera::OrbitCamera;
use super::mesh::{Stage, Surface};
use super::nodes;
use super::plan::PlanAxes;
use super::projection::PlotBox;
use super::ticks::tick_text;
use crate::app::theme::{ColourMap, Theme};
use crate::surface::Grid;

/// Room for overshoots of the surface above and below the range, as a part of it.
const HEADROOM: f64 = 0.08;

/// Room that the labels of a box usually take, in points.
const LABELS: Vec2 = Vec2::new(72.0, 56.0);

/// What the values mean, and with it their colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colours {
    /// Heights, in viridis.
    Height,
    /// Errors, diverging about zero.
    Error,
}

impl Colours {
    pub(super) fn map(self, theme: &Theme) -> &ColourMap {
        match self {
            Self::Height => &theme.heights,
            Self::Error => &theme.errors,
        }
    }

    /// Name of the value axis, with its unit.
    pub fn title(self) -> &'static str {
        match self {
            Self::Height => "z (mm)",
            Self::Error => "error (mm)",
        }
    }
}

/// From where the surface is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum ViewMode {
    /// In space.
    #[default]
    ThreeD,
    /// From above, as a map.
    Top,
}

/// A surface plot that fills the space it is given.
#[derive(Clone, Debug)]
pub struct SurfaceView<'a> {
    /// Name for assistive technology and tests, and the id among its siblings: "Actual surface".
    pub label: &'a str,
    /// Where the values are.
    pub grid: &'a Grid,
    /// Millimetres on the grid, `x points × y points`. NaN leaves a gap.
    pub values_mm: &'a [f64],
    /// The nodes: x, y and value in millimetres. NaN hides one.
    pub nodes_mm: &'a [DVec3],
    /// Values at the ends of the colours and of the z axis.
    pub range_mm: RangeInclusive<f64>,
    /// What the values mean.
    pub colours: Colours,
    /// From where.
    pub mode: ViewMode,
    /// A node to mark, for instance the one hovered in a neighbouring view.
    pub highlight: Option<usize>,
    /// Dark or light.
    pub theme: &'a Theme,
}

/// What the user did to a [`SurfaceView`].
#[derive(Clone, Debug)]
pub struct SurfaceViewResponse {
    /// The camera, turned by drags, scrolling and keys.
    pub camera: OrbitCamera,
    /// The node under the pointer.
    pub hovered_node: Option<usize>,
    /// Where that node is on the screen.
    pub hovered_at: Option<Pos2>,
    /// Of the whole card.
    pub response: Response,
}

impl SurfaceViewResponse {
    /// Shows a tooltip beside the hovered node, if there is one: `content` gets the node's index.
    pub fn node_tooltip_ui(&self, content: impl FnOnce(&mut Ui, usize)) {
        if let (Some(node), Some(at)) = (self.hovered_node, self.hovered_at) {
            let anchor = Rect::from_center_size(at, Vec2::splat(20.0));
            let (ctx, layer) = (self.response.ctx.clone(), self.response.layer_id);
            Tooltip::always_open(ctx, layer, self.response.id.with("node"), anchor).show(|ui| content(ui, node));
        }
    }
}

impl SurfaceView<'_> {
    /// Draws the surface in the space that is left and lets the user turn it.
    pub fn show(self, ui: &mut Ui, camera: OrbitCamera) -> SurfaceViewResponse {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        let camera = match self.mode {
            ViewMode::ThreeD => operate(ui, &response, camera),
            ViewMode::Top => camera,
        };
        self.describe(ui, &response);
        let mut shown = SurfaceViewResponse {
            camera,
            hovered_node: None,
            hovered_at: None,
            response,
        };
        if ui.is_rect_visible(rect) && rect.width() > 60.0 && rect.height() > 60.0 {
            self.paint(ui, rect, &mut shown);
        }
        if shown.response.has_focus() {
            let stroke = Stroke::new(1.0, self.theme.palette.accent.gamma_multiply(0.6));
            ui.painter()
                .rect_stroke(rect, f32::from(crate::app::theme::radius()), stroke, StrokeKind::Inside);
        }
        shown
    }

    fn paint(&self, ui: &Ui, rect: Rect, shown: &mut SurfaceViewResponse) {
        let painter = ui.painter_at(rect);
        let is_usable = self.values_mm.len() == self.grid.len();
        let range_mm = usable_range(&self.range_mm);
        let ends = |axis: &[f64]| (axis[0], axis[axis.len() - 1]);
        let ((x0, x1), (y0, y1)) = (ends(self.grid.x_mm()), ends(self.grid.y_mm()));
        let names = ["x (mm)", "y (mm)", self.colours.title()];
        let headroom = HEADROOM * (range_mm.end() - range_mm.start());
        let shown_mm = range_mm.start() - headroom..=range_mm.end() + headroom;
        let surface = Surface {
            grid: self.grid,
            values: self.values_mm,
            range: &range_mm,
            shown: shown_mm.clone(),
            colours: self.colours.map(self.theme),
        };
        let draw = |stage: &Stage<'_>, shown: &mut SurfaceViewResponse| {
            if !is_usable {
                return;
            }
            painter.add(surface.mesh(stage));
            let dots = nodes::dots(self.nodes_mm, &surface, stage);
            let is_idle = !shown.response.dragged();
            let pointer = shown.response.hover_pos().filter(|_| is_idle);
            shown.hovered_node = pointer.and_then(|pointer| nodes::nearest(&dots, pointer));
            shown.hovered_at = shown.hovered_node.and_then(|node| nodes::position(&dots, node));
            nodes::paint(&painter, &dots, shown.hovered_node.or(self.highlight), self.theme);
        };
        match self.mode {
            ViewMode::ThreeD => {
                let plot_box = PlotBox::new(
                    DVec3::new(x0, y0, *shown_mm.start()),
                    DVec3::new(x1, y1, *shown_mm.end()),
                    (rect.height() - LABELS.y).max(1.0) / (rect.width() - LABELS.x).max(1.0),
                );
                let axes = SpaceAxes::new(
                    &painter,
                    rect.shrink(8.0),
                    plot_box,
                    shown.camera,
                    &range_mm,
                    names,
                    self.theme,
                );
                axes.paint(&painter, self.theme);
                draw(&Stage::Space(&axes.projection), shown);
            }
            ViewMode::Top => {
                let (min_mm, max_mm) = (DVec2::new(x0, y0), DVec2::new(x1, y1));
                let plan = PlanAxes::new(
                    &painter,
                    rect.shrink(8.0),
                    min_mm,
                    max_mm,
                    [names[0], names[1]],
                    self.theme,
                );
                plan.paint(&painter, self.theme);
                draw(&Stage::Plan(&plan), shown);
            }
        }
    }

    /// Tells assistive technology what is seen: "z 4.0 to 5.0 mm".
    fn describe(&self, ui: &Ui, response: &Response) {
        response.widget_info(|| WidgetInfo::labeled(egui::accesskit::Role::Image, true, self.label));
        ui.ctx().accesskit_node_builder(response.id, |node| {
            let heights = self
                .nodes_mm
                .iter()
                .map(|node| node.z)
                .filter(|height| height.is_finite());
            let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
            let quantity = match self.colours {
                Colours::Height => "z",
                Colours::Error => "error",
            };
            node.set_value(if low <= high {
                format!("{quantity} {} to {} mm", tick_text(low, 0.01), tick_text(high, 0.01))
            } else {
                "no values".to_owned()
            });
        });
    }
}

/// A range that can be divided by, whatever was given.
fn usable_range(range: &RangeInclusive<f64>) -> RangeInclusive<f64> {
    let (low, high) = (*range.start(), *range.end());
    if !(low.is_finite() && high.is_finite()) {
        0.0..=1.0
    } else if high - low > 1e-9 * low.abs().max(1e-3) {
        low..=high
    } else {
        low - 0.5..=low + 0.5
    }
}

/// Drags turn, drags with shift or another button shift, scrolling zooms, a double click goes back to the start.
/// With the focus: arrow keys, plus, minus, Home.
fn operate(ui: &Ui, response: &Response, camera: OrbitCamera) -> OrbitCamera {
    let mut camera = camera.clamped();
    if response.clicked() || response.drag_started() {
        response.request_focus();
    }
    let drag = response.drag_delta();
    if response.dragged() && drag != Vec2::ZERO {
        let is_shift = ui.input(|input| input.modifiers.shift);
        camera = if response.dragged_by(PointerButton::Primary) && !is_shift {
            camera.dragged(drag.x, drag.y)
        } else {
            camera.panned(drag.x / response.rect.width(), drag.y / response.rect.height())
        };
    }
    if response.contains_pointer() {
        let (scroll, pinch) = ui.input_mut(|input| {
            // Taken, so that no scroll area around the view scrolls as well.
            let scroll = std::mem::take(&mut input.smooth_scroll_delta);
            (scroll.y, input.zoom_delta())
        });
        if scroll != 0.0 || pinch != 1.0 {
            camera = camera.scrolled(scroll).zoomed(pinch);
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
                camera = camera.stepped(right, down).zoomed_by_keys(nearer);
            }
            if presses(Key::Home) > 0.0 {
                camera = OrbitCamera::default();
            }
        });
    }
    if response.double_clicked() {
        OrbitCamera::default()
    } else {
        camera
    }
}
