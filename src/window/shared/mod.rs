//! State shared by all views (the settings, the current training, the run list, the look of surfaces) and the effects
//! that a view may ask for.

mod colour_scale;
mod decoder_exports;
mod effect;
mod error_table;
mod export;
mod file_in_use;
mod file_task;
mod look;
mod network_exports;
mod notice;
mod offers;
mod opening;
mod run_buttons;
mod run_list;
mod run_view;
mod sentence;
mod state;
mod surfaces;
mod target_choice;
mod training_form;
mod training_status;
mod unfinished;
mod view;

pub use super::training_worker::RunResult;
pub use colour_scale::colour_scale_ui;
pub use decoder_exports::{DecoderSource, decoder_export_ui, decoder_forms_ui};
pub use effect::Effect;
pub use error_table::error_table_ui;
pub use export::{
    Ask, Export, ExportGroup, copy_exports, csv_export, error_table_export, loss_export, picture_exports,
};
pub use file_in_use::{FileInUse, refuse_in_use};
pub use file_task::{Contents, FileTask, FileWords, Purpose};
pub use look::{Look, RightCard};
pub use network_exports::{NetworkSource, file_stem, network_exports};
pub use notice::{Matter, Notice};
pub use offers::{Action, Offers};
pub use opening::opening_settings;
pub use run_buttons::{RunWish, run_buttons_ui};
pub use run_list::{PLACES, RunList, RunsWorker};
pub use run_view::RunView;
pub use sentence::sentence;
pub use state::{Phase, Preview, RecordingDraft, Shared, SourceKind};
pub use surfaces::{follow_surface, view_mode_ui};
pub use target_choice::target_choice_ui;
pub use training_form::{method_choice_ui, method_settings_ui, stopping_ui};

use training_status::training_status_ui;
pub use unfinished::Unfinished;
pub use view::{Columns, View};
