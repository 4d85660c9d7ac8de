//! The window: state, actions, a worker thread, panels and theme.
//!
//! Panels read [`State`] and return [`Action`]s; [`DecouplerWindow`] applies them. The worker
//! draws samples, trains and writes files on a thread of its own and wakes the window with events, so the window
//! never blocks and asks for no repaint while nothing changes.

mod action;
mod charts;
mod continuation;
mod decoders;
mod dialogs;
mod experiments;
mod export_kind;
mod file_task;
mod identifiability;
mod job;
mod open;
mod panels;
mod paper_figure;
mod runs;
mod shortcuts;
mod shown_figure;
mod state;
pub mod surface_view;
mod test_view;
pub mod theme;
mod threads;
mod trade;
mod window;
mod worker;

use crate::export::ticks;

pub use action::Action;
pub use decoders::{DecoderResult, DecodersState};
pub use dialogs::DialogKind;
pub use experiments::{
    AxisForm, AxisKind, Ending, ExperimentAction, ExperimentFile, ExperimentsState, Form, FormError, ListError,
    Outcome, Running, SortBy, Topic,
};
pub use export_kind::ExportKind;
pub use file_task::FileTask;
pub use identifiability::{Analysis, AnalysisError, IdentifiabilityAction, IdentifiabilityState, Question};
pub use open::{OpenError, open};
pub use paper_figure::PaperFigure;
pub use runs::{Compared, PLACES, RunsAction, RunsState};
pub use shown_figure::ShownPicture;
pub use state::{BottomTab, Frames, Look, Notice, Phase, Preview, RightCard, RunResult, RunView, Saving, State, View};
pub use test_view::{Frame, TestView};
pub use trade::{
    Thoroughness, TradeAction, TradeEnding, TradeFile, TradeForm, TradeFormError, TradeLimits, TradeOutcome, TradePlan,
    TradeRunning, TradeState, WhichPresets,
};
pub use window::DecouplerWindow;
