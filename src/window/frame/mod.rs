//! The window: it lays out the views, handles the events of the training and of files, and applies the effects requested
//! by views in one place.

mod applying;
mod closing;
mod commands;
mod events;
mod export_dialog;
mod files;
mod help;
mod modal;
mod notices;
#[cfg(test)]
mod panics;
mod remembered;
mod save_form;
#[cfg(test)]
mod tests;
mod top_bar;
mod window;

pub use files::{OpenError, open};
pub use remembered::WindowFile;
pub use window::{DecouplerWindow, Desktop};
