//! The sensor: its model, its calibration, and the information in its readings.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod calibration;
mod model;
mod noisy_rows;
mod recorded;
