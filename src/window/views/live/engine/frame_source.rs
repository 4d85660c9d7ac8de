use std::{
    fmt,
    io::Read,
    sync::mpsc::{RecvTimeoutError, channel},
    time::{Duration, Instant},
};

use decoupler_core::{
    dataset::{Seed, Simulation},
    scene::{Deformation, Noise, Rows, Scene},
    sensor::{ArrayScale, SensorModel},
};
use decoupler_files::{
    import::{LineParser, ParsedLine},
    live::{Fault, Keeping, Lines, NextLine, Simulated, Source},
};

use super::{
    message::{Arrived, Command, LivePlan, SourcePlan},
    replay::{ReplayFrames, read_replay},
    session::Tally,
};
use crate::window::job::start_thread;

/// An open source of frames.
#[derive(Debug)]
pub(super) enum FrameSource {
    Simulated(Box<SimulatedFrames>),
    Replay(Box<ReplayFrames>),
    Stream(Box<StreamFrames>),
}

/// Result of asking a source for a frame.
#[derive(Debug)]
pub(super) enum Next {
    /// A frame.
    Frame(Arrived),
    /// A malformed line, with the reason.
    Bad(String),
    /// Nothing yet.
    Nothing,
    /// The source has ended, with the reason if it failed.
    End(Result<(), String>),
}

impl LivePlan {
    /// Returns the scene of `simulation` with the noise of the readings.
    pub(super) fn scene(&self, simulation: &Simulation) -> Scene {
        let scene = simulation.scene;
        Scene {
            noise: Noise {
                relative: self.noise,
                ..scene.noise.in_test()
            },
            ..scene
        }
    }
}

impl FrameSource {
    /// Opens the source of `plan`; `None` if it is no longer wanted.
    pub(super) fn open(
        plan: &LivePlan,
        simulation: &Simulation,
        read: &[usize],
        tally: &mut Tally,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, String> {
        let (sensor, scene): (SensorModel, Scene) = (simulation.sensor, plan.scene(simulation));
        // The rows of a frame are distinguished even if they are not an input of the network.
        let rows = match scene.rows {
            Rows::All => Rows::Known,
            rows => rows,
        };
        Ok(Some(match &plan.source {
            SourcePlan::Simulated {
                frames_per_second,
                motion,
                fault,
            } => {
                let mut frames = SimulatedFrames::new(&sensor, &scene, *frames_per_second, *fault)?;
                frames.source.set_motion(*motion);
                Self::Simulated(Box::new(frames))
            }
            SourcePlan::Replay {
                path,
                at_s,
                speed,
                is_playing,
            } => {
                let recording = read_replay(path, sensor.scale, rows, read, tally)?;
                let replay = ReplayFrames::new(recording, *at_s, *speed, *is_playing, Instant::now());
                Self::Replay(Box::new(replay))
            }
            SourcePlan::Stream(source) => {
                let Some(opened) = open(source, is_wanted)? else {
                    return Ok(None);
                };
                let frames = StreamFrames::new(source, opened, sensor.scale, rows, read.len())?;
                Self::Stream(Box::new(frames))
            }
        }))
    }

    /// Returns the time at which the next frame of a timed source is due; `None` while it is paused.
    pub(super) fn due(&self, now: Instant) -> Option<Instant> {
        match self {
            Self::Simulated(frames) => Some(frames.due()),
            Self::Replay(frames) => frames.due(now),
            Self::Stream(_) => Some(now),
        }
    }

    /// Writes the next frame; a stream waits for it at most for `patience`.
    pub(super) fn next(&mut self, patience: Duration, frame_ohm: &mut [f64], tally: &mut Tally) -> Next {
        let arrived = match self {
            Self::Simulated(frames) => frames.next(frame_ohm, tally),
            Self::Replay(frames) => Ok(frames.next(frame_ohm, tally, Instant::now())),
            Self::Stream(frames) => return frames.next(patience, frame_ohm, tally),
        };
        match arrived {
            Ok(Some(arrived)) => Next::Frame(arrived),
            Ok(None) => Next::Nothing,
            Err(reason) => Next::End(Err(reason)),
        }
    }

    /// Applies a command to the source.
    pub(super) fn apply(&mut self, command: &Command) -> Result<(), String> {
        let now = Instant::now();
        match (self, command) {
            (Self::Simulated(frames), Command::Move(motion)) => frames.source.set_motion(*motion),
            (Self::Simulated(frames), Command::Break(fault)) => {
                frames.source.set_fault(*fault).map_err(|error| error.to_string())?;
            }
            (Self::Replay(frames), Command::Seek(at_s)) => frames.seek(*at_s, now),
            (Self::Replay(frames), Command::Speed(speed)) => frames.set_speed(*speed, now),
            (Self::Replay(frames), Command::Play(is_playing)) => frames.play(*is_playing, now),
            _ => {}
        }
        Ok(())
    }

    /// Returns the true deformation of the last frame, if it is known.
    pub(super) fn truth(&self) -> Option<&Deformation> {
        match self {
            Self::Simulated(frames) => Some(frames.source.deformation()),
            Self::Replay(_) | Self::Stream(_) => None,
        }
    }

    /// Returns `true` for a live stream, which may fall silent.
    pub(super) fn is_stream(&self) -> bool {
        matches!(self, Self::Stream(_))
    }
}

/// Simulated frames at their rate.
#[derive(Debug)]
pub(super) struct SimulatedFrames {
    pub(super) source: Simulated,
    between: Duration,
    /// Time at which the next frame is due.
    due: Instant,
}

impl SimulatedFrames {
    pub(super) fn new(
        sensor: &SensorModel,
        scene: &Scene,
        frames_per_second: f64,
        fault: Option<Fault>,
    ) -> Result<Self, String> {
        let mut source =
            Simulated::new(sensor, scene, Seed(0), frames_per_second).map_err(|error| error.to_string())?;
        source.set_fault(fault).map_err(|error| error.to_string())?;
        Ok(Self {
            source,
            between: Duration::from_secs_f64(1.0 / frames_per_second),
            due: Instant::now(),
        })
    }

