//! Evaluation of decoders: errors as the paper defines them and beyond, next to baselines, a decoder that knows the
//! sensor model, and the published figures.
//!
//! A [`Run`] goes from [`RunSettings`] to trained networks and error tables; [`CrossValidation`] tests on every sample;
//! [`auto`] chooses settings by cross-validation; [`measure_trade_off`] compares speed with accuracy; [`experiments`] repeats runs over a grid of settings;
//! [`recorded`] measures how well recorded readings determine the targets.

pub mod auto;
mod baselines;
mod cross_validation;
mod decoder_set;
mod errors;
pub mod experiments;
mod fine_tuning;
mod intervals;
mod preparation;
pub mod recorded;
mod remark;
mod run;
mod run_sets;
mod settings;
mod starts;
mod table;
mod trade;
mod workload;

pub use baselines::{Baselines, PublishedErrors, Scores, published_errors};
pub use cross_validation::{CrossValidated, CrossValidation};
pub use decoder_set::{DecoderReport, DecoderSet};
pub use errors::{Errors, NodeAddress, Spread, TargetErrors, TestErrors, node_rms_mm};
pub use fine_tuning::fine_tune;
pub use intervals::{Coverage, HalfWidth, Intervals};
pub use remark::error_remarks;
pub use run::{Run, RunError};
pub use run_sets::RunSets;
pub use settings::{Combination, Initialization, MAX_STARTS, Preset, RunSettings, Source};
pub use starts::{StartRecord, StartTrainer, best_start};
pub use table::{ErrorMeasure, ErrorRow, ErrorTable, decoded_unit, frame_us};
pub use trade::{Outlook, TradeOffPoint, fastest_under, measure_trade_off, most_accurate_under, pareto_front};
pub use workload::{TrainingSize, Workload};
