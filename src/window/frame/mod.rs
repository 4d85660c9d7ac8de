//! The window: it lays the views out, hears the events of the training and of files, and applies in one place what views
//! ask for.

mod actions;
mod applying;
mod clipboard;
mod closing;
mod columns;
mod copying;
mod decoupler_window;
mod desktop;
mod dialogs;
mod dropping;
mod events;
mod export_menu;
mod files;
mod frames;
mod help;
mod interface_scale;
mod memory;
mod notice;
mod notices;
mod open;
mod palette;
mod path_look;
mod remembered;
mod save_form;
#[cfg(test)]
mod tests;
mod top_bar;
mod tour;
mod undoing;

pub use decoupler_window::DecouplerWindow;
pub use desktop::Desktop;
pub use open::{OpenError, open};
pub use remembered::WindowFile;
