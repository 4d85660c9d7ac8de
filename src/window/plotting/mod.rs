//! Figures on the screen, drawn from the same description as printed figures. Independent of the views.

mod heat_map;
mod plot;
mod plot_figure;
#[cfg(test)]
mod tests;

pub use heat_map::{CellPointed, cells_ui, heat_map_ui, hue_colour};
pub use plot::{legend_ui, legend_width};
pub use plot_figure::{DrawnPlot, Pointer, StripChart, legend_behind_ui, plots_ui, strip_ui, titled_plots_ui};
