use std::sync::Arc;

use eframe::egui::{Align, Layout, Rect, RichText, Ui, Vec2};

use super::{LiveView, engine::LiveFrame};
use crate::window::{
    shared::{Effect, Look, Shared, colour_scale_ui, follow_surface, view_mode_ui},
    surface_view::{ColourBar, SurfaceView},
    test_view::{Frame, HeightScale},
    theme::{Theme, semibold, space, type_size},
    widgets::card_ui,
};
use decoupler_files::{
    export::format_number,
    figure::surface::{Quantity, Surface, SurfaceFigure},
};

/// The decoupled surface, the actual one next to it where it is known, and the scale of their colours.
pub fn surfaces_ui(ui: &mut Ui, rect: Rect, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let Some(frame) = &view.shown.frame else { return };
    let figure = surface_figure(frame, view.node, shared.look);
    let gap = space(2);
    let (cards, scale) = rect.split_left_right_at_x(rect.right() - ColourBar::WIDTH);
    let count = figure.surfaces.len() as f32;
    let width = (cards.width() - gap * (count - 1.0)) / count;
    let mut node = view.node;
    for (index, surface) in figure.surfaces.iter().enumerate() {
        let left = cards.left() + (width + gap) * index as f32;
        let card = Rect::from_min_size([left, cards.top()].into(), Vec2::new(width, cards.height()));
        card_ui(ui, card, |ui| {
            ui.horizontal(|ui| {
                ui.set_min_height(space(7));
                ui.label(RichText::new(&surface.title).font(semibold(type_size().title)));
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    if index == 0 {
                        view_mode_ui(ui, shared.look, effects);
                    }
                });
            });
            surface_ui(ui, surface, frame, shared.look, &mut node, effects);
        });
    }
    if let [colours, ..] = &figure.scales()[..] {
        let slot = scale.shrink2(Vec2::new(0.0, space(4)));
        colour_scale_ui(ui, slot, colours, &figure.note(), shared.look, effects);
    }
    view.node = node;
}

/// The surfaces of a frame with one scale.
pub fn surface_figure(frame: &LiveFrame, marked_node: Option<usize>, look: Look) -> SurfaceFigure {
    let surface = |title: &str, heights: &Frame| Surface {
        title: title.to_owned(),
        map: Arc::clone(&frame.surface),
        values: Arc::clone(&heights.grid_mm),
        nodes: Arc::clone(&heights.nodes_mm),
        quantity: Quantity::Height,
        range: match look.heights {
            HeightScale::Stroke => frame.z_range_mm.clone(),
            HeightScale::Fitted => heights.range_mm().unwrap_or_else(|| frame.z_range_mm.clone()),
        },
        mode: look.mode,
        colours: look.colours,
    };
    let actual = frame.actual.as_ref().map(|actual| surface("Actual", actual));
    SurfaceFigure {
        surfaces: std::iter::once(surface("Decoupled", &frame.decoupled))
            .chain(actual)
            .collect(),
        camera: look.camera,
        marked_node,
        ..SurfaceFigure::default()
    }
    .with_common_scales()
}

fn surface_ui(
    ui: &mut Ui,
    surface: &Surface,
    frame: &LiveFrame,
    look: Look,
    node: &mut Option<usize>,
    effects: &mut Vec<Effect>,
) {
    let shown = SurfaceView {
        label: &format!("Live {} surface", surface.title.to_lowercase()),
        surface,
        marked_node: *node,
        lit_nodes: &[],
        section: None,
        theme: Theme::of(ui),
    }
    .show(ui, look.camera);
    follow_surface(&shown, look, node, effects);
    shown.node_tooltip_ui(|ui, node| {
        let per_row = frame.sensor.scale.nodes_per_row();
        let (Some(decoupled), Some(row)) = (frame.decoupled.nodes_mm.get(node), frame.rows.get(node / per_row)) else {
            return;
        };
        let name = format!("Row {}, node {}", row + 1, node % per_row + 1);
        ui.label(RichText::new(name).font(semibold(type_size().note)));
        let mut text = format!("decoupled z {} mm", format_number(decoupled.z));
        if let Some(actual) = frame.actual.as_ref().and_then(|actual| actual.nodes_mm.get(node)) {
            text += &format!(", actual {} mm", format_number(actual.z));
        }
        ui.label(RichText::new(text).size(type_size().note));
    });
}
