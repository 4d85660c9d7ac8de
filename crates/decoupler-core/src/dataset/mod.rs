//! Samples for training and testing. A sample is one row-wire at one moment: its readings, its targets, its row-wire
//! and the snapshot it belongs to.
//!
//! Simulated samples are drawn as whole snapshots, with resistances as readings and the absolute coordinates of the
//! row's nodes as targets; measured samples are built from their parts by [`Dataset::new`]. [`Division`]
//! and [`Folds`] divide a set, and [`Dataset::frames`] groups it into whole frames. A [`Memory`] adds inputs from
//! the past, which it takes from the [`History`] of a recording or from a [`MemoryStream`]; one rule decides in both
//! which rows continue each other.

mod continuation;
mod division;
mod error;
mod folds;
mod frames;
mod history;
mod memory;
mod samples;
mod seed;
mod simulation;

pub use continuation::{GAP, Place, RowOrder, Series};
pub use division::{DividedSamples, Division, Split, SplitBy};
pub use error::DatasetError;
pub use folds::Folds;
pub use frames::PerRow;
pub use history::{History, MemoryStream};
pub use memory::{LARGEST_LAG, Memory, MemoryConstants, Span};
pub use samples::{Dataset, LARGEST_SAMPLES};
pub use seed::{Seed, Stream};
pub use simulation::Simulation;
