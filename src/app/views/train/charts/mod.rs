//! The charts below the surfaces, one a file.

mod ceiling;
mod error_histogram;
mod loss;
mod nodes;
mod regression;
mod stages;
mod tab;
mod training_state;

pub use ceiling::{drawn_parameter, highest_gradient, highest_mse};
pub use error_histogram::{error_histogram_ui, histogram};
pub use loss::{loss_keys, loss_ui};
pub use nodes::{nodes_keys, nodes_ui};
pub use regression::{regression_keys, regression_ui};
pub use stages::parameter_name;
pub use tab::BottomTab;
pub use training_state::{training_state_keys, training_state_ui};
