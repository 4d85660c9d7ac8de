//! The window. Its rooms stand in this order, and each uses only those before it:
//!
//! | room | what it holds |
//! |---|---|
//! | [`theme`] | colours, sizes, fonts |
//! | `widgets` | the few components that egui lacks |
//! | `plotting` | what all charts have in common |
//! | [`surface_view`] | the surface plot |
//! | `threads`, `dialogs`, `file_task` | background work, questions for a path |
//! | `training_worker` | the thread that trains |
//! | `shared` | what all views read: settings, training on show, run list, look |
//! | `views` | one room each, none knows another |
//! | `window` | lays the views out and applies what they ask for |

mod dialogs;
mod file_task;
mod plotting;
mod shared;
pub mod surface_view;
mod test_view;
pub mod theme;
mod threads;
mod training_worker;
mod views;
mod widgets;
mod window;

use crate::figure::ticks;

pub use dialogs::DialogKind;
pub use file_task::FileTask;
pub use shared::{
    BottomTab, Compared, Frames, Look, Notice, PLACES, Phase, Preview, RightCard, RunResult, RunView, RunsState,
    Saving, State, View,
};
pub use test_view::{Frame, TestView};
pub use training_worker::ExportKind;
pub use views::{
    compare::RunsAction,
    experiments::{
        AxisForm, AxisKind, Ending, ExperimentAction, ExperimentFile, ExperimentsState, Form, FormError, ListError,
        Outcome, Running, SortBy, Topic,
    },
    identifiability::{Analysis, AnalysisError, IdentifiabilityAction, IdentifiabilityState, Question},
    trade_off::{
        Thoroughness, TradeAction, TradeEnding, TradeFile, TradeForm, TradeFormError, TradeLimits, TradeOutcome,
        TradePlan, TradeRunning, TradeState, WhichPresets,
    },
    train::{DecoderResult, DecodersState, PaperFigure, ShownPicture},
};
pub use window::{Action, DecouplerWindow, OpenError, open};
