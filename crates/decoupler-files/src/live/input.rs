use std::{
    io::Read,
    path::PathBuf,
    sync::mpsc::{RecvTimeoutError, channel},
    thread,
    time::{Duration, Instant},
};

use decoupler_core::{
    dataset::{Place, Seed},
    scene::{Deformation, Scene},
    sensor::SensorModel,
};

use super::{
    Fault, Keeping, Line, Lines, Motion, NextLine, Note, SessionError, Simulated, Source, replay::Replay, tally::Tally,
};
use crate::{
    export::NetworkFile,
    import::{KeptCell, LineParser, ParsedLine},
};

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
    /// Lines as they arrive.
    Stream(Source),
}

impl SourcePlan {
    /// Returns the source according to the file at its path: a named pipe or a device cannot be rewound, and is a
    /// stream. Accesses the file system, which may be slow.
    #[must_use]
    pub fn resolved(self) -> Self {
        match self {
            Self::Replay { path, .. } if path.exists() && !path.is_file() && !path.is_dir() => {
                Self::Stream(Source::File(path))
            }
            other => other,
        }
    }
}

/// Readings as they come from a source.
#[derive(Debug)]
pub(super) struct Arrived {
    /// Number of the line, from 1; 0 if it is not of a stream.
    pub(super) line: u64,
    /// Index of the row-wire or network with which the readings begin; `None` if it is unknown.
    pub(super) first_row: Option<usize>,
    /// Readings of one row, or of all row-wires read.
    pub(super) readings: Vec<f64>,
    /// Cells of the line that are copied to the output.
    pub(super) kept: Vec<KeptCell>,
    /// Time in its source, in seconds.
    pub(super) time_s: f64,
    /// Time at which its last byte was read, or at which it was simulated or due.
    pub(super) read_at: Instant,
}

/// Result of asking an input for readings.
#[derive(Debug)]
pub(super) enum Taken {
    /// They were written.
    Readings,
    /// Those of this frame of a replay are due.
    Replayed(super::replay::Due),
    /// A malformed line, with the reason.
    Bad(String),
    /// None yet.
    Nothing,
    /// The source has ended, with the reason if it failed.
    End(Result<(), SessionError>),
}

/// An open source.
#[derive(Debug)]
pub(super) enum Input {
    Simulated(Box<SimulatedInput>),
    Replay(Box<Replay>),
    Lines(Box<LineInput>),
}

impl Input {
    /// Opens `plan` for the network of `file`; `None` if it is no longer wanted. `array` is its sensor with the scene, and
    /// `by_frame` is true if the row-wire of every line must be known.
    pub(super) fn open(
        plan: &SourcePlan,
        file: &NetworkFile,
        array: Option<(&SensorModel, &Scene)>,
        by_frame: bool,
        tally: &mut Tally,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, SessionError> {
        let now = Instant::now();
        Ok(Some(match plan {
            SourcePlan::Simulated {
                frames_per_second,
                motion,
                fault,
            } => {
                let (sensor, scene) = array.ok_or(SessionError::NoModel)?;
                let mut source = Simulated::new(sensor, scene, Seed(0), *frames_per_second)?;
                source.set_fault(*fault)?;
                source.set_motion(*motion);
                Self::Simulated(Box::new(SimulatedInput {
                    between: Duration::from_secs_f64(1.0 / frames_per_second),
                    frame_ohm: vec![0.0; source.readings()],
                    source,
                    due: now,
                }))
            }
            SourcePlan::Replay {
                path,
                at_s,
                speed,
                is_playing,
            } => {
                let replay = Replay::open(path, file, tally, is_wanted, now);
                if !is_wanted() {
                    return Ok(None);
                }
                let mut replay = replay?;
                replay.seek(*at_s, now);
                replay.set_speed(*speed, now);
                replay.play(*is_playing, now);
                Self::Replay(Box::new(replay))
            }
            SourcePlan::Stream(source) => {
                let Some(opened) = open(source, is_wanted)? else {
                    return Ok(None);
                };
                Self::Lines(Box::new(LineInput::new(source, opened, file, by_frame)?))
            }
        }))
    }

    /// Takes the next readings that are there at `now`; a stream waits for a line at most for `patience`.
    pub(super) fn take(
        &mut self,
        now: Instant,
        patience: Duration,
        arrived: &mut Arrived,
        tally: &mut Tally,
        notes: &mut Vec<Note>,
    ) -> Taken {
        match self {
            Self::Simulated(simulated) => simulated.take(now, arrived, tally),
            Self::Replay(replay) => replay.take(now).map_or(Taken::Nothing, Taken::Replayed),
            Self::Lines(lines) => lines.take(patience, arrived, notes),
        }
    }

    /// Returns the time at which the next frame of a timed source is due; `None` while it is paused.
    pub(super) fn due(&self, now: Instant) -> Option<Instant> {
        match self {
            Self::Simulated(simulated) => Some(simulated.due),
            Self::Replay(replay) => replay.due(now),
            Self::Lines(_) => Some(now),
        }
    }

    /// Returns the true deformation of the last frame, if it is known.
    pub(super) fn truth(&self) -> Option<&Deformation> {
        match self {
            Self::Simulated(simulated) => Some(simulated.source.deformation()),
            Self::Replay(_) | Self::Lines(_) => None,
        }
    }
}

/// Simulated frames at their rate.
#[derive(Debug)]
pub(super) struct SimulatedInput {
    pub(super) source: Simulated,
    between: Duration,
    /// Time at which the next frame is due.
    due: Instant,
    frame_ohm: Vec<f64>,
}

impl SimulatedInput {
    /// Writes the next frame, if it is due. Frames that were not taken in time are dropped.
    fn take(&mut self, now: Instant, arrived: &mut Arrived, tally: &mut Tally) -> Taken {
        if now < self.due {
            return Taken::Nothing;
        }
        let behind = now - self.due;
        if behind > Lines::PATIENCE {
            let missed = (behind.as_secs_f64() / self.between.as_secs_f64()) as u64;
            self.source.skip(missed);
            tally.counts.dropped += missed;
            self.due = now;
        }
        arrived.time_s = match self.source.next_frame(&mut self.frame_ohm) {
            Ok(time_s) => time_s,
            Err(error) => return Taken::End(Err(error.into())),
        };
        arrived.readings.clear();
        arrived.readings.extend_from_slice(&self.frame_ohm);
        arrived.first_row = Some(0);
        self.due += self.between;
        arrived.read_at = Instant::now();
        Taken::Readings
    }
}

/// Lines of a stream.
#[derive(Debug)]
pub(super) struct LineInput {
    source: Source,
    pub(super) lines: Lines,
    parser: LineParser,
    /// Time at which reading began.
    begun: Instant,
    has_stepped_back: bool,
}

impl LineInput {
    pub(super) fn new(
        source: &Source,
        opened: Box<dyn Read + Send>,
        file: &NetworkFile,
        by_frame: bool,
    ) -> Result<Self, SessionError> {
        let keeping = source.keeping();
        let parser = file.line_parser(by_frame, keeping == Keeping::All)?;
        let lines = Lines::spawn(opened, keeping, source.begins_anywhere());
        let mut lines = lines.map_err(SessionError::Reader)?;
        // The latest line of each row-wire.
        lines.set_kept(match &file.problem.sensor {
            Some(simulation) => simulation.scene.rows.read(simulation.sensor.scale.rows())?.len(),
            None => file.network.values().len(),
        });
        Ok(Self {
            source: source.clone(),
            lines,
            parser,
            begun: Instant::now(),
            has_stepped_back: false,
        })
    }

