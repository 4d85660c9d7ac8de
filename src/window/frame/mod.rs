//! The window: it lays out the views, handles the events of the training and of files, and applies the effects requested
//! by views in one place.

mod actions;
mod applying;
mod clipboard;
mod closing;
mod decoupler_window;
mod events;
mod export_dialog;
mod files;
mod help;
mod notices;
#[cfg(test)]
mod panics;
mod remembered;
mod save_form;
#[cfg(test)]
mod tests;
mod top_bar;
mod tour;

pub use decoupler_window::{DecouplerWindow, Desktop};
pub use files::{OpenError, open};
pub use remembered::WindowFile;
