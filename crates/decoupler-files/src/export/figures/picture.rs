use std::{
    io,
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use resvg::{tiny_skia, usvg};
use thiserror::Error;

use crate::export::{WriteError, atomic_write};

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
    /// The name of the file tells no format.
    #[error("cannot write '{}': give a name that ends in .png or .svg", .0.display())]
    Name(PathBuf),
    /// The file.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl PictureFormat {
    /// The format that the extension of `path` names.
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

/// The minimum that journals ask for.
const DOTS_PER_INCH: f32 = 300.0;

impl Picture {
    pub(super) fn new(svg: String, size: [f64; 2]) -> Self {
        Self { svg, size }
    }

    /// Width and height in points.
    pub(super) fn size(&self) -> [f64; 2] {
        self.size
    }

    /// The figure as SVG. Its text names the program's font and common ones to are in for it.
    pub fn svg(&self) -> &str {
        &self.svg
    }

    /// The figure as the bytes of a PNG file, 300 pixels to the inch.
    ///
    /// # Errors
    /// There is no memory for the pixels.
    pub fn png(&self) -> Result<Vec<u8>, PictureError> {
        let encoded = self.pixmap()?.encode_png();
        encoded.map_err(|error| PictureError::Pixels(error.to_string()))
    }

    /// The figure as pixels, 300 to the inch: width, height, and red, green, blue and opacity of each, row by row.
    ///
    /// # Errors
    /// There is no memory for them.
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

/// The program's own fonts and no others.
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
