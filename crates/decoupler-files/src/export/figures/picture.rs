//! Shapes written as SVG, and finished figures as SVG, as PNG, and in an HTML page that follows the reader's dark theme.
//! Lengths are points of a layout with text of size [`TEXT`]; the page is scaled to the size in print.

use std::{
    io,
    path::{Path, PathBuf},
    sync::{Arc, LazyLock},
};

use decoupler_core::text::is_unprintable;
use glam::Vec2;
use resvg::{tiny_skia, usvg};
use thiserror::Error;

use crate::{
    export::{WriteError, atomic_write},
    figure::{Align, Bounds, Colour, Ink, Rgb, Shape, Stroke},
};

/// A finished figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    svg: String,
    /// Width as a share of that of the page.
    share: f32,
}

/// Errors of writing a figure.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The figure cannot be drawn in pixels.
    #[error("the picture cannot be drawn in pixels: {0}; save it as SVG instead")]
    Pixels(String),
    /// The file name has no known extension.
    #[error("cannot write '{}': give a name that ends in .png or .svg", .0.display())]
    Name(PathBuf),
    /// The file.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// The minimum that journals require.
const DOTS_PER_INCH: f32 = 300.0;

impl Picture {
    /// Draws layers from back to front on a page of this size.
    pub(super) fn new(size: Vec2, layers: &[Layer]) -> Self {
        let mut body = Vec::new();
        for (layer, (clip, shapes)) in layers.iter().enumerate() {
            body.extend(clip.map(|area| {
                let [[x, y], [width, height]] = [area.min, area.size()].map(|part| part.to_array().map(number));
                format!(
                    r##"<clipPath id="c{layer}"><rect x="{x}" y="{y}" width="{width}" height="{height}"/></clipPath><g clip-path="url(#c{layer})">"##
                )
            }));
            body.extend(shapes.iter().map(element));
            body.extend(clip.map(|_| "</g>".to_owned()));
        }
        let [[width, height], print] = [size, size * SCALE].map(|size| size.to_array().map(number));
        let ([print_width, print_height], body) = (print, body.join("\n"));
        let svg = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{print_width}pt" height="{print_height}pt" viewBox="0 0 {width} {height}" font-family="'Inter Tabular', Inter, Helvetica, Arial, sans-serif" font-size="{TEXT}" stroke-width=".4" stroke-linejoin="round">
<rect width="{width}" height="{height}" fill="#ffffff"/>
{body}
</svg>
"##
        );
        let share = size.x / PAGE_WIDTH;
        Self { svg, share }
    }

    /// The figure as SVG. Its text names the program's font and common substitutes.
    pub fn svg(&self) -> &str {
        &self.svg
    }

    /// The figure as the bytes of a PNG file, 300 pixels to the inch.
    ///
    /// # Errors
    /// There is not enough memory for the pixels.
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        let encoded = self.pixmap()?.encode_png();
        encoded.map_err(|error| PictureError::Pixels(error.to_string()))
    }

    /// The figure as pixels, 300 to the inch: width, height, and red, green, blue and opacity of each, row by row.
    ///
    /// # Errors
    /// There is not enough memory for them.
    pub fn pixels(&self) -> Result<([usize; 2], Vec<u8>), PictureError> {
        let pixmap = self.pixmap()?;
        let size = [pixmap.width() as usize, pixmap.height() as usize];
        Ok((size, pixmap.take_demultiplied()))
    }

    fn pixmap(&self) -> Result<tiny_skia::Pixmap, PictureError> {
        let options = usvg::Options {
            dpi: DOTS_PER_INCH,
            fontdb: Arc::clone(&FONTS),
            ..usvg::Options::default()
        };
        let tree =
            usvg::Tree::from_str(&self.svg, &options).map_err(|error| PictureError::Pixels(error.to_string()))?;
        let size = tree.size().to_int_size();
        let pixels = tiny_skia::Pixmap::new(size.width(), size.height());
        let mut pixels = pixels.ok_or_else(|| PictureError::Pixels(format!("no memory for {size:?}")))?;
        resvg::render(&tree, tiny_skia::Transform::default(), &mut pixels.as_mut());
        Ok(pixels)
    }

    /// Writes the figure atomically, as SVG or PNG by the extension of `path`.
    ///
    /// # Errors
    /// The name ends neither in .svg nor in .png, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), PictureError> {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let bytes = match extension.to_str() {
            Some("svg") => self.svg.clone().into_bytes(),
            Some("png") => self.png()?,
            _ => return Err(PictureError::Name(path.to_owned())),
        };
        atomic_write(path, |writer| io::Write::write_all(writer, &bytes))?;
        Ok(())
    }

    /// Returns the figure for an HTML page, with the same share of the page width as in print, without external
    /// references, and with ids that are unique to `place`. `label` is its description for screen readers.
    pub(crate) fn inline_svg(&self, place: usize, label: &str) -> String {
        let label = escaped(label).replace('"', "&quot;");
        let rest = self.svg.find("viewBox").unwrap_or_default();
        let share = 100.0 * self.share;
        let inline = format!(
            "<svg role=\"img\" aria-label=\"{label}\" width=\"{share:.1}%\" {}",
            &self.svg[rest..]
        );
        inline
            .replace("id=\"c", &format!("id=\"f{place}c"))
            .replace("url(#c", &format!("url(#f{place}c"))
    }
}

