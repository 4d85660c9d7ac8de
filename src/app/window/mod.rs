//! The window: its state and workers, what becomes of their news, and the one place where actions are applied.

mod applying;
mod decoupler_window;
mod news;

pub use decoupler_window::DecouplerWindow;