    /// Returns the time at which the next frame is due.
    pub(super) fn due(&self) -> Instant {
        self.due
    }

    /// Writes the next frame, if it is due. Frames that were not taken in time are dropped.
    pub(super) fn next(&mut self, frame_ohm: &mut [f64], tally: &mut Tally) -> Result<Option<Arrived>, String> {
        let now = Instant::now();
        if now < self.due {
            return Ok(None);
        }
        let behind = now - self.due;
        if behind > Lines::PATIENCE {
            let missed = (behind.as_secs_f64() / self.between.as_secs_f64()) as u64;
            self.source.skip(missed);
            tally.dropped(missed);
            self.due = now;
        }
        let time_s = self.source.next_frame(frame_ohm).map_err(|error| error.to_string())?;
        self.due += self.between;
        let read_at = Instant::now();
        Ok(Some(Arrived { time_s, read_at }))
    }
}

/// Frames from the lines of a device or socket.
#[derive(Debug)]
pub(super) struct StreamFrames {
    lines: SourceLines,
    parser: LineParser,
    columns: usize,
    /// Latest readings of every row read: rows × M4.
    latest_ohm: Vec<f64>,
    /// Rows with readings since the last frame.
    is_new: Vec<bool>,
}

impl StreamFrames {
    pub(super) fn new(
        source: &Source,
        opened: Box<dyn Read + Send>,
        scale: ArrayScale,
        rows: Rows,
        read: usize,
    ) -> Result<Self, String> {
        let keeping = source.keeping();
        let parser = LineParser::of_array(scale, rows, keeping == Keeping::All).map_err(|error| error.to_string())?;
        Ok(Self {
            lines: SourceLines::new(source, opened, read)?,
            parser,
            columns: scale.columns(),
            latest_ohm: vec![0.0; read * scale.columns()],
            is_new: vec![false; read],
        })
    }

    /// Waits for a line at most for `patience`, and writes the frame if the line completes it.
    pub(super) fn next(&mut self, patience: Duration, frame_ohm: &mut [f64], tally: &mut Tally) -> Next {
        let next = self.take_line(patience, frame_ohm);
        self.lines.count_dropped(tally);
        next
    }

