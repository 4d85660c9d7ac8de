//! The widget that shows a [`Surface`](decoupler_files::figure::surface::Surface) and lets the user turn it.
//!
//! `view` is the widget, `painted` what it paints: the surface as laid out in its card, kept for as long as nothing in it
//! changes.

mod painted;
mod view;

pub use painted::ColourBar;
pub use view::{SurfaceView, SurfaceViewResponse};
