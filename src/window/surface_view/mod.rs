//! Widget that shows a [`Surface`](decoupler_files::figure::surface::Surface) and lets the user rotate it.
//!
//! `view` is the widget; `painted` is the surface laid out in its card, cached until something changes.

mod painted;
mod view;

pub use painted::ColourBar;
pub use view::{SurfaceView, SurfaceViewResponse};
