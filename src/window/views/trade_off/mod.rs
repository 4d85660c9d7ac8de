//! The Trade-off view: every decoder measured on this machine, its error against its time, on a recording or on a simulated
//! array at several levels of noise. A thread of its own measures while the window stays free.

mod chart;
mod form;
mod state;
mod view;

pub use form::{Thoroughness, TradeOffForm, WhichPresets};
use state::PointWish;
pub use state::{PlannedLevel, PlannedRun, TradeOffEnding, TradeOffLook, TradeOffOutcome, TradeOffPlan, TradeOffView};
