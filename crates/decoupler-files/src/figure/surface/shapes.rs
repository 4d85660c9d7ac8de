//! The shapes that a drawing consists of. Lengths are points, y counts downwards.

use glam::Vec2;

/// Role of a colour, which each renderer resolves by its palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Ink {
    /// Grid lines.
    Grid,
    /// Outlines and ticks.
    Edge,
    /// Numbers and names of axes.
    Label,
    /// As strong as text.
    Text,
    /// The ground of the card.
    Ground,
    /// A node.
    Node,
    /// The dark rim of a node.
    Rim,
    /// A node beyond the axes.
    Warning,
    /// The node that is marked.
    Accent,
}

/// A straight line, one point wide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// First end.
    pub from: Vec2,
    /// Second end.
    pub to: Vec2,
    /// Its colour.
    pub ink: Ink,
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    /// The room it takes; the text is in its middle.
    pub bounds: Bounds,
    /// The words.
    pub text: String,
}

/// A filled circle or a ring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Its centre.
    pub at: Vec2,
    /// Its radius; of a ring, in the middle of its line.
    pub radius: f32,
    /// Width of the line of a ring; `None` for a filled disc.
    pub ring: Option<f32>,
    /// Its colour.
    pub ink: Ink,
    /// 1 hides what lies behind it.
    pub opacity: f32,
}

/// A rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Its upper left corner.
    pub min: Vec2,
    /// Its lower right corner.
    pub max: Vec2,
}

impl Bounds {
    /// A rectangle that holds nothing.
    pub(super) const NOTHING: Self = Self {
        min: Vec2::INFINITY,
        max: Vec2::NEG_INFINITY,
    };

    pub(super) fn centred(middle: Vec2, size: Vec2) -> Self {
        Self {
            min: middle - 0.5 * size,
            max: middle + 0.5 * size,
        }
    }

    /// The rectangle that all points span.
    pub(super) fn of(points: impl IntoIterator<Item = Vec2>) -> Self {
        points.into_iter().fold(Self::NOTHING, |bounds, point| Self {
            min: bounds.min.min(point),
            max: bounds.max.max(point),
        })
    }

    pub(super) fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    pub(super) fn grown(self, by: f32) -> Self {
        Self {
            min: self.min - by,
            max: self.max + by,
        }
    }

    pub(super) fn intersects(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Width and height.
    pub fn size(&self) -> Vec2 {
        self.max - self.min
    }

    /// The centre.
    pub fn middle(&self) -> Vec2 {
        0.5 * (self.min + self.max)
    }
}
