//! Everything the panels read: what the window shows, the training as far as it knows it, and how it is looked at.

mod look;
mod run_view;
mod window_state;

pub(super) use look::error_frame;
pub use look::{BottomTab, Frames, Look, RightCard};
pub use run_view::RunView;
pub use window_state::{Notice, Phase, Preview, Saving, State, View};

pub use super::worker::RunResult;
