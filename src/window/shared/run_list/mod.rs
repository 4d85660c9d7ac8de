//! Every finished training is kept, and all of them survive a restart. A thread of its own keeps their
//! folder.

mod worker;

pub use worker::{PLACES, RunList, RunsWorker};
