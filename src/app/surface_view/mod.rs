//! The surface plot: a height field in space or from above, projected on the CPU into one `egui::Mesh`.
//!
//! `view` is the widget. It asks [`camera`](OrbitCamera) and `projection` where things lie, lets `axes` or `plan`
//! lay out the frame with its ticks, `mesh` paint the surface with the lines of `contour` from far to near, and `nodes`
//! put the dots on it.

mod axes;
mod camera;
mod colour_bar;
mod contour;
mod edge;
mod labels;
mod mesh;
mod nodes;
mod plan;
mod projection;
mod ribbon;
mod ticks;
mod view;

pub use camera::OrbitCamera;
pub use colour_bar::ColourBar;
pub use view::{Colours, SurfaceView, SurfaceViewResponse, ViewMode};
