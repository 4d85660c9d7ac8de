//! Training worker: one named thread that trains networks and writes their files. It receives requests and sends events;
//! each event wakes the window.

mod calibration;
mod keeping;
mod message;
mod past_networks;
mod run_view;
mod training_loop;

pub use message::{Event, Origin, Preparing, Progress, Request, RunId, RunResult, Start, TrainedRun, Worker};
pub use past_networks::PastNetworks;
pub use run_view::{Asked, OpenPlan, RunView};
pub use training_loop::LOST;