    pub(super) fn source(&self) -> &Source {
        &self.source
    }

    fn take(&mut self, patience: Duration, arrived: &mut Arrived, notes: &mut Vec<Note>) -> Taken {
        let Line { number, text, read_at } = match self.lines.next(patience) {
            NextLine::Line(line) => line,
            NextLine::None => return Taken::Nothing,
            NextLine::End(None) => return Taken::End(Ok(())),
            NextLine::End(Some(error)) => return Taken::End(Err(SessionError::Lost(self.source.clone(), error))),
        };
        let Some(text) = text else {
            self.parser.count_bad();
            return Taken::Bad(format!("line {number}: it is longer than {} bytes", Lines::LONGEST));
        };
        let (row_index, readings, kept, is_snapshot) = match self.parser.parse(number, text) {
            Ok(ParsedLine::NoReadings) => return Taken::Nothing,
            Ok(ParsedLine::Start { is_first }) => {
                if is_first {
                    notes.push(Note::Start(number));
                }
                return Taken::Nothing;
            }
            Ok(ParsedLine::Snapshot(readings)) => (Some(0), readings, &[][..], true),
            Ok(ParsedLine::Row {
                row_index,
                readings,
                place,
                kept,
                ..
            }) => {
                let is_step_back = matches!(place, Some(Place::AfterStepBack(_)));
                if is_step_back && !std::mem::replace(&mut self.has_stepped_back, true) {
                    notes.push(Note::StepBack(number));
                }
                (row_index, readings, kept, false)
            }
            // Reading may begin in the middle of a line.
            Err(error) if error.is_final() && !(self.source.begins_anywhere() && number == 1) => {
                return Taken::End(Err(SessionError::Line(self.source.clone(), error)));
            }
            Err(error) => return Taken::Bad(error.to_string()),
        };
        arrived.line = number;
        arrived.first_row = row_index;
        arrived.readings.clear();
        arrived.readings.extend_from_slice(readings);
        arrived.kept.resize_with(kept.len(), KeptCell::default);
        for (to, from) in arrived.kept.iter_mut().zip(kept) {
            // The buffers are reused.
            to.title.clone_from(&from.title);
            to.text.clone_from(&from.text);
        }
        arrived.time_s = read_at.saturating_duration_since(self.begun).as_secs_f64();
        arrived.read_at = read_at;
        if is_snapshot {
            self.lines.set_kept(1);
        }
        Taken::Readings
    }
}

/// Time between checks whether the source is still wanted.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);

/// Opens a source on its own thread: connecting may take minutes, but cancelling must not. Returns `None` if the source
/// is no longer wanted.
fn open(source: &Source, is_wanted: &dyn Fn() -> bool) -> Result<Option<Box<dyn Read + Send>>, SessionError> {
    let (send, opened) = channel();
    let wanted = source.clone();
    let thread = thread::Builder::new().name("open source".to_owned());
    // The receiver is gone if the source is no longer wanted.
    let started = thread.spawn(move || drop(send.send(wanted.open())));
    started.map_err(SessionError::Reader)?;
    while is_wanted() {
        match opened.recv_timeout(BETWEEN_LOOKS) {
            Ok(opened) => return Ok(Some(opened?)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(SessionError::NotOpened(source.clone())),
        }
    }
    Ok(None)
}
