//! The Experiments view: the paper's tables redone and sweeps of one's own, run on threads of their own while the
//! window stays free.

mod action;
mod axis_form;
mod file;
mod form;
mod heat_map;
mod news;
mod open_cell;
mod panel;
mod plots;
mod results_card;
mod state;
mod status;
mod table;
mod verdict_list;
mod view;
mod worker;

pub use action::ExperimentAction;
pub use axis_form::{AxisForm, AxisKind, ListError};
pub use file::ExperimentFile;
pub use form::{Form, FormError};
pub use news::{apply, pressed_shortcuts, take_news};
pub use panel::form_ui;
pub use state::{Ending, ExperimentsState, Outcome, Running, SortBy, Topic};
pub use status::status_ui;
pub use view::experiments_ui;
pub use worker::ExperimentEvent;
