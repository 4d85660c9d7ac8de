use std::{
    io,
    path::PathBuf,
    time::{Duration, Instant},
};

use decoupler_core::{dataset::Place, scene::Deformation};

use super::{Answer, Lines, Note, Replay, SessionError, SessionEvent, Simulated, Source, SourceError, Tally};
use crate::import::{KeptCell, LONGEST_LINE, LineParser, ParsedLine};

/// Source of frames.
#[derive(Clone, Debug, PartialEq)]
pub enum SourcePlan {
    /// An indenter over the array, without hardware, with this number of frames per second.
    Simulated(f64),
    /// A file, replayed.
    Replay(PathBuf),
    /// Lines as they arrive.
    Stream(Source),
}

impl SourcePlan {
    /// Returns the source according to the file at its path: a named pipe or a device cannot be rewound, and is a
    /// stream. Accesses the file system, which may be slow.
    #[must_use]
    pub fn resolved(self) -> Self {
        match self {
            Self::Replay(path) if path.exists() && !path.is_file() && !path.is_dir() => {
                Self::Stream(Source::File(path))
            }
            other => other,
        }
    }
}

/// An open source.
#[derive(Debug)]
pub enum Input {
    /// Simulated frames, and the time at which the next is due.
    Simulated(Box<Simulated>, Instant),
    /// A recording.
    Replay(Box<Replay>),
    /// Lines of a stream.
    Lines(Box<LineInput>),
}

impl Input {
    /// Returns the true deformation of the last frame, if it is known.
    pub fn truth(&self) -> Option<&Deformation> {
        match self {
            Self::Simulated(source, _) => Some(source.deformation()),
            Self::Replay(_) | Self::Lines(_) => None,
        }
    }

    /// Returns the time at which the next frame of a timed source is due, `now` for a stream, and `None` while it is paused.
    pub fn due(&self, now: Instant) -> Option<Instant> {
        match self {
            Self::Simulated(_, due) => Some(*due),
            Self::Replay(replay) => replay.due(now),
            Self::Lines(_) => Some(now),
        }
    }

    /// Writes the next readings that are there at `now` to `answer`; a stream waits for a line at most for `patience`. Returns
    /// [`SessionEvent::Answer`] if there are any.
    pub(super) fn take(
        &mut self,
        (now, patience): (Instant, Duration),
        answer: &mut Answer,
        tally: &mut Tally,
        notes: &mut Vec<Note>,
    ) -> SessionEvent {
        let (source, due) = match self {
            Self::Simulated(source, due) => (source, due),
            Self::Replay(replay) => return replay.take(now, answer, tally),
            Self::Lines(lines) => {
                let event = lines.take(patience, answer, notes);
                tally.dropped = lines.lines.dropped;
                return event;
            }
        };
        if now < *due {
            return SessionEvent::Nothing;
        }
        let behind = now - *due;
        if behind > Lines::PATIENCE {
            // Frames that were not taken in time are dropped.
            let missed = (behind.as_secs_f64() * source.frames_per_second) as u64;
            source.skip(missed);
            tally.dropped += missed;
            *due = now;
        }
        *due += Duration::from_secs_f64(1.0 / source.frames_per_second);
        answer.readings.resize(source.readings(), 0.0);
        match source.next_frame(&mut answer.readings) {
            Ok(time_s) => answer.time_s = time_s,
            Err(error) => return SessionEvent::End(Err(error.into())),
        }
        (answer.first_row, answer.read_at) = (Some(0), Some(Instant::now()));
        SessionEvent::Answer
    }
}

/// Lines of a stream.
#[derive(Debug)]
pub struct LineInput {
    /// The source.
    pub source: Source,
    /// Lines, before they are parsed.
    pub lines: Lines,
    parser: LineParser,
    /// Time at which reading began, from which times are counted.
    pub begun: Instant,
    has_stepped_back: bool,
}

impl LineInput {
    /// Opens `source`; `parser` reads its lines, of which the latest `kept` are kept if they are not all taken.
    pub(super) fn open(source: &Source, parser: LineParser, kept: usize) -> Result<Self, SessionError> {
        let opened = source.clone();
        let open = move || opened.open().map_err(io::Error::other);
        let lines = Lines::spawn(open, source.keeping(), source.begins_anywhere());
        let mut lines = lines.map_err(SessionError::Reader)?;
        lines.set_kept(kept);
        Ok(Self {
            source: source.clone(),
            lines,
            parser,
            begun: Instant::now(),
            has_stepped_back: false,
        })
    }

    pub(super) fn take(&mut self, patience: Duration, answer: &mut Answer, notes: &mut Vec<Note>) -> SessionEvent {
        let line = match self.lines.next(patience) {
            Ok(Some(line)) => line,
            Ok(None) => return SessionEvent::Nothing,
            Err(None) => return SessionEvent::End(Ok(())),
            Err(Some(error)) => {
                let error = error.downcast::<SourceError>().map_or_else(
                    |error| SessionError::Lost(self.source.clone(), error),
                    SessionError::Source,
                );
                return SessionEvent::End(Err(error));
            }
        };
        let number = line.number;
        (answer.line, answer.is_ended, answer.read_at) = (number, line.is_ended, Some(line.read_at));
        answer.time_s = line.read_at.saturating_duration_since(self.begun).as_secs_f64();
        let Some(text) = self.lines.text(&line) else {
            self.parser.count_bad();
            return SessionEvent::Bad(format!("line {number}: it is longer than {LONGEST_LINE} bytes"));
        };
        let (first_row, readings, kept, recorded_s) = match self.parser.parse(number, text) {
            Ok(ParsedLine::NoReadings) => return SessionEvent::Nothing,
            Ok(ParsedLine::Start { is_first }) => {
                notes.extend(is_first.then_some(Note::Start(number)));
                return SessionEvent::Nothing;
            }
            Ok(ParsedLine::Snapshot(readings)) => {
                self.lines.set_kept(1);
                (Some(0), readings, &[][..], None)
            }
            Ok(ParsedLine::Row {
                row_index,
                readings,
                place,
                kept,
                time_s,
            }) => {
                let is_step_back = matches!(place, Some(Place::AfterStepBack(_)));
                if is_step_back && !std::mem::replace(&mut self.has_stepped_back, true) {
                    notes.push(Note::StepBack(number));
                }
                (row_index, readings, kept, time_s)
            }
            // Reading may begin in the middle of a line.
            Err(error) if error.is_final() && !(self.source.begins_anywhere() && number == 1) => {
                return SessionEvent::End(Err(SessionError::Line(self.source.clone(), error)));
            }
            Err(error) => return SessionEvent::Bad(error.to_string()),
        };
        (answer.first_row, answer.recorded_s) = (first_row, recorded_s);
        answer.readings.clear();
        answer.readings.extend_from_slice(readings);
        answer.kept.resize_with(kept.len(), KeptCell::default);
        for (to, from) in answer.kept.iter_mut().zip(kept) {
            // The buffers are reused.
            to.title.clone_from(&from.title);
            to.text.clone_from(&from.text);
        }
        SessionEvent::Answer
    }
}
