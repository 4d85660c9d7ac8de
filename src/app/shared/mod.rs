//! What all views read: the settings, the training on show, the run list, and how all is looked at.

mod look;
pub mod run_list;
mod run_view;
mod window_state;

pub use super::training_worker::RunResult;
pub use look::{BottomTab, Frames, Look, RightCard, error_frame};
pub use run_list::{Compared, PLACES, RunsState};
pub use run_view::RunView;
pub use window_state::{Notice, Phase, Preview, Saving, State, View};
