//! Figures on the screen, drawn from the same description as printed figures. Independent of the views.
//!
//! `plot` hands plots to `egui_plot`, `series` those of values over time; `paint` paints the shapes of which everything else is
//! made, such as heat maps.

mod heat_map;
mod paint;
mod plot;
mod series;
#[cfg(test)]
mod tests;

pub use heat_map::cells_ui;
pub use paint::{bounds, colour, measure, paint, to_egui, to_glam};
pub use plot::{plots_ui, titled_plots_ui};
pub use series::{MAX_TRACKS, SeriesView};
