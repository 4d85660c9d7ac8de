//! Files of ours: what is written comes back with the same bits, and damage is named.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod checkpoint_file;
mod network_file;
mod run_folder;
mod versions;
