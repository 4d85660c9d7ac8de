//! Live frames: sources, reading line by line, decoding, and recordings.
//!
//! A [`Session`] decodes what its source sends, for the window and for the terminal. A [`Source`] provides bytes, [`Lines`]
//! splits them into lines, [`Simulated`] needs no hardware and can have a [`Fault`], and a [`Recording`] is replayed by its own
//! times. [`Recorder`] saves frames as a recording. The arithmetic on frames is in [`decoupler_core::live`].

mod decoding;
mod fault;
mod history;
mod input;
mod latencies;
mod lines;
mod recording;
mod recording_file;
mod replay;
mod session;
mod simulated;
mod source;
mod tally;

pub use decoding::{LiveArray, TruthErrors, Unwatched, Watched};
pub use fault::{ConverterEnd, Fault, FaultError, FaultySensor};
pub use history::History;
pub use input::SourcePlan;
pub use latencies::Latencies;
pub use lines::{Keeping, Line, Lines, NextLine};
pub use recording::{Recorder, Recording, RecordingError};
pub use recording_file::Recorded;
pub use replay::{Replay, ReplayState};
pub use session::{Note, Session, SessionError, SessionEvent, SessionPlan, Unit};
pub use simulated::{Motion, Simulated, SimulatedError};
pub use source::{Source, SourceError};
pub use tally::Counts;
