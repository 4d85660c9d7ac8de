//! The program: the same work in a window and in a terminal.
//!
//! | module | contents |
//! |---|---|
//! | [`terminal`] | the commands |
//! | [`window`] | the window |
//!
//! Numerics are in [`decoupler_core`], files in [`decoupler_files`].

mod signals;
pub mod terminal;
pub mod window;

// The driver of the window's tests names this crate as they do.
#[cfg(test)]
extern crate self as decoupler;
#[cfg(test)]
#[allow(dead_code, reason = "shared with the tests of the window")]
#[path = "../tests/window/driver.rs"]
mod driver;
#[cfg(test)]
#[allow(dead_code, reason = "shared with the tests of the window")]
#[path = "../tests/window/rasterise.rs"]
mod rasterise;