    fn take_line(&mut self, patience: Duration, frame_ohm: &mut [f64]) -> Next {
        let SourceLine {
            number,
            arrived,
            text,
            is_fragment,
        } = match self.lines.take(patience) {
            Ok(line) => line,
            Err(next) => {
                if matches!(next, Next::Bad(_)) {
                    self.parser.count_bad();
                }
                return next;
            }
        };
        let is_snapshot = match self.parser.parse(number, text) {
            Ok(ParsedLine::NoReadings | ParsedLine::Start { .. }) => return Next::Nothing,
            Ok(ParsedLine::Snapshot(readings_ohm)) => {
                frame_ohm.copy_from_slice(readings_ohm);
                true
            }
            Ok(ParsedLine::Row {
                row_index, readings, ..
            }) => {
                let index = row_index.unwrap_or(0);
                self.latest_ohm[index * self.columns..][..self.columns].copy_from_slice(readings);
                self.is_new[index] = true;
                if !self.is_new.iter().all(|is_new| *is_new) {
                    return Next::Nothing;
                }
                self.is_new.fill(false);
                frame_ohm.copy_from_slice(&self.latest_ohm);
                false
            }
            Err(error) if error.is_final() && !is_fragment => {
                return Next::End(Err(self.lines.failed(&error)));
            }
            Err(error) => return Next::Bad(error.to_string()),
        };
        if is_snapshot {
            self.lines.set_kept(1);
        }
        Next::Frame(arrived)
    }
}

/// Time between checks whether the source is still wanted.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);

/// Opens a source on its own thread: connecting may take minutes, but cancelling must not. Returns `None` if the source
/// is no longer wanted.
///
/// # Errors
/// If it cannot be opened.
pub(super) fn open(source: &Source, is_wanted: &dyn Fn() -> bool) -> Result<Option<Box<dyn Read + Send>>, String> {
    let (send, opened) = channel();
    let wanted = source.clone();
    let open = move || wanted.open().map_err(|error| error.to_string());
    let started = start_thread("open source", open, move |opened| {
        // The receiver is gone if the source is no longer wanted.
        let _ = send.send(opened.map_err(|error| error.to_string()).flatten());
    });
    started.map_err(|error| error.to_string())?;
    while is_wanted() {
        match opened.recv_timeout(BETWEEN_LOOKS) {
            Ok(opened) => return opened.map(Some),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(format!("opening {source} failed unexpectedly")),
        }
    }
    Ok(None)
}

/// Lines of a device or socket.
#[derive(Debug)]
pub(super) struct SourceLines {
    source: Source,
    begins_anywhere: bool,
    lines: Lines,
    dropped: u64,
    /// Time at which reading began.
    begun: Instant,
}

/// A line that has arrived.
pub(super) struct SourceLine<'a> {
    pub(super) number: u64,
    pub(super) arrived: Arrived,
    pub(super) text: &'a [u8],
    /// True for a first line whose beginning may be missing.
    pub(super) is_fragment: bool,
}

impl SourceLines {
    /// Reads `opened` on its own thread and queues the latest `kept` lines.
    pub(super) fn new(source: &Source, opened: Box<dyn Read + Send>, kept: usize) -> Result<Self, String> {
        let lines = Lines::spawn(opened, source.keeping(), source.begins_anywhere());
        let mut lines = lines.map_err(|error| format!("no thread could be started: {error}"))?;
        lines.set_kept(kept);
        Ok(Self {
            source: source.clone(),
            begins_anywhere: source.begins_anywhere(),
            lines,
            dropped: 0,
            begun: Instant::now(),
        })
    }

    /// Sets the maximum number of queued lines.
    pub(super) fn set_kept(&mut self, kept: usize) {
        self.lines.set_kept(kept);
    }

    /// Waits for a line at most for `patience`.
    ///
    /// # Errors
    /// If there is no line, the line is too long, or the source has ended.
    pub(super) fn take(&mut self, patience: Duration) -> Result<SourceLine<'_>, Next> {
        let line = match self.lines.next(patience) {
            NextLine::Line(line) => line,
            NextLine::None => return Err(Next::Nothing),
            NextLine::End(None) => return Err(Next::End(Ok(()))),
            NextLine::End(Some(error)) => {
                return Err(Next::End(Err(self.source.lost(&error))));
            }
        };
        let (number, read_at) = (line.number, line.read_at);
        let Some(text) = line.text else {
            return Err(Next::Bad(format!(
                "line {number}: it is longer than {} bytes",
                Lines::LONGEST
            )));
        };
        let time_s = read_at.saturating_duration_since(self.begun).as_secs_f64();
        Ok(SourceLine {
            number,
            arrived: Arrived { time_s, read_at },
            text,
            is_fragment: self.begins_anywhere && number == 1,
        })
    }

    /// Adds the lines dropped since this was last called to `tally`.
    pub(super) fn count_dropped(&mut self, tally: &mut Tally) {
        let dropped = self.lines.dropped();
        tally.dropped(dropped - self.dropped);
        self.dropped = dropped;
    }

    /// Message of an error that ends the reading.
    pub(super) fn failed(&self, error: &impl fmt::Display) -> String {
        format!("{}: {error}", self.source)
    }
}
