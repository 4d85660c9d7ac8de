//! The Own data view: recordings out of files, what their columns mean, and networks trained on them.
//!
//! [`opening`] reads files in the background; a [`draft`] says what is to be made of them, which [`checking`] tries out
//! whenever it changes; [`training`] makes networks of it, and
//! [`judging`] finds out what the readings tell.

mod charts;
mod checking;
mod column_cells;
mod columns_table;
mod curves;
mod draft;
mod error_table;
mod exports;
mod form;
mod histogram;
mod import_form;
mod judging;
mod keeping;
mod layout_form;
mod model;
mod news;
mod opening;
mod planned;
mod positions_form;
mod remarks;
mod renaming;
mod report;
mod results;
mod runs;
mod runs_table;
mod state;
mod status;
mod surfaces;
mod tools;
mod training;
mod view;

pub use state::OwnDataView;
