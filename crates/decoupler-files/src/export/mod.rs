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
mod checkpointing;
mod document;
mod experiment_tables;
pub mod figures;
mod network_file;
mod recipe_file;
pub mod report;
mod run_folder;
mod samples;
mod saved_problem;
mod search_table;
mod sensor_file;
mod sweep;
mod table;
mod tables;
#[cfg(test)]
mod test_folder;
mod trade_tables;
mod unfinished;

pub use atomic::{AtomicFile, WriteError, atomic_write, check_writable, is_same};
pub use checkpoint_file::CheckpointFile;
pub use checkpointing::{CheckpointPlace, Checkpointing};
pub use decoupler_core::text::{format_below_one, format_duration, format_number, format_percent, format_r2};
pub use document::{DocumentError, DocumentKind};
pub use experiment_tables::{
    ExperimentColumn, ExperimentColumnKind, ExperimentTable, cells_table, describe_conditions, describe_failures,
    describe_worse_than_mean, trials_table, write_experiment_markdown,
};
pub use network_file::{NetworkFile, PastNetwork};
pub use recipe_file::{RecipeFile, RecipeSource};
pub use run_folder::{KeptRun, KeptRuns, RunFolder, RunSummary};
pub use samples::{TrainingRecord, write_decoded, write_decoded_header, write_samples, write_samples_header};
pub use saved_problem::SavedProblem;
pub use search_table::{describe_search, search_table};
pub use sensor_file::SensorFile;
pub use sweep::{
    MergedSweep, SweepFiles, SweepFolderError, SweepRow, SweepTableFormat, Trial, TrialId, TrialOptions,
    decoders_in_order, recording_options, sweep_specification, train_options,
};
pub use table::{Cell, Table, TableColumn, TableForm, csv_cell, write_csv_row};
pub use tables::{
    decoder_table, describe_coverage, describe_determinacy, describe_half_widths, describe_positions, describe_samples,
    describe_target, describe_warnings, describe_worse_than_ridge, error_table, write_loss_curves,
};
pub use trade_tables::{describe_recorded_workload, describe_workload, trade_off_points, trade_off_summary};
pub use unfinished::exit_leaving_nothing;
