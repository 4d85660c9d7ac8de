//! The Sensor view: the simulated array of the Train view, and what its readings determine, computed from the model as
//! the settings change.

mod analysis;
mod figures;
mod view;

use analysis::Analysis;
pub use view::SensorView;
