//! Samples for training and testing. One sample is one row-wire at one moment: its M4 resistances, and the 3·M2
//! absolute coordinates of its nodes. Samples are drawn as whole snapshots of M1 rows.

mod folds;
mod resistance_reader;
mod samples;
mod seed;
mod split;

pub use folds::{FoldUnit, Folds, FoldsError};
pub use resistance_reader::{ReadError, Reading, ResistanceReader};
pub use samples::{Dataset, DatasetError, LARGEST_SAMPLES};
pub use seed::{Seed, Stream};
pub use split::{Split, hold_out};
