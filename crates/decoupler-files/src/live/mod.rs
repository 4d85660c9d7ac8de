//! Live frames in and out: sources, reading line by line, simulated frames and recordings.
//!
//! A [`Source`] provides bytes, [`Lines`] splits them into lines, and a [`LineParser`](crate::import::LineParser) parses the
//! readings. [`Simulated`] needs no hardware, and can have a [`Fault`]. [`Recorder`] saves frames for replay as a [`Recording`], and [`Latencies`]
//! counts how long frames take. The arithmetic on frames is in [`decoupler_core::live`].

mod fault;
mod latencies;
mod lines;
mod recording;
mod simulated;
mod source;

pub use fault::{ConverterEnd, Fault, FaultError, FaultySensor};
pub use latencies::Latencies;
pub use lines::{Keeping, Line, Lines, NextLine};
pub use recording::{Recorder, Recording, RecordingError};
pub use simulated::{Motion, Simulated, SimulatedError};
pub use source::{Source, SourceError};
