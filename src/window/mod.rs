//! The window. Its modules are listed in order of dependency; each uses only those before it:
//!
//! | module | contents |
//! |---|---|
//! | [`theme`] | colours, sizes, fonts |
//! | `glossary` | every term of the field with its definition and equation |
//! | `widgets` | components that egui lacks |
//! | `plotting` | drawing of all charts |
//! | [`surface_view`] | the surface plot |
//! | `job` | background work |
//! | `timeline` | places of the test samples of a recording on an axis of time |
//! | `test_view`, `preview` | test set ready to be drawn; preview of settings before a training |
//! | `training_worker` | the thread that trains |
//! | `shared` | state shared by all views: settings, current training, run list, appearance; and the requests of views |
//! | `forms` | fields of sensor, scene, network and training, for every view and both sources |
//! | `views` | one module per view, independent of each other |
//! | `frame` | layout of the views, and handling of their requests |

mod forms;
mod frame;
mod glossary;
mod job;
mod plotting;
mod preview;
mod shared;
pub mod surface_view;
mod test_view;
pub mod theme;
mod timeline;
mod training_worker;
mod views;
mod widgets;

pub use frame::{DecouplerWindow, Desktop, OpenError, WindowFile, open};
pub use shared::{Command, Effect, Matter, Notice, Phase, Shared, SourceKind};
pub use views::{DecoderResult, Views};
