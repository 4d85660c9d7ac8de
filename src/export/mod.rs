//! Files for later and for other programs: the network file, CSV tables, and the one way in which anything is written.

mod atomic;
mod checkpoint_file;
mod experiment_tables;
mod format;
mod heading;
mod network_file;
mod samples;
mod soundness;
mod tables;
mod unfinished;

pub use atomic::{AtomicFile, WriteError, atomic_write, check_writable};
pub use checkpoint_file::{CheckpointFile, CheckpointFileError};
pub use experiment_tables::{ExperimentTable, write_cells, write_experiment_markdown, write_trials};
pub use format::{format_duration, format_number, format_percent};
pub use network_file::{NetworkFile, NetworkFileError, TrainingRecord};
pub use samples::{write_coordinates_header, write_numbers, write_samples, write_samples_header};
pub use tables::{write_errors, write_loss_curves};
pub use unfinished::exit_leaving_nothing;
