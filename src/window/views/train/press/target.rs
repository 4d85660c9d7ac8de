use eframe::egui::{Id, Rect};

use decoupler_files::figure::surface::{Sight, Surface};

/// A surface on the screen that can be touched.
#[derive(Clone, Debug)]
pub(super) struct Target {
    pub(super) id: Id,
    pub(super) rect: Rect,
    pub(super) sight: Sight,
    pub(super) surface: Surface,
}

/// Hold of the pointer on the surface while its button is down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Grip {
    /// An indenter moves in the level in which the surface was met, so that it does not jump as the surface gives way.
    Level(f64),
    /// A node moves up and down.
    Node {
        /// Its place among those drawn.
        node: usize,
        /// Height of the node above the pointer's.
        above_mm: f64,
        /// Height of the node, and of the pointer on the screen, when it was taken.
        begin: (f64, f32),
    },
    /// The button went down next to the surface.
    Missed,
}
