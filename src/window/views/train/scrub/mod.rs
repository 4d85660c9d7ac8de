//! Scrubbing: the networks of past epochs, brought back by a slider under the loss curves or replayed one after the
//! other. What they make of the test set is computed in the background, the newest wish first.

mod state;

pub(super) use state::HEIGHT;
pub use state::{ScrubState, scrub_bar_ui};
