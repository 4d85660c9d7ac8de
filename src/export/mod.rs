//! Files for later and for other programs: network files, checkpoints, CSV tables, figures (feature `figures`), and the
//! one way in which all of them are written: whole or not at all.

mod atomic;
#[cfg(feature = "bundle")]
pub mod bundle;
mod checkpoint_file;
#[cfg(feature = "figures")]
mod experiment_figure;
#[cfg(feature = "figures")]
pub(crate) mod experiment_points;
mod experiment_tables;
mod experiment_words;
#[cfg(feature = "figures")]
pub mod figures;
mod format;
mod heading;
mod limited;
mod network_document;
mod network_file;
mod samples;
mod sealed;
mod soundness;
mod tables;
#[cfg(feature = "figures")]
pub(crate) mod ticks;
mod trade_file;
#[cfg(feature = "figures")]
mod trade_plot;
mod unfinished;
mod workload_words;
mod workspace_file;

pub use atomic::{AtomicFile, WriteError, atomic_write, check_writable};
pub use checkpoint_file::{CheckpointFile, CheckpointFileError};
#[cfg(feature = "figures")]
pub use experiment_figure::draw_experiment;
pub use experiment_tables::{ExperimentTable, write_cells, write_experiment_markdown, write_trials};
pub use experiment_words::{describe_conditions, describe_failures, describe_worse_than_mean};
pub use format::{format_duration, format_number, format_percent};
pub use network_file::{NetworkFile, NetworkFileError, TrainingRecord};
#[cfg(feature = "cli")]
pub(crate) use samples::{write_decoded, write_decoded_header};
pub use samples::{write_samples, write_samples_header};
pub use tables::{write_errors, write_loss_curves};
pub use trade_file::write_trade;
#[cfg(feature = "figures")]
pub use trade_plot::trade_plot;
#[cfg(feature = "cli")]
pub(crate) use unfinished::exit_leaving_nothing;
pub use workload_words::describe_workload;
pub use workspace_file::{FoundWorkspace, KeptRun, Workspace, WorkspaceError};
