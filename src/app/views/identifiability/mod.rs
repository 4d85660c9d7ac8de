//! The Identifiability view: what the readings of an array can tell at all, before anything is trained. A thread of its
//! own computes it anew as the geometry changes.

mod analysis;
mod facts;
mod form;
mod state;
mod view;
mod worker;

pub use analysis::{Analysis, Question};
pub use state::IdentifiabilityView;
