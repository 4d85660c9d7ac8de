//! The Sensor view: what the readings of a simulated array determine, computed from its model as the geometry changes.

mod analysis;
mod array_view;
mod state;
mod view;

pub use analysis::{Analysis, Question};
pub use state::IdentifiabilityView;
