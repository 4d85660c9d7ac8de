//! The window: its state and workers, what becomes of their news, and the one place where actions are applied.

mod action;
mod applying;
mod closing;
mod decoupler_window;
mod news;
mod notice;
mod open;
mod save_form;
mod status_line;
mod top_bar;

pub use action::Action;
pub use decoupler_window::DecouplerWindow;
pub use open::{OpenError, open};
