//! The Trade-off view: every decoder measured on this machine, its error against its time, on a recording or on a simulated
//! array at several levels of noise. A thread of its own measures while the window stays free.

mod chart;
mod choices;
mod exports;
mod form;
mod names;
mod panel;
mod plan;
mod state;
mod table;
mod view;
mod worker;

pub use form::{Thoroughness, TradeOffForm, WhichPresets};
pub use plan::{PlannedLevel, PlannedRun, TradeOffPlan};
use state::PointWish;
pub use state::{TradeOffEnding, TradeOffLook, TradeOffOutcome, TradeOffView};
