//! Samples for training and testing. One sample is one row-wire at one moment: its readings, its targets, which row-wire
//! it is of and which snapshot it belongs to. Simulated samples are resistances and the absolute coordinates of the
//! row's nodes, drawn as whole snapshots; measured ones are built from their parts by [`Dataset::new`].

mod folds;
mod frames;
mod per_row;
mod resistance_reader;
mod samples;
mod seed;
mod simulation;
mod split;

pub use folds::{FoldUnit, Folds, FoldsError};
pub use frames::{Frames, FramesError};
pub use per_row::PerRow;
pub use resistance_reader::{ReadError, Reading, ResistanceReader};
pub use samples::{Dataset, DatasetError, LARGEST_SAMPLES};
pub use seed::{Seed, Stream};
pub use simulation::SimulationError;
pub use split::{Split, hold_out};
