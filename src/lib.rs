//! Decoupling of flexible tactile sensor arrays.

pub mod surface;
