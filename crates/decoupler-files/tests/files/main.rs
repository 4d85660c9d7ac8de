//! Files of the program: contents are read back bit for bit, and damage is reported.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod checkpoint_file;
mod network_file;
mod run_folder;
mod sensor_file;
mod versions;
