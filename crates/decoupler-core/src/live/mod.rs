//! Frames as they come: sources, decoding line by line, re-zero, recording, and faults named from the residual.
//!
//! A [`Source`] gives bytes, [`Lines`] their lines, and [`LineParser`] the readings in them. [`FaultMonitor`] watches
//! whether Eq. (2) explains them and names the wire at fault; [`LeftOutDecoder`] decodes without it. [`Simulated`] needs
//! no hardware. [`ReZero`] takes the unloaded state from recent frames, and [`Recorder`] keeps frames for a replay.

mod faults;
mod left_out_decoder;
mod line_parser;
mod lines;
mod re_zero;
mod recording;
mod source;

pub use faults::{Diagnosis, FaultCause, FaultEvent, FaultMonitor, FaultyWire};
pub use left_out_decoder::LeftOutDecoder;
pub use line_parser::{LineError, LineParser, ParsedLine};
pub use lines::{Keeping, Line, Lines, NextLine};
pub use re_zero::{ReZero, ReZeroError, ZeroGains};
pub use recording::{Latencies, Recorder, Recording, RecordingError};
pub use source::{Motion, Simulated, SimulatedError, Source, SourceError};
