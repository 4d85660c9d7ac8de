//! Figures at publication size on a light ground, as SVG and PNG, without any window.
//!
//! A plot, heat map or pair of surfaces is a value; its `draw` gives a [`Picture`], which is its SVG. The PNG is drawn
//! from that SVG with the fonts of the program, so both look alike on every machine. Values that are not finite are
//! left out.

mod canvas;
mod colour_bar;
mod colours;
mod frame;
mod heat_map;
mod nodes;
mod picture;
mod plot;
mod plot_axis;
mod surfaces;

pub use colours::Hue;
pub use heat_map::HeatMap;
pub use nodes::node_plot;
pub use picture::{Picture, PictureError, PictureFormat};
pub use plot::{Marker, Plot, PlotPoint, Series, Span};
pub use plot_axis::{AxisScale, PlotAxis};
pub use surfaces::draw_surfaces;
