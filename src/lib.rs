//! The program: the same work in a window and in a terminal.
//!
//! | module | contents |
//! |---|---|
//! | [`terminal`] | the commands |
//! | [`window`] | the window |
//!
//! Numerics are in [`decoupler_core`], files in [`decoupler_files`].

pub mod terminal;
pub mod window;
