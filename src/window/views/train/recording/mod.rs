//! Recordings as the source of a training: their files, the meaning of their columns, and the division of their samples.
//!
//! [`editor`] owns the import. [`opening`] reads files in the background; a [`draft`] holds the choices of the user, which
//! [`checking`] tries out whenever they change; [`missing`] describes files that are not where they were.

mod checking;
mod column_cells;
mod columns_card;
mod columns_table;
mod draft;
mod editor;
mod exports;
mod files_section;
mod histogram;
mod import_folds;
mod layout_form;
mod missing;
mod opening;
mod planned;
mod positions_form;
mod remarks;
mod renaming;
mod sample;

pub use editor::RecordingEditor;
pub use exports::recipe_export;
pub(super) use remarks::bias;
