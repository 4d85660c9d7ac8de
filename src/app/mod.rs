//! The window: state, actions, a worker thread, panels and theme.
//!
//! Panels read [`State`] and return [`Action`]s; [`DecouplerWindow`] applies them. The worker
//! draws samples, trains and writes files on a thread of its own and wakes the window with events, so the window
//! never blocks and asks for no repaint while nothing changes.

mod action;
mod charts;
mod continuation;
mod dialogs;
mod export_kind;
mod file_task;
mod open;
mod panels;
mod shortcuts;
mod state;
pub mod surface_view;
mod test_view;
pub mod theme;
mod ticks;
mod window;
mod worker;

pub use action::Action;
pub use dialogs::DialogKind;
pub use export_kind::ExportKind;
pub use file_task::FileTask;
pub use open::{OpenError, open};
pub use state::{BottomTab, Frames, Look, Notice, Phase, Preview, RightCard, RunResult, RunView, Saving, State};
pub use test_view::{Frame, TestView};
pub use window::DecouplerWindow;
