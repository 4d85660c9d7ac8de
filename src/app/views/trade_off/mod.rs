//! The Trade-off view: every way of decoding measured on this machine, its error against its time, at several levels of
//! noise. A thread of its own measures while the window stays free.

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

pub use form::{Thoroughness, TradeOffForm, TradeOffFormError, WhichPresets};
pub use plan::TradeOffPlan;
pub use state::{TradeOffEnding, TradeOffLook, TradeOffOutcome, TradeOffView};
