//! Recordings as the source of a training: their files, the meaning of their columns, and the division of their samples.
//!
//! [`editor`] owns the import. [`opening`] reads files in the background, and checks the import whenever it changes; a
//! [`draft`] holds the choices of the user; [`files_section`] shows the files, including missing ones.

mod columns_card;
mod columns_table;
mod draft;
mod editor;
mod files_section;
mod layout_form;
mod opening;

pub(super) use columns_card::bias;
pub use editor::RecordingEditor;
pub use files_section::recipe_task;
