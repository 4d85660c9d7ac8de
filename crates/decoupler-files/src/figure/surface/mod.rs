//! Surfaces in space or from above.
//!
//! A [`SurfaceFigure`] is all that a picture of surfaces says. Each [`Surface`] of it lays itself out in a [`Card`] as a
//! [`Drawing`]: lines, texts, discs and a mesh in the order of painting, with colours by role ([`Ink`]). What is left to
//! a renderer is to paint them.
//!
//! `camera` and `projection` say where things lie; `box_axes` and `plan_axes` lay out the frame with its ticks, for which
//! `labels` finds room; `mesh` is the height field with its contour lines from far to near, `plateau` marks what lies beyond the axes; `nodes` are the dots on it. `sight` leads back from the
//! screen, and `pick` to the surface; `section` cuts it along a wire.

mod box_axes;
mod camera;
mod cut;
mod drawing;
mod field;
mod mesh;
mod nodes;
mod pick;
mod projection;
mod section;
mod shapes;
mod surface_figure;

pub use camera::{AboveSight, EyeSight, OrbitCamera, Ray, Sight};
pub use drawing::{Card, Drawing};
pub use field::{ColourScale, Quantity, ScaleDrawing};
pub use mesh::{ContourLine, Mesh, Vertex};
pub use nodes::Dots;
pub use section::{Section, SectionLine};
pub use shapes::{Bounds, Disc, Ink, Line, Text};
pub use surface_figure::{Surface, SurfaceFigure, ViewMode};
