//! The window.

pub mod surface_view;
pub mod theme;
