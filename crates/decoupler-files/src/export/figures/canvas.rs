//! The few shapes that figures are made of, written as SVG. Lengths are points (1/72 inch); y counts downwards.

use std::fmt::{Display, Write as _};

use super::picture::{INK, Picture, Rgb};
use decoupler_core::text::is_unprintable;

/// Size of all text, in points.
pub(super) const TEXT: f64 = 8.0;
/// Average width of a character at this size, used to reserve room for a text.
pub(super) const CHARACTER: f64 = 0.56 * TEXT;

/// Overlap of neighbouring blocks in points: one pixel in print.
const OVERLAP: f64 = 0.25;

pub(super) type At = [f64; 2];

/// Style of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    pub colour: Rgb,
    pub width: f64,
    /// Lengths of dashes and gaps; empty for a solid line.
    pub dashes: &'static str,
}

impl Stroke {
    pub fn new(colour: Rgb, width: f64) -> Self {
        Self {
            colour,
            width,
            dashes: "",
        }
    }
}

/// Part of a text that is placed at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// Area of the canvas occupied by a plot or a panel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Area {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

impl Area {
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// The corners, clockwise from the upper left one.
    pub fn corners(&self) -> [At; 4] {
        let (left, top, right, bottom) = (self.left, self.top, self.right(), self.bottom());
        [[left, top], [right, top], [right, bottom], [left, bottom]]
    }

    pub fn centre(&self) -> At {
        [self.left + 0.5 * self.width, self.top + 0.5 * self.height]
    }
}

pub(super) struct Canvas {
    width: f64,
    height: f64,
    body: String,
    clips: usize,
}

impl Canvas {
    pub fn new(width: f64, height: f64) -> Self {
        Self {
            width,
            height,
            body: String::new(),
            clips: 0,
        }
    }

