//! What pictures say, knowing neither the window nor a file format: the window and `export::figures` draw the same
//! values.

mod colour_map;
pub mod surface;
pub(crate) mod ticks;

pub use colour_map::{ColourMap, Rgb, is_light};
