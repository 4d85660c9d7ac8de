//! Shapes of which figures are made, in colours by role. The window and print paint the same shapes, each by its palette.
//! Lengths are points, y counts downwards.

use std::ops::RangeInclusive;

use glam::Vec2;

use super::{
    Ink, LineStyle, Look, Marker,
    axis::{PlotAxis, share},
    colour_map::ColourMap,
};

/// Returns the size of a text.
pub type Measure<'a> = &'a dyn Fn(&str) -> Vec2;

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
    /// Its middle is there, and it reads upwards.
    Upright,
}

/// A shape of a drawing.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A line through points.
    Line(Vec<Vec2>, Stroke),
    /// A filled polygon.
    Area(Vec<Vec2>, Colour),
    /// A filled circle: its centre and radius.
    Disc(Vec2, f32, Colour),
    /// A circle: its centre, and its radius in the middle of the line.
    Ring(Vec2, f32, Stroke),
    /// A line of text: its position in the middle of its height, and its side there.
    Text(Vec2, Align, Ink, String),
}

impl Shape {
    /// A solid straight line.
    pub fn line(from: Vec2, to: Vec2, colour: impl Into<Colour>, width: f32) -> Self {
        Self::Line(vec![from, to], Stroke::new(colour, width))
    }

    /// A text.
    pub fn text(at: Vec2, align: Align, ink: Ink, text: impl Into<String>) -> Self {
        Self::Text(at, align, ink, text.into())
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
    /// The rectangle with this corner and size.
    pub fn of_size(min: Vec2, size: Vec2) -> Self {
        Self { min, max: min + size }
    }

    pub(super) fn centred(middle: Vec2, size: Vec2) -> Self {
        Self::of_size(middle - 0.5 * size, size)
    }

    /// Returns the bounding rectangle of all points.
    pub fn of(points: impl IntoIterator<Item = Vec2>) -> Self {
        let [min, max] = [Vec2::INFINITY, Vec2::NEG_INFINITY];
        points.into_iter().fold(Self { min, max }, |bounds, point| Self {
            min: bounds.min.min(point),
            max: bounds.max.max(point),
        })
    }

    pub(super) fn grown(self, by: f32) -> Self {
        Self::centred(self.middle(), self.size() + 2.0 * by)
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

    /// Returns the point of a place on two axes with these ranges, whose origin is the lower left corner.
    pub(crate) fn at(&self, [x, y]: [f64; 2], [x_range, y_range]: &[RangeInclusive<f64>; 2]) -> Vec2 {
        let [right, up] = [share(x, x_range), 1.0 - share(y, y_range)].map(|share| share as f32);
        self.min + Vec2::new(right, up) * self.size()
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
    pub(crate) fn stroke(self, ink: Ink) -> Stroke {
        let (width, opacity, dashes) = match self {
            Self::Solid => (1.5, 1.0, None),
            Self::Dashed => (1.4, 1.0, Some([4.0, 3.0])),
            Self::Dotted => (1.4, 1.0, Some([1.4, 2.5])),
            Self::Fine => (0.8, 0.55, None),
        };
        Stroke {
            colour: ink.at(opacity),
            width,
            dashes,
        }
    }
}

impl Look {
    /// Returns the symbol at a point.
    pub(crate) fn mark(self, at: Vec2) -> Option<Shape> {
        let (colour, edge) = (Colour::from(self.ink), Stroke::new(self.ink, 1.4));
        let diamond = [[0.0, -4.4], [4.4, 0.0], [0.0, 4.4], [-4.4, 0.0]].map(|corner| at + Vec2::from(corner));
        Some(match self.marker? {
            Marker::Dot => Shape::Disc(at, 1.25, colour),
            Marker::Disc => Shape::Disc(at, 2.9, colour),
            Marker::Ring => Shape::Ring(at, 2.9, edge),
            Marker::Halo => Shape::Ring(at, 6.3, edge),
            Marker::Square => Bounds::of_size(at - 3.6, Vec2::splat(7.2)).outline(edge),
            Marker::Diamond => Shape::Area(diamond.into(), colour),
            Marker::HollowDiamond => Shape::Line([&diamond[..], &diamond[..1]].concat(), edge),
        })
    }

    /// Returns the sample in a legend, from its left end.
    pub fn sample(self, left: Vec2, width: f32) -> Vec<Shape> {
        let right = left + Vec2::new(width, 0.0);
        let area = Bounds::of_size(left - Vec2::new(0.0, 4.0), Vec2::new(width, 8.0));
        let behind = match (self.line, self.marker) {
            (Some(style), _) => Some(Shape::Line(vec![left, right], style.stroke(self.ink))),
            (None, None) => Some(area.area(self.ink.at(0.3))),
            (None, Some(_)) => None,
        };
        behind.into_iter().chain(self.mark(0.5 * (left + right))).collect()
    }
}

/// Texts in a drawing, placed without overlap.
pub(super) struct Labels<'a> {
    measure: Measure<'a>,
    placed: Vec<(Bounds, String)>,
}

impl<'a> Labels<'a> {
    pub(super) fn new(measure: Measure<'a>) -> Self {
        let placed = Vec::new();
        Self { measure, placed }
    }

    /// Puts a text at the first of the best of these places for its middle, with this clearance to the other texts. `cost`
    /// rates a place; `None` rules it out. Returns false if there is no room.
    pub(super) fn place(
        &mut self,
        text: &str,
        clearance: f32,
        middles: impl Iterator<Item = Vec2>,
        cost: impl Fn(&Bounds) -> Option<usize>,
    ) -> bool {
        let size = (self.measure)(text);
        let places = middles.map(|middle| Bounds::centred(middle, size));
        let free = places.filter(|place| self.bounds().all(|other| !other.grown(clearance).intersects(place)));
        let rated = free.filter_map(|place| Some((cost(&place)?, place)));
        let best = rated.min_by_key(|(cost, _)| *cost);
        self.placed.extend(best.map(|(_, place)| (place, text.to_owned())));
        best.is_some()
    }

    pub(super) fn bounds(&self) -> impl Iterator<Item = Bounds> {
        self.placed.iter().map(|(bounds, _)| *bounds)
    }

    pub(super) fn shapes(self) -> impl Iterator<Item = Shape> {
        let texts = self.placed.into_iter();
        texts.map(|(bounds, text)| Shape::text(bounds.middle(), Align::Middle, Ink::Label, text))
    }
}

const BAR_WIDTH: f32 = 12.0;
const BAR_STEPS: u8 = 128;
/// Room for a number on a colour scale.
const BAR_NUMBER: f32 = 26.0;

/// Lays out a colour scale in `area`: a bar from the lowest value at the bottom to the highest at the top, with the numbers
/// and the name of `axis` on its right. Empty if there is no room or no range.
pub(super) fn lay_out_scale(
    area: Bounds,
    axis: &PlotAxis,
    range: &RangeInclusive<f64>,
    colours: &ColourMap,
    measure: Measure<'_>,
) -> Vec<Shape> {
    let bar = Bounds::of_size(area.min + Vec2::new(8.0, 0.0), Vec2::new(BAR_WIDTH, area.size().y));
    let (height, width) = (bar.size().y, range.end() - range.start());
    if height < 20.0 || !(width.is_finite() && width > 0.0) {
        return Vec::new();
    }
    let at = |share: f64| Vec2::new(bar.max.x, bar.max.y - height * share as f32);
    let pieces = (0..BAR_STEPS).map(|piece| {
        let [low, middle, high] = [0.0, 0.5, 1.0].map(|part| (f64::from(piece) + part) / f64::from(BAR_STEPS));
        let corners = [at(low), at(high) - Vec2::new(BAR_WIDTH, 0.0)];
        Bounds::of(corners).area(Ink::Rgb(colours.at(middle as f32)))
    });
    let mut shapes: Vec<Shape> = pieces.collect();
    shapes.push(bar.outline(Stroke::new(Ink::Edge, 1.0)));
    for (share, text) in axis.numbers(range, BAR_NUMBER / height) {
        let (tick, number) = (Vec2::new(4.0, 0.0), Vec2::new(7.0, 0.0));
        shapes.push(Shape::line(at(share), at(share) + tick, Ink::Edge, 1.0));
        shapes.push(Shape::text(at(share) + number, Align::Start, Ink::Label, text));
    }
    let beyond = Vec2::new(area.max.x - 0.5 * measure(&axis.name).y, bar.middle().y);
    shapes.push(Shape::text(beyond, Align::Upright, Ink::Label, &*axis.name));
    shapes
}
