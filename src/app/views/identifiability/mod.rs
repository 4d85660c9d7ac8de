//! The Identifiability view: what the readings of an array can tell at all, before anything is trained. A thread of its
//! own computes it anew as the geometry changes.

mod action;
mod analysis;
mod facts;
mod form;
mod news;
mod singular_values;
mod state;
mod view;
mod worker;

pub use action::IdentifiabilityAction;
pub use analysis::{Analysis, AnalysisError, Question};
pub use form::form_ui;
pub use news::{apply, enter, take_news};
pub use state::IdentifiabilityState;
pub use view::{identifiability_ui, status_ui};
pub use worker::IdentifiabilityWorker;
