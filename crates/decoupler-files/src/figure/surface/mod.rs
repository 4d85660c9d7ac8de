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
mod colour_scale;
mod contour;
mod cut;
mod drawing;
mod edge;
mod field;
mod labels;
mod light;
mod mesh;
mod nodes;
mod pick;
mod plan_axes;
mod plateau;
mod projection;
mod quantity;
mod section;
mod shapes;
mod sight;
mod stage;
mod surface_figure;
mod vertices;

pub use camera::OrbitCamera;
pub use colour_scale::{ColourScale, ScaleDrawing};
pub use drawing::{Card, Drawing};
pub use mesh::{ContourLine, Mesh};
pub use nodes::Dots;
pub use quantity::Quantity;
pub use section::{Section, SectionLine};
pub use shapes::{Bounds, Disc, Ink, Line, Text};
pub use sight::{AboveSight, EyeSight, Ray, Sight};
pub use surface_figure::{Surface, SurfaceFigure, ViewMode};
pub use vertices::Vertex;
