//! The window. Its rooms are in this order, and each uses only those before it:
//!
//! | room | what it holds |
//! |---|---|
//! | [`theme`] | colours, sizes, fonts |
//! | `glossary` | every term of the field with its definition and equation |
//! | `widgets` | the few components that egui lacks |
//! | `plotting` | what all charts have in common |
//! | [`surface_view`] | the surface plot |
//! | `job` | background work |
//! | `test_view`, `preview` | a test set ready to be drawn; what settings show before a training |
//! | `training_worker` | the thread that trains |
//! | `shared` | what all views read: settings, current training, run list, look; and what a view may ask for |
//! | `views` | one room each, none knows another |
//! | `frame` | lays the views out and applies what they ask for |

mod frame;
mod glossary;
mod job;
mod plotting;
mod preview;
mod shared;
pub mod surface_view;
mod test_view;
pub mod theme;
mod training_worker;
mod views;
mod widgets;

pub use frame::{DecouplerWindow, Desktop, OpenError, WindowFile, open};
pub use shared::{Effect, Matter, Notice, Phase, Shared, SourceKind};
pub use views::{
    Analysis, BottomTab, DecoderResult, PlannedLevel, PlannedRun, Question, TradeOffEnding, TradeOffPlan, Views,
};
