//! Figures on the screen and in print, and the surfaces in them.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod print;
mod surfaces;
