//! The Identifiability view: what the readings determine. For a simulated array it is computed from the model as the
//! geometry changes; for a recording, `recording` measures it by cross-validation on request.

mod analysis;
mod array_view;
mod recording;
mod state;
mod view;

pub use analysis::{Analysis, Question};
pub use state::IdentifiabilityView;
