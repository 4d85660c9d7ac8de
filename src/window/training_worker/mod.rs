//! The worker: one named thread that trains and writes files about the training. Requests go in, events come out, and each
//! event wakes the window.

mod handle;
mod message;
mod training_loop;

pub use handle::Worker;
pub use message::{Began, Event, Inspection, Progress, Request, RunId, RunResult, TrainedRun, append_epochs};
pub use training_loop::LOST;
