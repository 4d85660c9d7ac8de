//! What a decoupler is worth: axis errors as the paper defines them and beyond, the published figures, and a whole
//! run from settings to report.

mod decoder_set;
mod errors;
pub mod experiments;
mod frame_time;
mod node_spread;
mod outlook;
mod preset;
mod published;
mod reference;
mod run;
mod run_error;
mod settings;
mod spread;
mod start_trainer;
mod starts;
mod table;
mod task;
mod trade;
mod trade_level;

pub use decoder_set::{DecoderKind, DecoderKindError, DecoderReport, DecoderSet, Precision};
pub use errors::{Errors, NodeAddress};
pub use frame_time::network_frame_time;
pub use node_spread::node_rms_mm;
pub use outlook::{Outlook, OutlookError};
pub use preset::{Preset, PresetError};
pub use published::{PublishedErrors, published_errors};
pub use reference::reference_errors;
pub use run::{Baselines, Run};
pub use run_error::RunError;
pub use settings::{CountError, MOST_STARTS, ModelSize, RunSettings};
pub use spread::Spread;
pub use start_trainer::StartTrainer;
pub use starts::{StartRecord, best_start};
pub use table::{ErrorRow, error_rows};
pub use trade::{TradePoint, fastest_under, measure_trade, most_accurate_under, pareto_front};
pub use trade_level::{TradeCost, TradeLevel};
