//! The surface plot: a height field in space or from above, projected on the CPU into one `egui::Mesh`.
//!
//! `view` is the widget. It shows a `drawing`, which is kept for as long as nothing in it changes. The drawing asks
//! [`camera`](OrbitCamera) and `projection` where things lie, lets `axes` or `plan` lay out the frame with its ticks,
//! `mesh` paint the surface with the lines of `contour` from far to near, and `nodes` put the dots on it.

mod axes;
mod camera;
mod colour_bar;
mod contour;
mod drawing;
mod edge;
mod labels;
mod mesh;
mod nodes;
mod plan;
mod projection;
mod ribbon;
mod view;

pub use camera::OrbitCamera;
pub use colour_bar::ColourBar;
pub use view::{Colours, SurfaceView, SurfaceViewResponse, ViewMode};
