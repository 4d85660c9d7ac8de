//! Shapes written as SVG. Lengths are points of a layout with text of size [`TEXT`]; the page is scaled to the size in print.

use std::fmt::Write as _;

use decoupler_core::text::is_unprintable;
use glam::Vec2;

use super::picture::{Picture, hex_of, rgb};
use crate::figure::{Align, Bounds, Colour, Ink, Shape, Stroke};

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

    /// Draws shapes in their order. Neighbours that look alike become one element.
    pub fn draw(&mut self, shapes: impl IntoIterator<Item = Shape>) {
        let shapes = Vec::from_iter(shapes);
        let are_alike = |one: &Shape, other: &Shape| match (one, other) {
            (Shape::Line(_, one), Shape::Line(_, other)) => one == other,
            (Shape::Area(..), Shape::Area(..)) => true,
            _ => false,
        };
        for shapes in shapes.chunk_by(are_alike) {
            match &shapes[0] {
                Shape::Line(_, stroke) => self.draw_lines(shapes, stroke),
                Shape::Area(..) => self.draw_areas(shapes),
                &Shape::Disc(at, radius, colour) => {
                    let style = format!("fill=\"{}\"{}", hex(colour.ink), opacity("fill", colour));
                    self.draw_circle(at, radius, &style);
                }
                Shape::Ring(at, radius, stroke) => {
                    self.draw_circle(*at, *radius, &format!("fill=\"none\" {}", stroke_style(stroke)));
                }
                Shape::Text(at, align, ink, text) => {
                    // From the middle of the height to the base line.
                    let below = 0.36 * TEXT;
                    let [x, right, y, down] = [at.x, at.x + below, at.y, at.y + below].map(number);
                    let beside = |anchor: &str| format!(r#"x="{x}" y="{down}" text-anchor="{anchor}""#);
                    let place = match align {
                        Align::Start => beside("start"),
                        Align::Middle => beside("middle"),
                        Align::End => beside("end"),
                        Align::Upright => {
                            format!(r#"transform="translate({right} {y}) rotate(-90)" text-anchor="middle""#)
                        }
                    };
                    let (fill, text) = (hex(*ink), escaped(text));
                    self.put(&format!(r#"<text {place} fill="{fill}">{text}</text>"#));
                }
            }
        }
    }

    fn draw_circle(&mut self, at: Vec2, radius: f32, style: &str) {
        let [x, y, radius] = [at.x, at.y, radius].map(number);
        self.put(&format!(r#"<circle cx="{x}" cy="{y}" r="{radius}" {style}/>"#));
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

    fn draw_lines(&mut self, lines: &[Shape], stroke: &Stroke) {
        let points = lines.iter().filter_map(|line| match line {
            Shape::Line(points, _) => Some(format!("M{}", coordinates(points))),
            _ => None,
        });
        let (path, style) = (points.collect::<String>(), stroke_style(stroke));
        self.put(&format!(r#"<path d="{path}" fill="none" {style}/>"#));
    }

    /// A hairline in its own colour closes the seam of an area to its neighbours; a translucent area has crisp edges
    /// instead, because the hairlines would be visible.
    fn draw_areas(&mut self, areas: &[Shape]) {
        self.put(r#"<g fill="currentColor" stroke="currentColor" stroke-width=".4">"#);
        for area in areas {
            let Shape::Area(corners, colour) = area else { continue };
            let style = match opacity("fill", *colour) {
                opaque if opaque.is_empty() => opaque,
                opacity => format!(r#"{opacity} stroke="none" shape-rendering="crispEdges""#),
            };
            let (colour, path) = (hex(colour.ink), coordinates(corners));
            self.put(&format!(r#"<path color="{colour}" d="M{path}z"{style}/>"#));
        }
        self.put("</g>");
    }

    pub fn finish(self) -> Picture {
        let [width, height] = self.size.to_array().map(number);
        let print = self.size * SCALE;
        let [print_width, print_height] = print.to_array().map(number);
        let body = self.body;
        let svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{print_width}pt" height="{print_height}pt" viewBox="0 0 {width} {height}" font-family="'Inter Tabular', Inter, Helvetica, Arial, sans-serif" font-size="{TEXT}" stroke-linejoin="round">
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
    let mut text = String::with_capacity(12 * points.len());
    for point in points {
        let [x, y] = point.to_array().map(number);
        let between = if text.is_empty() { "" } else { " " };
        // Writing to a string cannot fail.
        let _ = write!(text, "{between}{x},{y}");
    }
    text
}

fn hex(ink: Ink) -> String {
    hex_of(rgb(ink))
}

fn opacity(of: &str, colour: Colour) -> String {
    match number(colour.opacity) {
        opaque if opaque == "1" => String::new(),
        opacity => format!(r#" {of}-opacity="{opacity}""#),
    }
}

fn stroke_style(stroke: &Stroke) -> String {
    let (colour, width) = (hex(stroke.colour.ink), number(stroke.width));
    let dashes = stroke.dashes.map_or_else(String::new, |dashes| {
        format!(r#" stroke-dasharray="{}""#, dashes.map(number).join(" "))
    });
    let opacity = opacity("stroke", stroke.colour);
    format!(r#"stroke="{colour}" stroke-width="{width}"{dashes}{opacity}"#)
}

pub(super) fn escaped(text: &str) -> String {
    // XML does not allow control characters, not even escaped ones.
    let text = text.replace(is_unprintable, " ");
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
