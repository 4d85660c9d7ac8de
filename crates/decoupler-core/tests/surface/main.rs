//! Surfaces through nodes on a grid and anywhere, against independent implementations.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod lattice;
mod scattered;
