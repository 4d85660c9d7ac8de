//! Evaluation of decoders: errors as the paper defines them and beyond, beside baselines, a Bayesian reference and the
//! published figures.
//!
//! A [`Run`] goes from [`RunSettings`] to trained networks and error tables; [`CrossValidation`] tests on every sample;
//! [`measure_trade_off`] weighs speed against accuracy; [`experiments`] repeats runs over a grid of settings;
//! [`recorded`] says what recorded readings can tell.

mod baselines;
mod cross_validation;
mod decoder_set;
mod errors;
pub mod experiments;
mod fine_tuning;
#[cfg(feature = "files")]
pub(crate) mod format;
mod frame_time;
mod further_samples;
mod known_presses;
mod machine;
mod missing_figures;
mod node_spread;
mod outlook;
mod past_networks;
mod preparation;
mod preset;
mod pressed;
mod problem;
mod published;
mod ready;
pub mod recorded;
mod reference;
mod reference_note;
mod remark;
mod run;
mod run_error;
mod run_flaw;
mod run_sets;
mod sets;
mod settings;
mod simulated_sets;
mod source;
mod spread;
mod start_trainer;
mod starts;
mod table;
mod target_errors;
mod task;
mod test_errors;
mod trade;
mod trade_level;
mod workload;

pub use baselines::{Baselines, Scores};
pub use cross_validation::{CrossValidated, CrossValidation, Effort};
pub use decoder_set::{DecoderCost, DecoderReport, DecoderSet};
pub use errors::{Errors, NodeAddress};
pub use fine_tuning::{fine_tune, press_limits};
pub use frame_time::{decoded_unit, network_frame_time};
pub use known_presses::{pressed_rows, rebased};
pub use missing_figures::MissingFigures;
pub use node_spread::node_rms_mm;
pub use outlook::{Outlook, OutlookError};
pub use past_networks::{PastNetwork, PastNetworks};
pub use preset::{Preset, PresetError};
pub use pressed::{Pressed, PressedAnswer};
pub use problem::{Channel, Problem, TargetPosition};
pub use published::{PublishedErrors, published_errors};
pub use ready::ready_settings;
pub use reference::{NoReference, reference_errors};
pub use reference_note::ReferenceNote;
pub use remark::{Cause, Remark, error_remarks};
pub use run::Run;
pub use run_error::RunError;
pub use run_flaw::RunFlaw;
pub use run_sets::RunSets;
pub use settings::{CountError, MOST_STARTS, MeasuredSettings, RunSettings, SimulatedSettings};
pub use source::{Measured, ModelSize, Simulation, Source};
pub use spread::Spread;
pub use start_trainer::StartTrainer;
pub use starts::{StartRecord, best_start};
pub use table::{ErrorBlock, ErrorMeasure, ErrorRow, ErrorTable};
pub use target_errors::TargetErrors;
pub use test_errors::TestErrors;
#[cfg(any(feature = "cli", feature = "figures"))]
pub(crate) use trade::pareto_front;
pub use trade::{TradeOffPoint, fastest_under, measure_trade_off, most_accurate_under};
pub use trade_level::{TradeOffCost, TradeOffLevel, TradeOffLimits};
pub use workload::{Workload, WorkloadTime};
