//! Drawings of [figures](crate::figure) at publication size on a light background, as SVG and PNG, without a window.
//!
//! [`Figure::draw`](crate::figure::Figure::draw) gives a [`Picture`], which is its SVG. The PNG is drawn from that SVG with the
//! program's fonts, so both look the same on every machine. Values that are not finite are left out.

mod layout;
mod picture;

pub(crate) use picture::dark_style;
pub use picture::{Picture, PictureError};
