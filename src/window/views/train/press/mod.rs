//! Pressing: the user's finger on the actual surface, and the answers of all decoders.
//!
//! `state` holds the finger and its [`Touch`], and has the touch answered in the same frame,
//! or in the background for large arrays. `pointer` turns mouse and keys into a touch before anything of the frame is
//! drawn, and trains a small network (`ready_settings`) that answers until there is another. `comparing` asks the other
//! decoders in the background. `pressed` is the touched sensor with its readings. `section` computes and shows the answers.

mod comparing;
mod pointer;
mod pressed;
mod ready_settings;
mod section;
mod state;
mod touch;

pub use section::{Shown, press_section_ui, readings_head_ui, readings_ui};
pub use state::{Hand, PressState};
pub use touch::Touch;
