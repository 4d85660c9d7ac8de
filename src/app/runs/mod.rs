//! The run list and the Compare view: every finished training is kept, two are shown side by side, and all of it
//! survives a restart. A thread of its own keeps the folder of the runs, writes the pictures, and prepares what is to be
//! drawn.

mod action;
mod curves;
mod figures_table;
mod list;
mod news;
mod scene_words;
mod state;
mod view;
mod worker;

pub use action::RunsAction;
pub(super) use list::run_list_ui;
pub(super) use news::{apply, keep, take_news};
pub use state::{Compared, PLACES, RunsState};
pub(super) use view::compare_ui;
pub(super) use worker::{RunsRequest, RunsWorker};
