//! The charts below the surfaces, one a file.

mod error_histogram;
mod loss;
mod nodes;
mod plot_style;
mod regression;
mod test_pairs;
mod training_state;

pub use error_histogram::error_histogram_ui;
pub use loss::loss_ui;
pub use nodes::nodes_ui;
pub use regression::regression_ui;
pub use training_state::training_state_ui;
