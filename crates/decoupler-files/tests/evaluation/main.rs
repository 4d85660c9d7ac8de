//! Runs from settings to tables: samples, starts, folds, scenes, experiments.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod experiments;
mod measured;
mod rows_and_folds;
mod run_starts;
mod scenes;
