//! The window, operated through its labels as by a user, and compared with the library.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod accessibility;
mod automatic;
mod closing;
mod comparing;
mod configuring;
mod continuing;
mod decoders;
mod driver;
mod every_view;
mod experiments;
mod exporting;
mod extremes;
#[cfg(target_os = "linux")]
mod faults;
mod habits;
mod identifying;
mod import_choices;
mod importing;
mod intervals;
mod keeping;
mod live;
mod looking;
mod newcomer;
mod overwriting;
mod pressing;
mod rasterise;
mod reading_errors;
mod recordings;
mod remembering;
mod results;
mod same_networks;
mod scenes;
mod scrubbing;
mod sensor;
mod snapshots;
mod sources;
mod surface_view;
mod trading;
mod training;
mod typing;
mod variables;

#[path = "../support/folders.rs"]
mod folders;
#[cfg(target_os = "linux")]
#[path = "../support/faults.rs"]
mod preloaded;
#[path = "../support/terminal.rs"]
mod terminal;
