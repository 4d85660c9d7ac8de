//! Figures on the screen: each is the value that is also printed. It knows no view.

mod cells;
mod colours;
mod heat_map;
mod heat_map_frame;
mod legend;
mod line_labels;
mod per_pixel;
mod plot;
mod plot_figure;
mod strip;
#[cfg(test)]
mod tests;

pub use cells::cells_ui;
pub use colours::hue_colour;
pub use heat_map::{CellPointed, heat_map_ui};
pub use legend::{legend_ui, legend_width};
pub use plot_figure::{DrawnPlot, Pointer, legend_behind_ui, plots_ui, titled_plots_ui};
pub use strip::{StripChart, strip_ui};
