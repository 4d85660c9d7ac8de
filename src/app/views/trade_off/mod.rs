//! The Trade-off view: every way of decoding measured on this machine, its error against its time, at several levels of
//! noise. A thread of its own measures while the window stays free.

mod action;
mod chart;
mod choices;
mod file;
mod form;
mod names;
mod news;
mod panel;
mod plan;
mod state;
mod table;
mod view;
mod worker;

pub use action::TradeAction;
pub use file::TradeFile;
pub use form::{Thoroughness, TradeForm, TradeFormError, WhichPresets};
pub use news::{apply, pressed_shortcuts, take_news};
pub use panel::form_ui;
pub use plan::TradePlan;
pub use state::{TradeEnding, TradeLimits, TradeOutcome, TradeRunning, TradeState};
pub use view::{status_ui, trade_ui};
pub use worker::TradeEvent;
