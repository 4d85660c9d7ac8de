//! The automatic choice of settings on recordings with traps, whose truth is known by construction.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod recordings;
mod traps;
