//! Files for later and for other programs: the network file, CSV tables, figures, and the one way in which anything is
//! written.

mod atomic;
mod checkpoint_file;
mod experiment_figure;
pub(crate) mod experiment_points;
mod experiment_tables;
mod experiment_words;
pub mod figures;
mod format;
mod heading;
mod network_file;
mod samples;
mod soundness;
mod tables;
pub(crate) mod ticks;
mod trade_file;
mod unfinished;
mod workspace_file;

pub use atomic::{AtomicFile, WriteError, atomic_write, check_writable};
pub use checkpoint_file::{CheckpointFile, CheckpointFileError};
pub use experiment_figure::draw_experiment;
pub use experiment_tables::{ExperimentTable, write_cells, write_experiment_markdown, write_trials};
pub use experiment_words::{describe_conditions, describe_failures};
pub use format::{format_duration, format_number, format_percent};
pub use network_file::{NetworkFile, NetworkFileError, TrainingRecord};
pub use samples::{write_coordinates_header, write_numbers, write_samples, write_samples_header};
pub use tables::{write_errors, write_loss_curves};
pub use trade_file::{trade_plot, write_trade};
pub use unfinished::exit_leaving_nothing;
pub use workspace_file::{FoundWorkspace, KeptRun, Workspace, WorkspaceError};
