//! State shared by all views (the settings, the current training, the run list, the look of surfaces) and the effects
//! that a view may ask for.

mod command;
mod effect;
mod error_table;
mod export;
mod look;
mod offers;
mod run_list;
mod run_view;
mod state;
mod view;

pub use super::training_worker::{OpenPlan, RunResult, RunView};
pub use command::{About, Command, Offer, Offers, command_button_ui};
pub use effect::{Effect, Matter, Notice};
pub use error_table::{error_table_ui, targets_table_ui};
pub use export::{
    ExportLine, Exporting, FileTask, FileWords, Format, Item, NetworkSource, Purpose, Shown, ToCopy, file_stem,
    saying_saved,
};
pub use look::{
    Look, RightCard, card_head_ui, surface_cards_ui, surface_ui, surfaces_above_ui, target_choice_ui, view_mode_ui,
};
pub use offers::{FileInUse, refuse_in_use};
pub use run_list::{LoadedRun, PLACES, RunList, RunsRequest, RunsWorker};
pub use run_view::{run_buttons_ui, sentence, training_status};
pub use state::{Phase, Preview, RecordingDraft, Shared, SourceKind, opening_settings};
pub use view::{Holdings, Status, Tone, Unfinished, View, ViewKind};
