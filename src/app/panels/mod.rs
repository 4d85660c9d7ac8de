//! The parts of the window. Each reads the state and returns what the user meant.

mod charts_card;
mod conditioning;
mod configuration;
pub(super) mod fields;
mod network_section;
mod noise_section;
mod notice;
mod preset_section;
mod report;
mod save_form;
mod scene_section;
mod sensor_section;
mod spread;
mod status_line;
mod surfaces;
mod table;
mod top_bar;
mod workbench;

pub use configuration::configuration_ui;
pub use notice::notice_ui;
pub use report::report_ui;
pub use save_form::save_form_ui;
pub use status_line::status_line_ui;
pub(super) use surfaces::symmetric_range_mm;
pub(super) use table::{Column, Row, table_ui};
pub use top_bar::top_bar_ui;
pub use workbench::{WorkbenchLayout, workbench_ui};
