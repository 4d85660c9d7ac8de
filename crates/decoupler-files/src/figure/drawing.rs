//! Shapes of which figures are made, in colours by role. The window and print paint the same shapes, each by its palette.
//! Lengths are points, y counts downwards.

use std::ops::RangeInclusive;

use glam::Vec2;

use super::{
    Hue, LineStyle, Look, Marker,
    axis::{PlotAxis, share},
    colour_map::{ColourMap, Rgb},
};

/// Returns the size of a text.
pub type Measure<'a> = &'a dyn Fn(&str) -> Vec2;

/// Role of a colour, which each renderer resolves by its palette.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ink {
    /// A series.
    Hue(Hue),
    /// Grid lines.
    Grid,
    /// Outlines and ticks.
    Edge,
    /// Numbers and names of axes.
    Label,
    /// The background of the card.
    Ground,
    /// A cell without a value.
    Missing,
    /// The same in every theme.
    Rgb(Rgb),
}

impl Ink {
    pub(crate) const BLACK: Self = Self::Rgb([0; 3]);
    pub(crate) const WHITE: Self = Self::Rgb([0xff; 3]);

    /// Returns the colour at this opacity.
    pub fn at(self, opacity: f32) -> Colour {
        Colour { ink: self, opacity }
    }
}

/// A colour and its opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour {
    /// Role.
    pub ink: Ink,
    /// 1 is opaque.
    pub opacity: f32,
}

impl From<Ink> for Colour {
    fn from(ink: Ink) -> Self {
        ink.at(1.0)
    }
}

impl From<Hue> for Colour {
    fn from(hue: Hue) -> Self {
        Ink::Hue(hue).into()
    }
}

/// Appearance of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// Colour.
    pub colour: Colour,
    /// Width.
    pub width: f32,
    /// Lengths of dashes and gaps; `None` for a solid line.
    pub dashes: Option<[f32; 2]>,
}

impl Stroke {
    /// A solid line.
    pub fn new(colour: impl Into<Colour>, width: f32) -> Self {
        Self {
            colour: colour.into(),
            width,
            dashes: None,
        }
    }
}

/// Side of a text that is at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// A shape of a drawing.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A line through points.
    Line(Vec<Vec2>, Stroke),
    /// A filled polygon.
    Area(Vec<Vec2>, Colour),
    /// A filled circle, or a ring.
    Circle {
        /// Its centre.
        at: Vec2,
        /// Its radius; of a ring, in the middle of its line.
        radius: f32,
        /// Width of the line of a ring; `None` for a filled circle.
        ring: Option<f32>,
        /// Colour.
        colour: Colour,
    },
    /// A line of text.
    Text {
        /// Its position, in the middle of its height.
        at: Vec2,
        /// Its side there.
        align: Align,
        /// Colour.
        ink: Ink,
        /// True if it reads upwards.
        is_upright: bool,
        /// The text.
        text: String,
    },
}

impl Shape {
    /// A solid straight line.
    pub fn line(from: Vec2, to: Vec2, colour: impl Into<Colour>, width: f32) -> Self {
        Self::Line(vec![from, to], Stroke::new(colour, width))
    }

    /// A horizontal text.
    pub fn text(at: Vec2, align: Align, ink: Ink, text: impl Into<String>) -> Self {
        Self::Text {
            at,
            align,
            ink,
            is_upright: false,
            text: text.into(),
        }
    }

    /// A text that reads upwards, with its middle at `at`.
    pub fn upright(at: Vec2, ink: Ink, text: impl Into<String>) -> Self {
        Self::Text {
            at,
            align: Align::Middle,
            ink,
            is_upright: true,
            text: text.into(),
        }
    }
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
    /// An empty rectangle.
    pub(super) const NOTHING: Self = Self {
        min: Vec2::INFINITY,
        max: Vec2::NEG_INFINITY,
    };

    /// The rectangle with this corner and size.
    pub fn of_size(min: Vec2, size: Vec2) -> Self {
        Self { min, max: min + size }
    }

    pub(super) fn centred(middle: Vec2, size: Vec2) -> Self {
        Self::of_size(middle - 0.5 * size, size)
    }

    /// Returns the bounding rectangle of all points.
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

    /// Returns true if the point is in the rectangle.
    pub fn contains(&self, point: Vec2) -> bool {
        self.min.cmple(point).all() && point.cmple(self.max).all()
    }

    /// Width and height.
    pub fn size(&self) -> Vec2 {
        self.max - self.min
    }

    /// The centre.
    pub fn middle(&self) -> Vec2 {
        0.5 * (self.min + self.max)
    }

    /// The corners, clockwise from the upper left one.
    pub fn corners(&self) -> [Vec2; 4] {
        let Self { min, max } = *self;
        [min, Vec2::new(max.x, min.y), max, Vec2::new(min.x, max.y)]
    }

    /// A filled rectangle.
    pub fn area(&self, fill: impl Into<Colour>) -> Shape {
        Shape::Area(self.corners().into(), fill.into())
    }

    /// The outline.
    pub fn outline(&self, stroke: Stroke) -> Shape {
        let [a, b, c, d] = self.corners();
        Shape::Line(vec![a, b, c, d, a], stroke)
    }
}

