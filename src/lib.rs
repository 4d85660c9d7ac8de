//! Decoupling of flexible tactile sensor arrays.

#[cfg(feature = "gui")]
pub mod app;
pub mod surface;
