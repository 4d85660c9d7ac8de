//! Finished figures as SVG, as PNG, and in an HTML page that follows the reader's dark theme.
//! Colours in print are dark enough for paper.

use std::{
    io,
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use resvg::{tiny_skia, usvg};
use thiserror::Error;

use super::{canvas::number, plot::PAGE_WIDTH};
pub(super) use crate::figure::Rgb;
use crate::{
    export::{WriteError, atomic_write},
    figure::Hue,
};

/// A finished figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    svg: String,
    /// Width and height in points.
    size: [f64; 2],
}

/// File format of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PictureFormat {
    /// Lines and text, sharp at any size.
    Svg,
    /// Pixels, 300 to the inch.
    Png,
}

impl PictureFormat {
    /// File name extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Png => "png",
        }
    }
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

impl PictureFormat {
    /// Returns the format given by the extension of `path`.
    ///
    /// # Errors
    /// The name ends neither in .svg nor in .png.
    pub fn of_path(path: &Path) -> Result<Self, PictureError> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let formats = [Self::Svg, Self::Png].into_iter();
        let mut named = formats.filter(|format| format.extension() == extension);
        named.next().ok_or_else(|| PictureError::Name(path.to_owned()))
    }
}

/// The minimum that journals require.
const DOTS_PER_INCH: f32 = 300.0;

impl Picture {
    pub(super) fn new(svg: String, size: [f64; 2]) -> Self {
        Self { svg, size }
    }

    /// Width and height in points.
    pub(super) fn size(&self) -> [f64; 2] {
        self.size
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
        let colours = pixmap.pixels().iter().map(|pixel| pixel.demultiply());
        let bytes = colours.flat_map(|colour| [colour.red(), colour.green(), colour.blue(), colour.alpha()]);
        Ok((size, bytes.collect()))
    }

    fn pixmap(&self) -> Result<tiny_skia::Pixmap, PictureError> {
        let options = usvg::Options {
            dpi: DOTS_PER_INCH,
            fontdb: fonts(),
            ..usvg::Options::default()
        };
        let failed = |reason: String| PictureError::Pixels(reason);
        let tree = usvg::Tree::from_str(&self.svg, &options).map_err(|error| failed(error.to_string()))?;
        let size = tree.size().to_int_size();
        let pixels = tiny_skia::Pixmap::new(size.width(), size.height());
        let mut pixels = pixels.ok_or_else(|| failed(format!("no memory for {size:?}")))?;
        resvg::render(&tree, tiny_skia::Transform::default(), &mut pixels.as_mut());
        Ok(pixels)
    }

    /// Writes the figure atomically.
    ///
    /// # Errors
    /// The path cannot be written.
    pub fn save(&self, format: PictureFormat, path: &Path) -> Result<(), PictureError> {
        let png;
        let bytes = match format {
            PictureFormat::Svg => self.svg.as_bytes(),
            PictureFormat::Png => {
                png = self.png()?;
                &png
            }
        };
        atomic_write(path, |writer| io::Write::write_all(writer, bytes))?;
        Ok(())
    }
}

/// Only the program's own fonts.
fn fonts() -> Arc<usvg::fontdb::Database> {
    static FONTS: OnceLock<Arc<usvg::fontdb::Database>> = OnceLock::new();
    let load = || {
        let mut fonts = usvg::fontdb::Database::new();
        let faces: [&'static [u8]; 2] = [
            include_bytes!("../../../../../assets/fonts/InterTabular-Regular.ttf"),
            include_bytes!("../../../../../assets/fonts/InterTabular-SemiBold.ttf"),
        ];
        for face in faces {
            fonts.load_font_source(usvg::fontdb::Source::Binary(Arc::new(face)));
        }
        Arc::new(fonts)
    };
    Arc::clone(FONTS.get_or_init(load))
}

