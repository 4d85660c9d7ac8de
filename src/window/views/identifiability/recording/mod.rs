//! What the readings of a recording determine, measured by cross-validation in the background.

mod study;
mod view;

pub use study::RecordingStudy;
pub use view::{body_ui, form_ui, offer_actions, shown, status};