/// Only the program's own fonts.
static FONTS: LazyLock<Arc<usvg::fontdb::Database>> = LazyLock::new(|| {
    let mut fonts = usvg::fontdb::Database::new();
    fonts.load_font_data(include_bytes!("../../../../../assets/fonts/InterTabular-Regular.ttf").into());
    fonts.load_font_data(include_bytes!("../../../../../assets/fonts/InterTabular-SemiBold.ttf").into());
    Arc::new(fonts)
});

/// The roles of colours: each in print, dark enough for paper, and on a dark background.
const PALETTE: [(Ink, Rgb, Rgb); 12] = [
    (Ink::Ground, [0xff; 3], [0x1b, 0x1e, 0x24]),
    (Ink::Text, [0x1b, 0x24, 0x30], [0xe7, 0xea, 0xf0]),
    (Ink::Grey, [0x5b, 0x64, 0x72], [0x98, 0xa2, 0xb3]),
    (Ink::Grid, [0xe3, 0xe7, 0xee], [0x2c, 0x32, 0x3c]),
    (Ink::Edge, [0xa2, 0xa9, 0xb4], [0x5b, 0x64, 0x72]),
    (Ink::Missing, [0xf3, 0xf5, 0xf8], [0x24, 0x29, 0x32]),
    (Ink::Blue, [0x1f, 0x6f, 0xeb], [0x5b, 0x9d, 0xff]),
    (Ink::Red, [0xc6, 0x2f, 0x2f], [0xf0, 0x6a, 0x6a]),
    (Ink::Green, [0x1a, 0x7f, 0x4b], [0x4c, 0xc3, 0x8a]),
    (Ink::Orange, [0xa8, 0x64, 0x00], [0xf0, 0xa8, 0x3c]),
    (Ink::Violet, [0x7a, 0x3e, 0xb1], [0xb5, 0x8a, 0xe6]),
    (Ink::Cyan, [0x0b, 0x76, 0x8c], [0x4f, 0xc3, 0xd9]),
];

/// Returns a colour in print.
fn rgb(ink: Ink) -> Rgb {
    match ink {
        Ink::Rgb(colour) => colour,
        Ink::Label => rgb(Ink::Text),
        _ => {
            let entry = PALETTE.iter().find(|(role, ..)| *role == ink);
            entry.expect("every role is in the palette").1
        }
    }
}

fn hex([red, green, blue]: Rgb) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Style rules that show the figures of a page on a dark background if the reader prefers a dark theme.
pub(crate) fn dark_style() -> String {
    let rules = PALETTE.map(|(ink, print, dark)| {
        let (print, dark) = (hex(print), hex(dark));
        // White dots mark nodes, and white cells errors of zero, on any background.
        let [areas, lines] = match ink {
            Ink::Ground => ["rect", "[fill=none]"],
            _ => [""; 2],
        };
        let fill = format!("  svg {areas}[fill=\"{print}\"] {{ fill: {dark}; }}\n");
        format!("{fill}  svg {lines}[stroke=\"{print}\"] {{ stroke: {dark}; }}\n")
    });
    let rules = rules.concat();
    format!("@media screen and (prefers-color-scheme: dark) {{\n{rules}}}\n")
}

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

/// Shapes in their order, clipped to an area if there is one.
pub(super) type Layer = (Option<Bounds>, Vec<Shape>);

/// Draws a shape.
fn element(shape: &Shape) -> String {
    match shape {
        Shape::Line(points, stroke) => {
            let (path, style) = (coordinates(points), stroke_style(stroke));
            format!(r#"<path d="M{path}" fill="none"{style}/>"#)
        }
        Shape::Area(corners, colour) => {
            // A hairline in its own colour closes the seam of an area to its neighbours; a translucent area has crisp
            // edges instead, because the hairlines would be visible.
            let edge = match colour.opacity < 1.0 {
                true => r#" shape-rendering="crispEdges""#.to_owned(),
                false => paint("stroke", *colour),
            };
            let (path, fill) = (coordinates(corners), paint("fill", *colour));
            format!(r#"<path d="M{path}z"{fill}{edge}/>"#)
        }
        Shape::Disc(at, radius, colour) => circle(*at, *radius, &paint("fill", *colour)),
        Shape::Ring(at, radius, stroke) => circle(*at, *radius, &format!(r#" fill="none"{}"#, stroke_style(stroke))),
        Shape::Text(at, align, ink, text) => {
            // From the middle of the height to the base line.
            let below = 0.36 * TEXT;
            let [x, right, y, down] = [at.x, at.x + below, at.y, at.y + below].map(number);
            let anchor = match align {
                Align::Start => "start",
                Align::Middle | Align::Upright => "middle",
                Align::End => "end",
            };
            let place = match align {
                Align::Upright => format!(r#"transform="translate({right} {y}) rotate(-90)""#),
                _ => format!(r#"x="{x}" y="{down}""#),
            };
            let (fill, text) = (paint("fill", (*ink).into()), escaped(text));
            format!(r#"<text {place} text-anchor="{anchor}"{fill}>{text}</text>"#)
        }
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

fn escaped(text: &str) -> String {
    // XML does not allow control characters, not even escaped ones.
    let text = text.replace(is_unprintable, " ");
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
