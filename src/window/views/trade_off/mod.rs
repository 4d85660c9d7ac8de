//! The Trade-off view: error against time of every decoder, measured on this machine, on a recording or on a simulated
//! array at several noise levels. The measurement runs in the background.

mod chart;
mod form;
mod state;
mod view;

pub use form::{Thoroughness, TradeOffForm, WhichPresets};
use state::PointWish;
pub use state::{PlannedLevel, PlannedRun, TradeOffEnding, TradeOffLook, TradeOffOutcome, TradeOffPlan, TradeOffView};
