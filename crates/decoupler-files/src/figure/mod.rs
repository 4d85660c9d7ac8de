//! Figures as values: what a picture says, not how it is drawn.
//!
//! A [`Figure`] is described once by a function that knows the data, such as [`loss_figure`]. The window draws it with its
//! theme and shows the same words under the pointer; [`crate::export::figures`] draws it as SVG and PNG. Values that are
//! not finite are left out.

mod axis;
mod colour_map;
mod heat_map;
mod look;
mod of_epochs;
mod of_errors;
mod of_experiment;
mod of_learning;
mod of_live;
mod of_nodes;
mod of_recorded;
mod of_sample;
mod of_section;
mod of_targets;
mod of_trade_off;
mod plot;
mod regression;
mod summary;
pub mod surface;

pub use axis::{AxisScale, PlotAxis, TickRule, Ticks, multiples, share, step_for, tick_text};
pub use colour_map::{ColourMap, Rgb, SequentialMap, is_light};
pub use heat_map::HeatMap;
pub use look::{Hue, Key, LineStyle, Look, Marker};
pub use of_epochs::{EpochOutline, compared_losses_figure, loss_figure, training_state_figure};
pub use of_errors::{ErrorBins, error_histogram_figure, pair_sample, target_histogram_figure, target_pairs};
pub use of_experiment::experiment_figure;
pub use of_learning::learning_curve_figure;
pub use of_live::{readings_figure, targets_over_time_figure, zero_gains_figure};
pub use of_nodes::{node_figure, pair_address, z_pairs_mm};
pub use of_recorded::position_error_map;
pub use of_sample::{sample_figure, singular_values_figure};
pub use of_section::{SectionNodes, section_figure};
pub use of_targets::TargetSurface;
pub use of_trade_off::{frame_time, point_facts, point_name, trade_off_figure, training_time};
pub use plot::{LineAt, Plot, PlotFigure, PlotPoint, PointLabel, ReferenceLine, Series, Span, along, place_labels};
pub use regression::{RegressionLine, regression_figure, target_regression_figure};

use surface::SurfaceFigure;

/// Any picture.
#[derive(Clone, Debug)]
pub enum Figure {
    /// Plots side by side.
    Plots(PlotFigure),
    /// Values over two axes.
    HeatMap(Box<HeatMap>),
    /// Surfaces side by side.
    Surfaces(SurfaceFigure),
}

impl From<PlotFigure> for Figure {
    fn from(plots: PlotFigure) -> Self {
        Self::Plots(plots)
    }
}

impl From<HeatMap> for Figure {
    fn from(map: HeatMap) -> Self {
        Self::HeatMap(Box::new(map))
    }
}

impl From<SurfaceFigure> for Figure {
    fn from(surfaces: SurfaceFigure) -> Self {
        Self::Surfaces(surfaces)
    }
}
