//! Runs from settings to tables: samples, starts, folds, scenes, experiments.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[cfg(feature = "files")]
mod experiments;
#[cfg(feature = "files")]
mod measured;
mod rows_and_folds;
mod run_starts;
#[cfg(feature = "files")]
mod scenes;
