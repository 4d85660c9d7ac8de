//! Output files: network files, checkpoints, recipes, tables, figures and reports (feature `figures`). All of them are
//! written atomically: whole or not at all.
//!
//! # Files that are read back
//!
//! All are JSON with the fields `format`, `version` and `program`, the program that wrote the file. Each kind serves
//! simulated arrays and recordings alike. A program reads one version of each kind; any other is refused with the
//! version and the program that wrote it. Files that only the program writes keep their contents in the field `run`,
//! whose CRC-32 is in `crc32`, which detects any change. Paths of recordings are relative to the folder of the file;
//! recordings in the user's home, seen from a folder elsewhere, are stored by file name only.
//!
//! *Network file* (`decoupler network`, [`NetworkFile`]): `settings` of the run with its source, `recorded` (only of a
//! recording: the plan that reads it, CRC-32 of each file and of the samples), `problem` (names, units and positions of
//! readings and targets), `row_wires`, `network` (scalings and weights of each network), `training` (every epoch, methods,
//! starts, reason for stopping), and `scores` (errors of network and baselines on the test set).
//!
//! *Checkpoint* (`decoupler checkpoint`, [`CheckpointFile`]): `settings` and `recorded` as above, `wall_time`, and `starts`,
//! the state of every training. It has no samples: they are drawn or read again, and recorded samples are compared with
//! their CRC-32.
//!
//! *Recipe* (`decoupler recipe`, [`RecipeFile`]), to be written by hand too: `source`, which is either `simulated` (sensor,
//! scene and numbers of samples, each with a default) or `recording` (files, meanings of columns, division of the samples).
//!
//! *Sensor file* (`decoupler sensor`, [`SensorFile`]), to be written by hand too, then with the field `sensor` instead of `crc32`
//! and `run`: the array scale, the geometry and the resistance per millimetre, such as `decoupler calibrate` fits.
//!
//! *Run folder* ([`RunFolder`]): `run-N.json` is the network file of run N, `run-N.name.json` its name, and `pinned.json` the
//! numbers of the two runs that are compared; the last two are of the kind `decoupler run list`.

mod atomic;
pub mod bundle;
mod checkpoint_file;
mod document;
mod experiment_tables;
pub mod figures;
mod network_file;
mod recipe_file;
pub mod report;
mod run_folder;
mod samples;
mod sensor_file;
mod sweep;
mod table;
mod tables;
#[cfg(test)]
mod test_folder;
mod trade_tables;
mod unfinished;

pub use self::{
    atomic::*, checkpoint_file::*, experiment_tables::*, network_file::*, recipe_file::*, run_folder::*, samples::*,
    sensor_file::*, sweep::*, table::*, tables::*, trade_tables::*,
};
pub use crate::csv_row::{csv_cell, write_csv_row};
pub use decoupler_core::text::{format_below_one, format_duration, format_number, format_percent, format_r2};
pub use document::{DocumentError, DocumentKind};
pub use unfinished::exit_leaving_nothing;
