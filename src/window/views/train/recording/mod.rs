//! Recordings as the source of a training: their files, the meaning of their columns, and the division of their samples.
//!
//! [`editor`] edits the plan of an [`import`]. In the background, [`reading`] inspects files ([`opening`]) and, whenever the plan
//! has changed, its samples ([`checking`]). [`fixes`] are offered for what is wrong with a plan. [`files_section`] and [`options`]
//! are parts of the form, [`columns_table`] and [`samples_card`] the middle of the view.

mod checking;
mod columns_table;
mod editor;
mod files_section;
mod fixes;
mod import;
mod opening;
mod options;
mod reading;
mod samples_card;

pub use editor::RecordingEditor;
pub use files_section::recipe_task;
pub use fixes::Fix;
