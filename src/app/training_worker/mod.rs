//! The worker: one named thread that trains and writes files about the training. Requests go in, events come out, and each
//! event wakes the window.

mod continuation;
mod handle;
mod labour;
mod message;

pub use handle::Worker;
pub use labour::LOST;
pub use message::{Began, Event, Progress, Request, RunId, RunResult, WriteRun, append_epochs};
