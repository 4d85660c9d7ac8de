//! Components that egui lacks, independent of the views.

mod components;
pub mod fields;
mod quantity_text;
mod table;

pub use components::{
    card_ui, coloured_fact_ui, dim_ui, explained_options_ui, fact_ui, focus_ring_ui, fold_ui, ghost_button, hinted,
    invitation_ui, neighbours, note_ui, placeholder_ui, primary_button, progress_bar_ui, scrolled_ui,
    section_heading_ui, segmented_ui, snapshot_ui, tabs_ui,
};
pub use fields::{slider_ui, text_ui};
pub use table::{ColumnWidth, SortBy, TableCell, TableClick, TableColumn, TableRow, TableView, described_table_ui};
