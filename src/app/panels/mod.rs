//! The parts of the window. Each reads the state and returns what the user meant.

mod charts_card;
mod configuration;
mod fields;
mod notice;
mod report;
mod save_form;
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
pub use top_bar::top_bar_ui;
pub use workbench::{WorkbenchLayout, workbench_ui};
