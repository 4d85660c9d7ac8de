//! Live frames: sources, line-by-line decoding, re-zeroing, recording, and fault diagnosis from the residual.
//!
//! A [`Source`] provides bytes, [`Lines`] splits them into lines, and [`LineParser`] parses the readings.
//! [`FaultMonitor`] checks whether Eq. (2) explains them and identifies the faulty wire; [`LeftOutDecoder`] decodes
//! without it. [`DriftMonitor`] reports readings that no longer look like those of the training. [`Simulated`] needs no
//! hardware. [`ReZero`] estimates the unloaded state from recent frames, and
//! [`Recorder`] saves frames for replay.

mod drift;
mod faults;
mod left_out_decoder;
mod line_parser;
mod lines;
mod re_zero;
mod recording;
mod source;

pub use drift::{Drift, DriftEvent, DriftMonitor, DriftReference, NoDriftMonitor};
pub use faults::{Diagnosis, FaultCause, FaultEvent, FaultMonitor, FaultyWire};
pub use left_out_decoder::LeftOutDecoder;
pub use line_parser::{LineError, LineParser, ParsedLine};
pub use lines::{Keeping, Line, Lines, NextLine};
pub use re_zero::{ReZero, ReZeroError, ZeroGains};
pub use recording::{Latencies, Recorder, Recording, RecordingError};
pub use source::{Motion, Simulated, SimulatedError, Source, SourceError};
