//! What the readings of a recording determine, measured by cross-validation on a thread of its own.

mod exports;
mod form;
mod study;
mod view;

pub use exports::study_exports;
pub use form::form_ui;
pub use study::RecordingStudy;
pub use view::{body_ui, offer_actions, status_ui};
