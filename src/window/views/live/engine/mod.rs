//! The thread that decodes: a source gives frames, each is decoded as it comes, and the window is shown the latest.
//!
//! [`run`] is the loop; a [`LivePlan`] says what it decodes and by what, [`Command`]s change it on the way, and
//! [`LiveEvent`]s report it. A [`LiveShown`] goes to the window only once the one before has been drawn, so that nothing
//! queues up and no frame is drawn for no one.

mod decoding;
mod frame_source;
mod message;
mod recording_file;
mod replay;
mod session;
mod target_session;

pub use message::{Command, LiveEvent, LiveFrame, LivePlan, LiveShown, LiveTargets, Recorded, SourcePlan, Watched};
pub use session::run;
