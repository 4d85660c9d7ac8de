//! Surfaces against independent implementations, and figures on the screen and in print.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod gallery;
mod lattice;
mod print;
mod scattered;
mod surfaces;
