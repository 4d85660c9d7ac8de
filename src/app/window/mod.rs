//! The window: it lays the views out, hears the news of the training and of files, and applies in one place what views
//! ask for.

mod applying;
mod closing;
mod decoupler_window;
mod dialogs;
mod files;
mod news;
mod notice;
mod open;
mod save_form;
mod top_bar;

pub use decoupler_window::DecouplerWindow;
pub use dialogs::DialogKind;
pub use open::{OpenError, open};
