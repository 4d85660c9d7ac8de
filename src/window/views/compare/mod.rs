//! The Compare view: the run list, and two of its runs side by side.

mod state;
mod view;

pub use state::{CompareView, Compared};
