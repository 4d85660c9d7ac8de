//! Live frames: sources, reading line by line, decoding, and recordings.
//!
//! A [`Session`] decodes what its source sends, for the window and for the terminal. A [`Source`] provides bytes, [`Lines`]
//! splits them into lines, [`Simulated`] needs no hardware and can have a [`Fault`], and a [`Recording`] is replayed by its own
//! times. [`Recorder`] saves frames as a recording. The arithmetic on frames is in [`decoupler_core::live`].

mod array;
mod fault;
mod history;
mod input;
mod lines;
mod recording;
mod replay;
mod session;
mod simulated;
mod source;
mod tally;

pub use array::{LiveArray, Watched};
pub use fault::{ConverterEnd, Fault, FaultEffect, FaultError, FaultySensor};
pub use history::History;
pub use input::{Input, LineInput, SourcePlan};
pub use lines::{Keeping, Line, Lines};
pub use recording::{Recorded, Recorder, RecordingFile};
pub use replay::{Recording, Replay, ReplayState};
pub use session::{Answer, Note, Session, SessionError, SessionEvent, SessionPlan, Unit};
pub use simulated::{Motion, Simulated};
pub use source::{Source, SourceError};
pub use tally::{Latencies, Tally};
