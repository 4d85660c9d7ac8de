//! What the surfaces of all views have in common: their mode, their camera, and the node that is marked on neighbours.

use eframe::egui::Ui;

use super::{Effect, Look};
use crate::window::{surface_view::SurfaceViewResponse, widgets::segmented_ui};
use decoupler_files::figure::surface::ViewMode;

/// The choice between surfaces in space and from above.
pub fn view_mode_ui(ui: &mut Ui, look: Look, effects: &mut Vec<Effect>) {
    let modes = [(ViewMode::ThreeD, "3-D"), (ViewMode::Top, "Top view")];
    let picked = segmented_ui(ui, "Surface view", &modes, look.mode, false);
    effects.extend(picked.map(|mode| Effect::Look(Look { mode, ..look })));
}

/// Turns all surfaces as this one was turned, and marks the node under the pointer on its neighbours too.
pub fn follow_surface(shown: &SurfaceViewResponse, look: Look, marked: &mut Option<usize>, effects: &mut Vec<Effect>) {
    if shown.camera != look.camera {
        let camera = shown.camera;
        effects.push(Effect::Look(Look { camera, ..look }));
    }
    // Each card speaks for the pointer only while it is over it, so that the other card's mark stays.
    if shown.response.contains_pointer() && shown.hovered_node != *marked {
        *marked = shown.hovered_node;
        shown.response.ctx.request_repaint();
    }
}
