use std::{
    ops::RangeInclusive,
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use ndarray::Array2;

use crate::window::test_view::Frame;
use decoupler_core::{
    dataset::Simulation,
    live::{Drift, FaultEvent, FaultyWire, LiveError, ZeroGains},
    problem::Problem,
    sensor::SensorModel,
    surface::SurfaceMap,
};
use decoupler_files::{
    export::NetworkFile,
    figure::TargetSurface,
    live::{Fault, Motion, Source},
};

/// Frames to be decoded, and the network that decodes them.
#[derive(Clone, Debug)]
pub struct LivePlan {
    /// The network.
    pub network: Arc<NetworkFile>,
    /// Sensor and scene of the network; `None` for a network of a recording.
    pub simulation: Option<Simulation>,
    /// Source of the frames.
    pub source: SourcePlan,
    /// Noise of a reading, relative to the reading (standard deviation). Simulated sources add it, and fault detection
    /// needs it.
    pub noise: f64,
    /// Gains of the unloaded state by which readings are divided, if it was taken before.
    pub zero: Option<ZeroGains>,
    /// Folder of the recordings.
    pub recordings: PathBuf,
}

/// Source of frames.
#[derive(Clone, Debug, PartialEq)]
pub enum SourcePlan {
    /// An indenter over the array, without hardware.
    Simulated {
        /// Rate.
        frames_per_second: f64,
        /// Motion of the indenter.
        motion: Motion,
        /// Fault of the wires.
        fault: Option<Fault>,
    },
    /// A file, replayed.
    Replay {
        /// The file.
        path: PathBuf,
        /// Time in the recording at which to begin, in seconds.
        at_s: f64,
        /// Recorded seconds per second.
        speed: f64,
        /// False if it begins paused.
        is_playing: bool,
    },
    /// A device or socket.
    Stream(Source),
}

impl SourcePlan {
    /// Returns the source according to the file at its path: a named pipe or a device cannot be rewound, and is a
    /// stream. Accesses the file system, which may be slow.
    pub(super) fn resolved(self) -> Self {
        match self {
            Self::Replay { path, .. } if path.exists() && !path.is_file() && !path.is_dir() => {
                Self::Stream(Source::File(path))
            }
            other => other,
        }
    }
}

/// Change to what is decoded.
#[derive(Clone, Debug)]
pub enum Command {
    /// The last frame was drawn: send the next one.
    Drawn,
    /// Set the motion of the simulated indenter.
    Move(Motion),
    /// Set or clear the fault of the simulated wires.
    Break(Option<Fault>),
    /// Take the unloaded state from the latest frames.
    Zero,
    /// Divide readings by these gains, or by none.
    UseZero(Option<ZeroGains>),
    /// Begin a recording.
    Record,
    /// End the recording.
    EndRecording,
    /// Go to this time of the recording in seconds.
    Seek(f64),
    /// Replay at this speed.
    Speed(f64),
    /// Resume or pause the replay.
    Play(bool),
}

/// Event from the thread.
#[derive(Debug)]
pub enum LiveEvent {
    /// The source, according to the file at its path.
    Source(SourcePlan),
    /// The latest frame, with the status of decoding.
    Shown(Box<LiveShown>),
    /// Gains of the unloaded state, or the reason why there are none.
    Zeroed(Result<ZeroGains, String>),
    /// A recording has begun.
    Recording(PathBuf),
    /// A recording has ended, with the reason if the user did not end it.
    Recorded(Recorded, Option<String>),
    /// A recording could not be started.
    NotRecorded(String),
    /// Decoding has ended, with the reason if it could not continue.
    Ended(Result<(), String>),
}

/// A finished recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Its file.
    pub path: PathBuf,
    /// Number of frames.
    pub frames: u64,
    /// Time from the first to the last frame, in seconds.
    pub seconds: f64,
}

/// State of decoding.
#[derive(Clone, Debug, Default)]
pub struct LiveShown {
    /// The last frame of an array with an answer; `None` before the first.
    pub frame: Option<LiveFrame>,
    /// The last sample with an answer, of a network of a recording; `None` before the first.
    pub targets: Option<LiveTargets>,
    /// Number of frames and their times.
    pub counts: Counts,
    /// Frames and seconds of the recording under way.
    pub recording: Option<(u64, f64)>,
    /// Position in the replayed recording.
    pub replay: Option<ReplayState>,
}

impl LiveShown {
    /// Returns true once there is something to be drawn.
    pub fn has_answer(&self) -> bool {
        self.frame.is_some() || self.targets.is_some()
    }
}

