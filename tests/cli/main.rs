//! The command line, run as a program.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod automatic;
mod calibrate;
mod calls;
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
mod recorded;
mod refusals;
mod reproduce;
#[cfg(unix)]
mod resume;
mod scenes;
#[cfg(unix)]
mod sweep;

#[path = "../support/folders.rs"]
mod folders;
#[path = "../support/terminal.rs"]
mod terminal;
