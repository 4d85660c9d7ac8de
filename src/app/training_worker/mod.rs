//! The worker: one named thread that draws sets, trains and writes files. Requests go in, events come out, and each
//! event wakes the window.

mod continuation;
mod handle;
mod labour;
mod message;

pub use handle::Worker;
pub use message::{Began, Event, Progress, Request, RunId, RunResult, WriteRun};
