//! Files of the program: contents are read back bit for bit, and damage is reported.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod checkpoint_file;
mod documents;
mod network_file;
mod properties;
mod run_folder;
mod trained;
