//! The Compare view: the run list, and two of its runs side by side.

mod action;
mod curves;
mod figures_table;
mod list;
mod scene_words;
mod view;

pub use action::RunsAction;
pub use list::run_list_ui;
pub use view::compare_ui;
