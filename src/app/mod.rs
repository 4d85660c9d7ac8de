//! The window. Its rooms stand in this order, and each uses only those before it:
//!
//! | room | what it holds |
//! |---|---|
//! | [`theme`] | colours, sizes, fonts |
//! | `widgets` | the few components that egui lacks |
//! | `plotting` | what all charts have in common |
//! | [`surface_view`] | the surface plot |
//! | `threads` | background work |
//! | `test_view` | a test set ready to be drawn |
//! | `training_worker` | the thread that trains |
//! | `shared` | what all views read: settings, training on show, run list, look; and what a view may ask for |
//! | `views` | one room each, none knows another |
//! | `window` | lays the views out and applies what they ask for |

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

pub use shared::{
    Columns, Contents, Effect, FileTask, FileWords, Look, Notice, PLACES, Phase, Preview, Purpose, RightCard, RunList,
    RunResult, RunView, Shared, View,
};
pub use test_view::{Frame, TestView};
pub use training_worker::{RunId, WriteRun};
pub use views::{
    Analysis, AnalysisError, AxisForm, AxisKind, BottomTab, CompareView, Compared, DecoderResult, DecodersState, Drawn,
    Ending, ExperimentLook, ExperimentsView, Form, FormError, Frames, IdentifiabilityView, ListError, Outcome,
    Question, Running, SortBy, Thoroughness, Topic, TradeEnding, TradeForm, TradeFormError, TradeLook, TradeOffView,
    TradeOutcome, TradePlan, TradeRunning, TrainView, Views, WhichPresets,
};
pub use window::{DecouplerWindow, DialogKind, OpenError, open};
