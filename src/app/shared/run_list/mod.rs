//! Every finished training is kept, and all of them survive a restart. A thread of its own reads and writes the
//! workspace file and the pictures, and prepares what is to be drawn.

mod news;
mod state;
mod worker;

pub use news::{apply, keep, take_news};
pub use state::{Compared, PLACES, RunsState};
pub use worker::{RunsRequest, RunsWorker};
