//! Figures on the screen: each is the value that is also printed. It knows no view.

mod cells;
mod heat_map;
mod legend;
mod plot;
mod plot_figure;
#[cfg(test)]
mod tests;

pub use cells::{cells_ui, hue_colour};
pub use heat_map::{CellPointed, heat_map_ui};
pub use legend::{legend_ui, legend_width};
pub use plot_figure::{DrawnPlot, Pointer, StripChart, legend_behind_ui, plots_ui, strip_ui, titled_plots_ui};
