//! Pressing: the user's finger on the actual surface, and what every decoder makes of it.
//!
//! `finger` is what presses, `pointer` turns mouse and keys into a [`Touch`](decoupler_core::scene::Touch) before anything of the
//! frame is drawn, and `shown` computes what there is to see of it: in that frame, or behind it for arrays that take
//! longer. `subject` finds the network that answers; until one is trained that is a small one made by `ready`.
//! `comparing` asks the other decoders in the background. The rest shows it.

mod comparing;
mod pointer;
mod section;
mod state;

pub use section::{Shown, press_section_ui, readings_head_ui, readings_ui};
pub use state::{Hand, PressState};