impl LineStyle {
    /// Returns the stroke of a line in this style.
    pub(crate) fn stroke(self, hue: Hue) -> Stroke {
        let (width, opacity, dashes) = match self {
            Self::Solid => (1.5, 1.0, None),
            Self::Dashed => (1.4, 1.0, Some([4.0, 3.0])),
            Self::Dotted => (1.4, 1.0, Some([1.4, 2.5])),
            Self::Fine => (0.8, 0.55, None),
        };
        Stroke {
            colour: Ink::Hue(hue).at(opacity),
            width,
            dashes,
        }
    }
}

impl Look {
    /// Returns the symbol at a point.
    pub(crate) fn mark(self, at: Vec2) -> Option<Shape> {
        let colour = Colour::from(self.hue);
        let edge = Stroke::new(colour, 1.4);
        let circle = |radius, ring| {
            Some(Shape::Circle {
                at,
                radius,
                ring,
                colour,
            })
        };
        let diamond = [[0.0, -4.4], [4.4, 0.0], [0.0, 4.4], [-4.4, 0.0]].map(|corner| at + Vec2::from(corner));
        match self.marker? {
            Marker::Dot => circle(1.25, None),
            Marker::Disc => circle(2.9, None),
            Marker::Ring => circle(2.9, Some(1.4)),
            Marker::Halo => circle(6.3, Some(1.4)),
            Marker::Square => Some(Bounds::of_size(at - 3.6, Vec2::splat(7.2)).outline(edge)),
            Marker::Diamond => Some(Shape::Area(diamond.into(), colour)),
            Marker::HollowDiamond => Some(Shape::Line([&diamond[..], &diamond[..1]].concat(), edge)),
        }
    }

    /// Returns the sample in a legend, from its left end.
    pub fn sample(self, left: Vec2, width: f32) -> Vec<Shape> {
        let right = left + Vec2::new(width, 0.0);
        let line = self
            .line
            .map(|style| Shape::Line(vec![left, right], style.stroke(self.hue)));
        let is_area = self.line.is_none() && self.marker.is_none();
        let area = is_area.then(|| Bounds::of_size(left - Vec2::new(0.0, 4.0), Vec2::new(width, 8.0)));
        let area = area.map(|area| area.area(Ink::Hue(self.hue).at(0.3)));
        let mark = self.mark(0.5 * (left + right));
        line.into_iter().chain(area).chain(mark).collect()
    }
}

const BAR_WIDTH: f32 = 12.0;
const BAR_STEPS: usize = 128;
/// Room for a number on a colour scale.
const BAR_NUMBER: f32 = 26.0;

/// Lays out a colour scale in `area`: a bar from the lowest value at the bottom to the highest at the top, with the numbers
/// of `axis` on its right. The name is above it, or upright beyond the numbers if it is longer than `area` is wide. Empty if
/// there is no room or no range.
pub(super) fn lay_out_scale(
    area: Bounds,
    axis: &PlotAxis,
    range: &RangeInclusive<f64>,
    colours: &ColourMap,
    measure: Measure<'_>,
) -> Vec<Shape> {
    let name = measure(&axis.name);
    let is_above = name.x <= area.size().x;
    let top = area.min.y + if is_above { name.y + 12.0 } else { 0.0 };
    let bar = Bounds {
        min: Vec2::new(area.min.x + 8.0, top),
        max: Vec2::new(area.min.x + 8.0 + BAR_WIDTH, area.max.y),
    };
    let (height, width) = (bar.size().y, range.end() - range.start());
    if height < 20.0 || !(width.is_finite() && width > 0.0) {
        return Vec::new();
    }
    let step = height / BAR_STEPS as f32;
    let pieces = (0..BAR_STEPS).map(|at| {
        let colour = colours.at((at as f32 + 0.5) / BAR_STEPS as f32);
        let min = Vec2::new(bar.min.x, bar.max.y - step * (at + 1) as f32);
        Bounds::of_size(min, Vec2::new(BAR_WIDTH, step)).area(Ink::Rgb(colour))
    });
    let mut shapes: Vec<Shape> = pieces.collect();
    shapes.push(bar.outline(Stroke::new(Ink::Edge, 1.0)));
    let ticks = axis.ticks(range, width * f64::from(BAR_NUMBER / height));
    for &place in &ticks.places {
        let at = Vec2::new(bar.max.x, bar.max.y - height * share(place, range) as f32);
        shapes.push(Shape::line(at, at + Vec2::new(4.0, 0.0), Ink::Edge, 1.0));
        let text = axis.tick_text(place, ticks.step);
        shapes.push(Shape::text(at + Vec2::new(7.0, 0.0), Align::Start, Ink::Label, text));
    }
    shapes.push(if is_above {
        let at = Vec2::new(area.min.x + 4.0, area.min.y + 0.5 * name.y);
        Shape::text(at, Align::Start, Ink::Label, &*axis.name)
    } else {
        let at = Vec2::new(area.max.x - 0.5 * name.y, bar.middle().y);
        Shape::upright(at, Ink::Label, &*axis.name)
    });
    shapes
}
