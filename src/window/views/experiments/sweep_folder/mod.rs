//! A folder that `decoupler sweep` fills, on this machine or on others: its trials in a table that grows with it.

mod card;
mod state;
mod table;

pub(super) use card::{folder_card_ui, folder_form_ui};
pub(super) use state::{OpenFolder, SweepFolder};
