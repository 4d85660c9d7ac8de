//! Shapes written as SVG. Lengths are points of a layout with text of size [`TEXT`]; the page is scaled to the size in print.

use decoupler_core::text::is_unprintable;
use glam::Vec2;

use super::picture::{Picture, hex, rgb};
use crate::figure::{Align, Bounds, Colour, Shape, Stroke};

/// Size of all text in the layout.
pub(super) const TEXT: f32 = 11.0;
/// Points in print (1/72 inch) per point of the layout: text has 8 points.
const SCALE: f32 = 8.0 / TEXT;
/// Width of a page in the layout: 510 points in print.
pub(super) const PAGE_WIDTH: f32 = 510.0 / SCALE;

/// Estimated size of a text, used to reserve room for it.
pub(super) fn measure(text: &str) -> Vec2 {
    let width = |character: char| match character {
        '.' | ',' | ' ' => 0.3,
        '0'..='9' | '−' => 0.63,
        _ => 0.57,
    };
    Vec2::new(text.chars().map(width).sum(), 1.2) * TEXT
}

/// A drawing of shapes.
pub(super) struct Canvas {
    size: Vec2,
    body: String,
    clips: usize,
}

impl Canvas {
    pub fn new(size: Vec2) -> Self {
        Self {
            size,
            body: String::new(),
            clips: 0,
        }
    }

    /// Draws shapes in their order.
    pub fn draw(&mut self, shapes: impl IntoIterator<Item = Shape>) {
        for shape in shapes {
            let element = match shape {
                Shape::Line(points, stroke) => {
                    format!(
                        r#"<path d="M{}" fill="none"{}/>"#,
                        coordinates(&points),
                        stroke_style(&stroke)
                    )
                }
                Shape::Area(corners, colour) => {
                    // A hairline in its own colour closes the seam of an area to its neighbours; a translucent area has crisp
                    // edges instead, because the hairlines would be visible.
                    let edge = match colour.opacity < 1.0 {
                        true => r#" shape-rendering="crispEdges""#.to_owned(),
                        false => format!(r#" stroke="{}""#, hex(rgb(colour.ink))),
                    };
                    format!(
                        r#"<path d="M{}z"{}{edge}/>"#,
                        coordinates(&corners),
                        paint("fill", colour)
                    )
                }
                Shape::Disc(at, radius, colour) => circle(at, radius, &paint("fill", colour)),
                Shape::Ring(at, radius, stroke) => {
                    circle(at, radius, &format!(r#" fill="none"{}"#, stroke_style(&stroke)))
                }
                Shape::Text(at, align, ink, text) => {
                    // From the middle of the height to the base line.
                    let below = 0.36 * TEXT;
                    let [x, right, y, down] = [at.x, at.x + below, at.y, at.y + below].map(number);
                    let (place, anchor) = match align {
                        Align::Upright => (format!(r#"transform="translate({right} {y}) rotate(-90)""#), "middle"),
                        Align::Start => (format!(r#"x="{x}" y="{down}""#), "start"),
                        Align::Middle => (format!(r#"x="{x}" y="{down}""#), "middle"),
                        Align::End => (format!(r#"x="{x}" y="{down}""#), "end"),
                    };
                    let (fill, text) = (paint("fill", ink.into()), escaped(&text));
                    format!(r#"<text {place} text-anchor="{anchor}"{fill}>{text}</text>"#)
                }
            };
            self.put(&element);
        }
    }

    /// Draws shapes, clipped to `area`.
    pub fn draw_clipped(&mut self, area: Bounds, shapes: impl IntoIterator<Item = Shape>) {
        self.clips += 1;
        let (clip, [x, y]) = (self.clips, area.min.to_array().map(number));
        let [width, height] = area.size().to_array().map(number);
        self.put(&format!(
            r##"<clipPath id="c{clip}"><rect x="{x}" y="{y}" width="{width}" height="{height}"/></clipPath><g clip-path="url(#c{clip})">"##
        ));
        self.draw(shapes);
        self.put("</g>");
    }

    fn put(&mut self, element: &str) {
        self.body += element;
        self.body.push('\n');
    }

    pub fn finish(self) -> Picture {
        let [width, height] = self.size.to_array().map(number);
        let print = self.size * SCALE;
        let [print_width, print_height] = print.to_array().map(number);
        let body = self.body;
        let svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{print_width}pt" height="{print_height}pt" viewBox="0 0 {width} {height}" font-family="'Inter Tabular', Inter, Helvetica, Arial, sans-serif" font-size="{TEXT}" stroke-width=".4" stroke-linejoin="round">
<rect width="{width}" height="{height}" fill="#ffffff"/>
{body}</svg>
"##
        );
        Picture::new(svg, self.size.x / PAGE_WIDTH)
    }
}

/// Formats a length to a hundredth, without trailing zeros.
fn number(value: f32) -> String {
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn coordinates(points: &[Vec2]) -> String {
    let points = points.iter().map(|point| point.to_array().map(number).join(","));
    Vec::from_iter(points).join(" ")
}

fn circle(at: Vec2, radius: f32, style: &str) -> String {
    let [x, y, radius] = [at.x, at.y, radius].map(number);
    format!(r#"<circle cx="{x}" cy="{y}" r="{radius}"{style}/>"#)
}

/// Attributes that paint the fill or the stroke.
fn paint(what: &str, colour: Colour) -> String {
    let (hex, opacity) = (hex(rgb(colour.ink)), number(colour.opacity));
    match &*opacity {
        "1" => format!(r#" {what}="{hex}""#),
        _ => format!(r#" {what}="{hex}" {what}-opacity="{opacity}""#),
    }
}

fn stroke_style(stroke: &Stroke) -> String {
    let (paint, width) = (paint("stroke", stroke.colour), number(stroke.width));
    let dashes = stroke.dashes.map_or_else(String::new, |dashes| {
        format!(r#" stroke-dasharray="{}""#, dashes.map(number).join(" "))
    });
    format!(r#"{paint} stroke-width="{width}"{dashes}"#)
}

pub(super) fn escaped(text: &str) -> String {
    // XML does not allow control characters, not even escaped ones.
    let text = text.replace(is_unprintable, " ");
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