/// Latest answers of a network of a recording.
#[derive(Clone, Debug)]
pub struct LiveTargets {
    /// Description of the targets.
    pub problem: Arc<Problem>,
    /// The network, which may have prediction intervals.
    pub network: Arc<NetworkFile>,
    /// Present drift of the readings, or the reason why they are not monitored.
    pub drift: Result<Option<Drift>, LiveError>,
    /// Surface through the targets, if they have positions.
    pub surface: Option<Arc<TargetSurface>>,
    /// Smallest and largest value of each target so far.
    pub ranges: Vec<(f64, f64)>,
    /// Times in seconds and values of the targets, the latest last.
    pub history: Vec<(f64, Arc<[f64]>)>,
    /// Readings outside the range seen in training; `None` if that is not known.
    pub readings_outside: Option<usize>,
    /// Targets far outside the range seen in training.
    pub targets_outside: usize,
}

impl LiveTargets {
    /// Returns the latest values.
    pub fn values(&self) -> &[f64] {
        self.history.last().map_or(&[], |(_, values)| values)
    }
}

/// One decoded frame, ready to be drawn.
#[derive(Clone, Debug)]
pub struct LiveFrame {
    /// Sensor whose frames these are.
    pub sensor: SensorModel,
    /// Row-wires read, from 0.
    pub rows: Arc<[usize]>,
    /// The surface through its nodes.
    pub surface: Arc<SurfaceMap>,
    /// z from full compression to rest, in millimetres.
    pub z_range_mm: RangeInclusive<f64>,
    /// The decoded deformation.
    pub decoupled: Frame,
    /// The true one, of a simulated source.
    pub actual: Option<Frame>,
    /// Drop of each reading from its value without load, in percent: rows × columns.
    pub drops_percent: Array2<f64>,
    /// Time of the frame in its source, in seconds.
    pub time_s: f64,
    /// Root mean square of m/R − 1 over the readings m that are used, R from Eq. (2) at the decoded deformation.
    pub residual: f64,
    /// Readings outside the range seen in training; `None` if that is not known.
    pub readings_outside: Option<usize>,
    /// Coordinates far outside the range seen in training.
    pub coordinates_outside: usize,
    /// Faults of wires.
    pub watched: Watched,
    /// Errors where the truth is known.
    pub errors: Option<TruthErrors>,
}

/// Result of fault detection.
#[derive(Clone, Debug, PartialEq)]
pub enum Watched {
    /// Faults are not looked for, with the reason.
    Off(&'static str),
    /// Last event; [`FaultEvent::Recovered`] at first. The readings of a named wire are left out.
    Checked(FaultEvent),
}

impl Watched {
    /// Returns the wire of the fault that was named.
    pub fn wire(&self) -> Option<FaultyWire> {
        match *self {
            Self::Checked(FaultEvent::Named { wire, .. }) => Some(wire),
            Self::Off(_) | Self::Checked(_) => None,
        }
    }

    /// Returns `true` for a reading that is left out.
    pub fn leaves_out(&self, row: usize, column: usize) -> bool {
        (self.wire()).is_some_and(|wire| wire == FaultyWire::Row(row) || wire.columns().contains(&column))
    }
}

/// Mean |error| of z over all nodes, in millimetres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TruthErrors {
    /// Over the last second or so, of the displayed answers.
    pub shown_mm: Option<f64>,
    /// Since a fault was named: of the network with all wires, and with the faulty wires left out.
    pub since_named_mm: Option<[f64; 2]>,
}

/// Number of frames and their times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Counts {
    /// Frames decoded.
    pub decoded: u64,
    /// Frames decoded per second, recently.
    pub frames_per_second: f64,
    /// Median and 99th percentile of the time from reading a frame to its answer.
    pub latency: Option<[Duration; 2]>,
    /// Frames, or lines of a device, dropped in favour of newer ones.
    pub dropped: u64,
    /// Malformed lines, and frames that could not be decoded.
    pub bad: u64,
    /// Reason for the last of them.
    pub last_bad: Option<String>,
    /// True if no frame has arrived for a while.
    pub is_waiting: bool,
}

/// Position in a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReplayState {
    /// Time of the displayed frame, from the first, in seconds.
    pub at_s: f64,
    /// Time of the last frame, from the first, in seconds.
    pub length_s: f64,
    /// False while it is paused.
    pub is_playing: bool,
}

/// Arrival of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arrived {
    /// Time in its source, in seconds.
    pub(super) time_s: f64,
    /// Time at which its last byte was read, or at which it was simulated or due.
    pub(super) read_at: Instant,
}
