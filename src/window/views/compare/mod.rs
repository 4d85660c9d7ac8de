//! The Compare view: the run list, and two of its runs side by side.

mod exports;
mod figures_table;
mod list;
mod scene_words;
mod state;
mod view;

pub use state::{CompareView, Compared};
