//! The command line, run as a program.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod automatic;
mod calibrate;
mod causes;
mod commands;
mod conventions;
mod earlier_files;
#[cfg(unix)]
mod ends;
mod export;
mod files;
mod files_as_they_are;
#[cfg(unix)]
mod follow;
mod import;
mod live;
mod memory;
mod own_export;
mod own_trade;
mod printed;
mod recorded;
mod reproduce;
mod resume;
mod scenes;
mod sweep;

#[path = "../support/folders.rs"]
mod folders;
#[path = "../support/terminal.rs"]
mod terminal;
