//! The worker: one named thread that trains and writes files about the training. Requests go in, events come out, and each
//! event wakes the window.

mod message;
mod training_loop;

pub use message::{Began, Event, Inspection, Progress, Request, RunId, RunResult, TrainedRun, Worker, append_epochs};
pub use training_loop::LOST;