/// Colours in print, and their replacements on a dark background.
fn pairs() -> [(Rgb, Rgb); 11] {
    [
        ([0xff; 3], [0x1b, 0x1e, 0x24]),
        (INK, [0xe7, 0xea, 0xf0]),
        (DIM, [0x98, 0xa2, 0xb3]),
        (GRID, [0x2c, 0x32, 0x3c]),
        (MISSING, [0x24, 0x29, 0x32]),
        (rgb(Hue::Blue), [0x5b, 0x9d, 0xff]),
        (rgb(Hue::Red), [0xf0, 0x6a, 0x6a]),
        (rgb(Hue::Green), [0x4c, 0xc3, 0x8a]),
        (rgb(Hue::Orange), [0xf0, 0xa8, 0x3c]),
        (rgb(Hue::Violet), [0xb5, 0x8a, 0xe6]),
        (rgb(Hue::Cyan), [0x4f, 0xc3, 0xd9]),
    ]
}

/// Style rules that show the figures of a page on a dark background if the reader prefers a dark theme.
pub(crate) fn dark_style() -> String {
    let hex = |[red, green, blue]: Rgb| format!("#{red:02x}{green:02x}{blue:02x}");
    let rules = pairs().map(|(print, dark)| {
        let (print, dark) = (hex(print), hex(dark));
        // White dots mark nodes on any background.
        let of_circles = if print == "#ffffff" { ":not(circle)" } else { "" };
        format!(
            "  svg [fill=\"{print}\"]{of_circles} {{ fill: {dark}; }}\n  svg [stroke=\"{print}\"] {{ stroke: {dark}; }}\n"
        )
    });
    format!(
        "@media screen and (prefers-color-scheme: dark) {{\n{}}}\n",
        rules.concat()
    )
}

impl Picture {
    /// Returns the figure for an HTML page, with the same share of the page width as in print, without external
    /// references, and with ids that are unique to `place`. `label` is its description for screen readers.
    pub(crate) fn inline_svg(&self, place: usize, label: &str) -> String {
        let label = super::canvas::escaped(label).replace('"', "&quot;");
        let [width, height] = self.size();
        let share = number(100.0 * width / PAGE_WIDTH);
        let [width, height] = [width, height].map(number);
        let own = format!("xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}pt\" height=\"{height}pt\"");
        let here = format!("role=\"img\" aria-label=\"{label}\" width=\"{share}%\"");
        self.svg()
            .replacen(&own, &here, 1)
            .replace("id=\"c", &format!("id=\"f{place}c"))
            .replace("url(#c", &format!("url(#f{place}c"))
    }
}

pub(super) const INK: Rgb = [0x1b, 0x24, 0x30];
pub(super) const DIM: Rgb = [0x5b, 0x64, 0x72];
pub(super) const GRID: Rgb = [0xe3, 0xe7, 0xee];
pub(super) const MISSING: Rgb = [0xf3, 0xf5, 0xf8];

/// A hue in print.
pub(super) fn rgb(hue: Hue) -> Rgb {
    match hue {
        Hue::Blue => [0x1f, 0x6f, 0xeb],
        Hue::Red => [0xc6, 0x2f, 0x2f],
        Hue::Green => [0x1a, 0x7f, 0x4b],
        Hue::Orange => [0xa8, 0x64, 0x00],
        Hue::Violet => [0x7a, 0x3e, 0xb1],
        Hue::Cyan => [0x0b, 0x76, 0x8c],
        Hue::Grey => DIM,
        Hue::Ink => INK,
    }
}

/// Returns a paler colour: 0 leaves it unchanged, 1 is white.
pub(super) fn pale(colour: Rgb, paler: f64) -> Rgb {
    colour.map(|part| (f64::from(part) + paler * (255.0 - f64::from(part))).round() as u8)
}

/// Ink on light colours, white on dark ones.
pub(super) fn contrast([red, green, blue]: Rgb) -> Rgb {
    let luma = 0.299 * f64::from(red) + 0.587 * f64::from(green) + 0.114 * f64::from(blue);
    if luma > 120.0 { INK } else { [255; 3] }
}
