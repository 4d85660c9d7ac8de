//! What all charts have in common: axes, marks, legends. It knows no view.

mod legend;
pub mod plot_style;
mod strip;

pub use legend::{Key, Mark, legend_ui, legend_width};
pub use strip::{StripChart, strip_ui};
