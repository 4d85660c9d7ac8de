//! Runs from settings to tables: measured data, scenes, experiments.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod experiments;
mod measured;
mod scenes;
