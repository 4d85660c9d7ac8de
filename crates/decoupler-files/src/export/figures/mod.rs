//! Drawings of [figures](crate::figure) at publication size on a light background, as SVG and PNG, without a window.
//!
//! [`Figure::draw`] gives a [`Picture`], which is its SVG. The PNG is drawn from that SVG with the program's fonts, so
//! both look the same on every machine. Values that are not finite are left out.

mod canvas;
mod frame;
mod picture;
mod plot;
mod surfaces;

pub(crate) use picture::dark_style;
pub use picture::{Picture, PictureError, PictureFormat};

use crate::figure::Figure;

impl Figure {
    /// Draws the figure for print.
    pub fn draw(&self) -> Picture {
        match self {
            Self::Plots(plots) => plots.draw(),
            Self::HeatMap(map) => map.draw(),
            Self::Surfaces(surfaces) => surfaces::draw_surfaces(surfaces),
        }
    }
}