    fn put(&mut self, element: impl Display) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.body, "{element}");
    }

    pub fn line(&mut self, from: At, to: At, stroke: Stroke) {
        self.polyline(&[from, to], stroke);
    }

    pub fn polyline(&mut self, points: &[At], stroke: Stroke) {
        let (points, style) = (coordinates(points), stroke_style(stroke));
        self.put(format_args!(r#"<polyline points="{points}" fill="none" {style}/>"#));
    }

    /// A filled shape.
    pub fn polygon(&mut self, corners: &[At], fill: Rgb) {
        let (points, fill) = (coordinates(corners), hex(fill));
        self.put(format_args!(r#"<polygon points="{points}" fill="{fill}"/>"#));
    }

    /// Begins a group of [`Self::facet`]s.
    pub fn begin_facets(&mut self) {
        self.put(r#"<g fill="currentColor" stroke="currentColor" stroke-width=".3">"#);
    }

    /// Ends a group.
    pub fn end_group(&mut self) {
        self.put("</g>");
    }

    /// A facet of a surface. A hairline in its own colour closes the seam to its neighbours; a translucent facet has
    /// crisp edges instead, because the hairlines would be visible.
    pub fn facet(&mut self, corners: &[At], fill: Rgb, opacity: f64) {
        let (points, fill, opacity) = (coordinates(corners), hex(fill), number(opacity));
        if opacity == "1" {
            self.put(format_args!(r#"<path color="{fill}" d="M{points}z"/>"#));
        } else {
            self.put(format_args!(
                r#"<path color="{fill}" d="M{points}z" fill-opacity="{opacity}" stroke="none" shape-rendering="crispEdges"/>"#
            ));
        }
    }

    /// A filled rectangle with sharp edges. It extends slightly under its neighbours on the right and below, which must
    /// be drawn later, to avoid a seam.
    pub fn block(&mut self, area: Area, fill: Rgb) {
        let Area {
            left,
            top,
            width,
            height,
        } = area;
        let [left, top, width, height] = [left, top, width + OVERLAP, height + OVERLAP].map(number);
        let fill = hex(fill);
        self.put(format_args!(
            r#"<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="{fill}" shape-rendering="crispEdges"/>"#
        ));
    }

    /// Straight lines that do not overlap.
    pub fn segments(&mut self, ends: &[[At; 2]], stroke: Stroke, opacity: f64) {
        let pieces = ends.iter().map(|&[from, to]| format!("M{}L{}", pair(from), pair(to)));
        let (path, style) = (pieces.collect::<String>(), stroke_style(stroke));
        let opacity = if opacity < 1.0 {
            format!(r#" stroke-opacity="{}""#, number(opacity))
        } else {
            String::new()
        };
        self.put(format_args!(r#"<path d="{path}" fill="none" {style}{opacity}/>"#));
    }

    pub fn outline(&mut self, area: Area, stroke: Stroke) {
        let [a, b, c, d] = area.corners();
        self.polyline(&[a, b, c, d, a], stroke);
    }

    pub fn disc(&mut self, at: At, radius: f64, fill: Rgb) {
        let ([x, y], radius, fill) = (at.map(number), number(radius), hex(fill));
        self.put(format_args!(
            r#"<circle cx="{x}" cy="{y}" r="{radius}" fill="{fill}"/>"#
        ));
    }

    /// A filled circle, or a ring with a line of this width.
    pub fn circle(&mut self, at: At, radius: f64, ring: Option<f64>, colour: Rgb, opacity: f64) {
        let ([x, y], radius, colour, opacity) = (at.map(number), number(radius), hex(colour), number(opacity));
        let style = match ring.map(number) {
            Some(width) => {
                format!(r#"fill="none" stroke="{colour}" stroke-width="{width}" stroke-opacity="{opacity}""#)
            }
            None => format!(r#"fill="{colour}" fill-opacity="{opacity}""#),
        };
        self.put(format_args!(r#"<circle cx="{x}" cy="{y}" r="{radius}" {style}/>"#));
    }

    pub fn ring(&mut self, at: At, radius: f64, stroke: Stroke) {
        let ([x, y], radius, style) = (at.map(number), number(radius), stroke_style(stroke));
        self.put(format_args!(
            r#"<circle cx="{x}" cy="{y}" r="{radius}" fill="none" {style}/>"#
        ));
    }

    /// Text that is centred vertically on `at`.
    pub fn text(&mut self, at: At, anchor: Anchor, colour: Rgb, text: &str) {
        let [x, y] = [at[0], at[1] + 0.36 * TEXT].map(number);
        self.write_text(&format!(r#"x="{x}" y="{y}""#), anchor, colour, 400, text);
    }

    /// As [`Self::text`], in semi-bold type.
    pub fn title(&mut self, at: At, text: &str) {
        let [x, y] = [at[0], at[1] + 0.36 * TEXT].map(number);
        self.write_text(&format!(r#"x="{x}" y="{y}""#), Anchor::Middle, INK, 600, text);
    }

    /// Text that reads upwards, centred at `at`.
    pub fn upright_text(&mut self, at: At, colour: Rgb, text: &str) {
        let [x, y] = [at[0] + 0.36 * TEXT, at[1]].map(number);
        let place = format!(r#"transform="translate({x} {y}) rotate(-90)""#);
        self.write_text(&place, Anchor::Middle, colour, 400, text);
    }

    fn write_text(&mut self, place: &str, anchor: Anchor, colour: Rgb, weight: u16, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let (colour, text) = (hex(colour), escaped(text));
        self.put(format_args!(
            r#"<text {place} text-anchor="{anchor}" font-weight="{weight}" fill="{colour}">{text}</text>"#
        ));
    }

    /// Clips everything that `draw` draws to `area`.
    pub fn clipped(&mut self, area: Area, draw: impl FnOnce(&mut Self)) {
        self.clips += 1;
        let clip = self.clips;
        let [x, y, width, height] = [area.left, area.top, area.width, area.height].map(number);
        self.put(format_args!(
            r##"<clipPath id="c{clip}"><rect x="{x}" y="{y}" width="{width}" height="{height}"/></clipPath><g clip-path="url(#c{clip})">"##
        ));
        draw(self);
        self.put("</g>");
    }

    pub fn finish(self) -> Picture {
        let size = [self.width, self.height];
        let [width, height] = size.map(number);
        let body = self.body;
        let svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{width}pt" height="{height}pt" viewBox="0 0 {width} {height}" font-family="'Inter Tabular', Inter, Helvetica, Arial, sans-serif" font-size="{TEXT}" stroke-linejoin="round">
<rect width="{width}" height="{height}" fill="#ffffff"/>
{body}</svg>
"##
        );
        Picture::new(svg, size)
    }
}

/// Formats a length to a hundredth of a point, without trailing zeros.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn coordinates(points: &[At]) -> String {
    let pairs = points.iter().map(|&point| pair(point));
    pairs.collect::<Vec<_>>().join(" ")
}

fn pair(point: At) -> String {
    point.map(number).join(",")
}

fn hex([red, green, blue]: Rgb) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn stroke_style(stroke: Stroke) -> String {
    let (colour, width) = (hex(stroke.colour), number(stroke.width));
    let dashes = match stroke.dashes {
        "" => String::new(),
        dashes => format!(r#" stroke-dasharray="{dashes}""#),
    };
    format!(r#"stroke="{colour}" stroke-width="{width}"{dashes}"#)
}

pub(super) fn escaped(text: &str) -> String {
    // XML does not allow control characters, not even escaped ones.
    let text = text.replace(is_unprintable, " ");
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
