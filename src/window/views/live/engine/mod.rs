//! The decoding thread: a source supplies frames, each frame is decoded as it arrives, and the window displays the
//! latest.
//!
//! [`run`] is the loop. A [`LivePlan`] holds the source and the network, [`Command`]s change them while the loop runs,
//! and [`LiveEvent`]s report the results. A [`LiveShown`] is sent only after the window has drawn the previous one, so
//! frames do not queue up.

mod decoding;
mod frame_source;
mod message;
mod recording_file;
mod replay;
mod session;
mod target_session;

pub use message::{Command, LiveEvent, LiveFrame, LivePlan, LiveShown, LiveTargets, Recorded, SourcePlan, Watched};
pub use session::run;
