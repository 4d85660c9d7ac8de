use glam::DVec2;

use decoupler_core::scene::{Indenter, IndenterShape, Print, Span};

/// Work of the pointer on the actual surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hand {
    /// It presses.
    #[default]
    Press,
    /// It turns the surface.
    Turn,
}

/// Body that presses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tool {
    /// A ball.
    #[default]
    Sphere,
    /// The flat end of a round bar.
    FlatPunch,
    /// A bar along a row of nodes.
    Cylinder,
    /// The edge of a block.
    Edge,
    /// Two fingertips that move one node up and down.
    OneNode,
}

/// Tool of the user with its size and depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finger {
    /// The body.
    pub tool: Tool,
    /// Its radius, where it has one.
    pub radius_mm: f64,
    /// Depth as a part of the stroke, from 0 to 1.
    pub depth_share: f64,
}

impl Default for Finger {
    fn default() -> Self {
        Self {
            tool: Tool::default(),
            radius_mm: 4.0,
            depth_share: 0.8,
        }
    }
}

impl Finger {
    /// Radii offered.
    pub const RADIUS_MM: std::ops::RangeInclusive<f64> = 0.5..=20.0;

    /// The finger pressed onto a place; `None` for a tool that moves one node.
    pub(super) fn print(&self, place_mm: DVec2, stroke_mm: f64) -> Option<Print> {
        let radius_mm = Span {
            smallest: self.radius_mm,
            largest: self.radius_mm,
        };
        let largest_tilt_degrees = 0.0;
        let shape = match self.tool {
            Tool::Sphere => IndenterShape::Sphere { radius_mm },
            Tool::FlatPunch => IndenterShape::FlatPunch {
                radius_mm,
                largest_tilt_degrees,
            },
            Tool::Cylinder => IndenterShape::Cylinder {
                radius_mm,
                largest_tilt_degrees,
            },
            Tool::Edge => IndenterShape::Edge { largest_tilt_degrees },
            Tool::OneNode => return None,
        };
        Some(Print {
            indenter: Indenter {
                shape,
                ..Indenter::default()
            },
            place_mm,
            depth_mm: self.depth_share * stroke_mm,
        })
    }

    /// Returns true if the tool has a radius.
    pub(super) fn has_radius(&self) -> bool {
        matches!(self.tool, Tool::Sphere | Tool::FlatPunch | Tool::Cylinder)
    }

    /// Deeper by a part of the stroke.
    pub(super) fn deepen(&mut self, share: f64) {
        self.depth_share = (self.depth_share + share).clamp(0.0, 1.0);
    }
}
