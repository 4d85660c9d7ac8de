//! Every finished training is kept, and all of them survive a restart. A thread of its own keeps their
//! folder.

mod events;
mod state;
mod worker;

pub use state::{PLACES, RunList};
pub use worker::RunsWorker;
