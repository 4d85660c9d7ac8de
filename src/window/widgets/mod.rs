//! The few components that egui lacks. They know no view.

mod components;
mod fact;
pub mod fields;
mod fold;
mod landmark;
mod number_field;
mod quantity_text;
mod refusal;
mod slider;
mod snapshot;
mod table;
mod text_field;
mod value_under;

pub use components::{
    card_ui, dim_ui, explained_options_ui, ghost_button, invitation_ui, note_ui, placeholder_ui, primary_button,
    progress_bar_ui, scrolled_ui, section_heading_ui, segmented_ui, state_ui, status_progress_ui, tabs_ui,
    with_shortcut,
};
pub use fact::{coloured_fact_ui, fact_ui};
pub use fold::{focus_ring_ui, fold_ui};
pub use landmark::Landmark;
pub use number_field::{number_ui, usually};
pub use refusal::refusal_ui;
pub use slider::slider_ui;
pub use snapshot::snapshot_ui;
pub use table::{ColumnWidth, SortBy, TableCell, TableClick, TableColumn, TableRow, TableView, described_table_ui};
pub use text_field::text_ui;
pub use value_under::{claim_right_click, take_claim, take_value_under, value_under};
