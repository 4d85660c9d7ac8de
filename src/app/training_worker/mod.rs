//! The worker: one named thread that draws sets, trains and writes files. Requests go in, events come out, and each
//! event wakes the window.

mod continuation;
mod export_kind;
mod handle;
mod labour;
mod message;

pub use export_kind::{ExportKind, file_name};
pub use handle::Worker;
pub use labour::LOST;
pub use message::{Began, Event, Progress, Request, RunResult, append_epochs};
