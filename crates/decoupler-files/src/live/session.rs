use std::{
    io,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use decoupler_core::{
    dataset::DatasetError,
    live::{Drift, FaultEvent, FaultyWire, LiveError, ZeroGains},
    scene::{Deformation, Noise, Scene, SceneError},
    sensor::SensorError,
};
use thiserror::Error;

use super::{
    Counts, History, Keeping, Latencies, LiveArray, Recorded, Replay, ReplayState, Simulated, SimulatedError, Source,
    SourceError, SourcePlan, TruthErrors, Watched,
    decoding::{Decoding, NO_ANSWER},
    input::{Arrived, Input, Taken},
    recording_file::RecordingFile,
    replay::Due,
    tally::Tally,
};
use crate::{
    export::NetworkFile,
    import::{ImportError, KeptCell, LineError},
    machine::system_cause,
};

/// Frames to be decoded, and the network that decodes them.
#[derive(Clone, Debug)]
pub struct SessionPlan {
    /// The network.
    pub network: Arc<NetworkFile>,
    /// Source of the frames.
    pub source: SourcePlan,
    /// Noise of the readings of an array: a simulated source adds it, and fault detection needs it.
    pub noise: Noise,
    /// Gains of the unloaded state by which the readings of an array are divided, if it was taken before.
    pub zero: Option<ZeroGains>,
    /// What is answered.
    pub unit: Unit,
}

/// What a session answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Every line.
    Lines,
    /// Whole frames of an array, and samples of other sensors, whose answers are kept.
    Frames,
}

/// One live session: a source with the decoder of its readings, the check of its wires, the monitor of their drift, and the
/// recording of its frames.
#[derive(Debug)]
pub struct Session {
    input: Input,
    unit: Unit,
    arrived: Arrived,
    decoding: Decoding,
    /// The array; `None` for a network of a recording.
    array: Option<LiveArray>,
    /// True if every frame is checked, since the source waits.
    checks_all: bool,
    is_row_missing: bool,
    tally: Tally,
    notes: Vec<Note>,
    history: History,
    /// Smallest and largest value of each target so far.
    ranges: Vec<(f64, f64)>,
    /// Number of frames of a replay that were decoded for the history.
    replayed: usize,
    /// Time of the last answer in seconds.
    answered_s: Option<f64>,
    /// True unless the last readings had no answer.
    is_answered: bool,
    recording: Option<RecordingFile>,
}

/// Event of a session.
#[derive(Debug)]
pub enum SessionEvent {
    /// There is an answer.
    Answer,
    /// A line, sample or frame has none, with the reason.
    Bad(String),
    /// Nothing has arrived, or too little for an answer.
    Nothing,
    /// The source has ended, with the reason if it failed.
    End(Result<(), SessionError>),
}

/// Something to be noted besides the answers, with the number of the line, from 1.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// The lines from here on give the means of derived columns and are not decoded.
    Start(u64),
    /// The time steps back for the first time.
    StepBack(u64),
    /// The wires cannot be checked, because the line has no row number.
    NoRow(u64),
    /// The state of the wires has changed.
    Fault(u64, FaultEvent),
    /// A drift has begun or ended.
    Drift(u64, Drift),
    /// The recording has ended by itself, with the reason.
    RecordingEnded(Recorded, String),
}

/// Reason why a session cannot begin or continue.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SessionError {
    /// The source cannot be opened.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// Opening the source failed in an unknown way.
    #[error("opening {0} failed unexpectedly")]
    NotOpened(Source),
    /// No thread could be started.
    #[error("cannot start reading: {}", system_cause(.0))]
    Reader(io::Error),
    /// The source was lost.
    #[error("{}", .0.lost(.1))]
    Lost(Source, io::Error),
    /// No line of the source can be read.
    #[error("{0}: {1}")]
    Line(Source, LineError),
    /// The source has ended without an answer.
    #[error("{0}: no line could be decoded: {1}")]
    NothingDecoded(Source, String),
    /// A file cannot be replayed.
    #[error("cannot replay '{}': {}", .0.display(), .1)]
    Replay(PathBuf, String),
    /// A file cannot be read.
    #[error(transparent)]
    Import(#[from] ImportError),
    /// The network has no sensor model.
    #[error("a recording has no model to simulate: choose a file or a device as the source")]
    NoModel,
    /// The frames cannot be simulated.
    #[error(transparent)]
    Simulated(#[from] SimulatedError),
    /// The array has no resistance.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The array does not have the rows of the scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The lines cannot be read for the network.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

impl Session {
    /// Opens the source of `plan`; `None` if that is no longer wanted.
    ///
    /// # Errors
    /// If the source cannot be opened, or the array has no resistance.
    pub fn open(plan: SessionPlan, is_wanted: &dyn Fn() -> bool) -> Result<Option<Self>, SessionError> {
        let file = plan.network;
        let now = Instant::now();
        let scene = file.problem.sensor.as_ref().map(|simulation| Scene {
            noise: plan.noise,
            ..simulation.scene
        });
        let array = file.problem.sensor.as_ref().zip(scene.as_ref());
        let array = array.map(|(simulation, scene)| (&simulation.sensor, scene));
        let checked = array.map(|(sensor, scene)| LiveArray::new(sensor, scene, plan.zero.clone()));
        let checked = checked.transpose()?;
        let mut tally = Tally::new(now);
        let by_frame = plan.unit == Unit::Frames;
        let input = Input::open(&plan.source, &file, array, by_frame, &mut tally, is_wanted)?;
        let Some(input) = input else { return Ok(None) };
        Ok(Some(Self {
            checks_all: matches!(&input, Input::Lines(lines) if lines.source().keeping() == Keeping::All),
            input,
            unit: plan.unit,
            arrived: Arrived {
                line: 0,
                first_row: None,
                readings: Vec::new(),
                kept: Vec::new(),
                time_s: 0.0,
                read_at: now,
            },
            ranges: vec![(f64::INFINITY, f64::NEG_INFINITY); file.problem.targets.len()],
            decoding: Decoding::new(file),
            array: checked,
            is_row_missing: false,
            tally,
            notes: Vec::new(),
            history: History::default(),
            replayed: 0,
            answered_s: None,
            is_answered: false,
            recording: None,
        }))
    }

    /// Takes what the source has at `now`; a stream waits for a line at most for `patience`.
    pub fn next(&mut self, now: Instant, patience: Duration) -> SessionEvent {
        let Self {
            input,
            arrived,
            tally,
            notes,
            ..
        } = self;
        match input.take(now, patience, arrived, tally, notes) {
            Taken::Readings => self.answer(now),
            Taken::Replayed(due) => self.replay(due, now),
            Taken::Bad(reason) => self.bad(reason),
            Taken::Nothing => SessionEvent::Nothing,
            Taken::End(Ok(())) if self.tally.counts.decoded == 0 => {
                let reason = self.tally.counts.first_bad.clone();
                let reason = reason.unwrap_or_else(|| "it has no line of readings".to_owned());
                let source = match &self.input {
                    Input::Lines(lines) => lines.source().clone(),
                    Input::Simulated(_) | Input::Replay(_) => return SessionEvent::End(Ok(())),
                };
                SessionEvent::End(Err(SessionError::NothingDecoded(source, reason)))
            }
            Taken::End(end) => SessionEvent::End(end),
        }
    }

    fn bad(&mut self, reason: String) -> SessionEvent {
        self.tally.bad(&reason);
        SessionEvent::Bad(reason)
    }

    /// Answers a frame of a replay. The samples for a network of a recording are decoded once and in order, including those that
    /// were not displayed.
    fn replay(&mut self, due: Due, now: Instant) -> SessionEvent {
        let Input::Replay(replay) = &self.input else {
            return SessionEvent::Nothing;
        };
        let keeps = self.array.is_none();
        let last_s = replay.frame_time_s(due.index);
        let first = if keeps {
            self.replayed.min(due.index)
        } else {
            self.tally.counts.dropped += due.missed as u64;
            due.index
        };
        let mut event = SessionEvent::Nothing;
        for index in first..=due.index {
            let Input::Replay(replay) = &self.input else { break };
            self.arrived.first_row = Some(replay.read(index, &mut self.arrived.readings));
            (self.arrived.time_s, self.arrived.read_at) = (replay.frame_time_s(index), now);
            if keeps && index < self.replayed {
                // It has been displayed before.
                if let Some((_, values)) = self.history.at(last_s) {
                    self.decoding.values.clear();
                    self.decoding.values.extend_from_slice(&values);
                }
                (self.answered_s, self.is_answered) = (Some(last_s), true);
                return SessionEvent::Answer;
            }
            event = self.answer(now);
            // The last is counted by the caller.
            if index < due.index && matches!(event, SessionEvent::Answer) {
                self.answered(None);
            }
        }
        self.replayed = self.replayed.max(due.index + 1);
        event
    }

    /// Decodes the readings that have arrived.
    fn answer(&mut self, now: Instant) -> SessionEvent {
        let (line, time_s) = (self.arrived.line, self.arrived.time_s);
        let by_frame = self.is_by_frame();
        let mut is_left_out = false;
        if let Some(array) = &mut self.array {
            let readings = &self.arrived.readings;
            // By frames, every line has its row.
            let first_row = self.arrived.first_row.or(by_frame.then_some(0));
            if let Some(first_row) = first_row {
                let is_whole = array.take(first_row, readings, by_frame);
                if by_frame && !is_whole {
                    return SessionEvent::Nothing;
                }
                if by_frame {
                    array.remember();
                    record(&mut self.recording, time_s, &array.raw_ohm, &mut self.notes);
                }
                if is_whole && let Some(event) = array.check(self.checks_all, now) {
                    self.notes.push(Note::Fault(line, event));
                }
                let (first_row, rows) = match by_frame {
                    true => (0, array.rows.len()),
                    false => (first_row, readings.len() / self.decoding.channels()),
                };
                is_left_out = self.decoding.leave_out(first_row, rows, array);
            } else if matches!(array.watched, Watched::Checked(_)) && !std::mem::replace(&mut self.is_row_missing, true)
            {
                self.notes.push(Note::NoRow(line));
            }
        }
        let (first_row, readings) = match &self.array {
            Some(array) if by_frame => (0, &array.frame_ohm),
            _ => (self.arrived.first_row.unwrap_or(0), &self.arrived.readings),
        };
        self.is_answered = is_left_out || self.decoding.decode(first_row, readings);
        if !self.is_answered {
            let reason = match (&self.input, &self.array) {
                (Input::Lines(_), _) => format!("line {line}: {NO_ANSWER}"),
                (_, Some(_)) => format!("frame at {time_s:.3} s: {NO_ANSWER}"),
                (_, None) => format!("sample at {time_s:.3} s: {NO_ANSWER}"),
            };
            return self.bad(reason);
        }
        let channels = self.decoding.channels();
        if let Ok(monitor) = &mut self.decoding.drift {
            for readings in readings.chunks_exact(channels) {
                if let Some(drift) = monitor.take(line, readings) {
                    self.notes.push(Note::Drift(line, drift));
                }
            }
        }
        if self.unit == Unit::Frames && self.array.is_none() {
            let values = &self.decoding.values;
            for ((low, high), &value) in self.ranges.iter_mut().zip(values) {
                (*low, *high) = (low.min(value), high.max(value));
            }
            self.history.push(time_s, values, self.is_stream());
        }
        self.answered_s = Some(time_s);
        SessionEvent::Answer
    }

    /// Returns `true` if only whole frames are decoded.
    fn is_by_frame(&self) -> bool {
        self.unit == Unit::Frames && self.array.is_some()
    }

    /// Counts the answer, which has now been used.
    pub fn count(&mut self) {
        let truth = self.input.truth();
        let error_mm = truth.zip(self.array.as_mut());
        let error_mm = error_mm.map(|(truth, array)| array.compare(&mut self.decoding, truth));
        self.answered(error_mm);
    }

    fn answered(&mut self, error_mm: Option<f64>) {
        self.tally.good(self.arrived.read_at, Instant::now(), error_mm);
    }

    /// Returns the time at which the next frame of a timed source is due, `now` for a stream, and `None` while it is paused.
    pub fn due(&self, now: Instant) -> Option<Instant> {
        self.input.due(now)
    }

    /// Returns `true` for a stream, whose lines are waited for.
    pub fn is_stream(&self) -> bool {
        matches!(self.input, Input::Lines(_))
    }

    /// Returns `true` once, when no line of a stream has come for two seconds.
    pub fn falls_silent(&mut self, now: Instant) -> bool {
        self.is_stream() && self.tally.falls_silent(now)
    }

    /// Returns the number of bytes that have arrived since the last end of a line.
    pub fn unended(&self) -> usize {
        match &self.input {
            Input::Lines(lines) => lines.lines.unended(),
            Input::Simulated(_) | Input::Replay(_) => 0,
        }
    }

    /// Removes the notes since the last call.
    pub fn notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    /// Returns the number of answers, and the times.
    pub fn counts(&self) -> Counts {
        let mut counts = self.tally.counts();
        if let Input::Lines(lines) = &self.input {
            counts.dropped = lines.lines.dropped();
        }
        counts
    }

    /// Returns the number of malformed lines, and of frames that could not be decoded.
    pub fn bad_lines(&self) -> u64 {
        self.tally.counts.bad
    }

    /// Returns the times from reading to answering.
    pub fn latencies(&self) -> &Latencies {
        &self.tally.latencies
    }

    /// Returns the number of the line of the last answer, from 1.
    pub fn line(&self) -> u64 {
        self.arrived.line
    }

    /// Returns the time of the last answer in its source, in seconds; `None` before the first.
    pub fn time_s(&self) -> Option<f64> {
        self.answered_s
    }

    /// Returns `true` if there is an answer, and no later readings without one.
    pub fn has_answer(&self) -> bool {
        self.is_answered
    }

    /// Returns the index of the row-wire or network with which the last answer begins, 0 if it is unknown.
    pub fn first_row(&self) -> usize {
        match self.is_by_frame() {
            true => 0,
            false => self.arrived.first_row.unwrap_or(0),
        }
    }

    /// Returns the readings of the last answer: rows × channels.
    pub fn readings(&self) -> &[f64] {
        match &self.array {
            Some(array) if self.is_by_frame() => &array.frame_ohm,
            _ => &self.arrived.readings,
        }
    }

    /// Returns the last answer: rows × targets.
    pub fn values(&self) -> &[f64] {
        &self.decoding.values
    }

    /// Returns the cells of its line that are copied to the output.
    pub fn kept(&self) -> &[KeptCell] {
        &self.arrived.kept
    }

    /// Returns the wire that it was decoded without.
    pub fn left_out(&self) -> Option<FaultyWire> {
        self.decoding.left_out
    }

    /// Returns the numbers of readings, except those left out, and of targets of the last answer outside the range seen in
    /// training; the first is `None` if that range is not known.
    pub fn outside(&self) -> (Option<usize>, usize) {
        let is_left_out = |row: usize, channel| {
            (self.array.as_ref()).is_some_and(|array| array.watched.leaves_out(array.rows[row], channel))
        };
        self.decoding
            .outside(self.first_row(), self.readings(), self.values(), is_left_out)
    }

    /// Returns the values of a network of a recording.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Returns the smallest and largest value of each target so far.
    pub fn ranges(&self) -> &[(f64, f64)] {
        &self.ranges
    }

    /// Returns the present drift of the readings, or the reason why they are not monitored.
    pub fn drift(&self) -> Result<Option<Drift>, LiveError> {
        let monitor = self.decoding.drift.as_ref();
        monitor.map(|monitor| monitor.drift().copied()).map_err(Clone::clone)
    }

    /// Returns the array whose frames are decoded; `None` for a network of a recording.
    pub fn array(&self) -> Option<&LiveArray> {
        self.array.as_ref()
    }

    /// Returns the array, to re-zero it.
    pub fn array_mut(&mut self) -> Option<&mut LiveArray> {
        self.array.as_mut()
    }

    /// Returns the true deformation of the last frame, if it is known.
    pub fn truth(&self) -> Option<&Deformation> {
        self.input.truth()
    }

    /// Returns the errors of the answers, if the truth is known.
    pub fn truth_errors(&self) -> Option<TruthErrors> {
        let array = self.array.as_ref().filter(|_| self.truth().is_some())?;
        Some(array.truth_errors(self.tally.error_mm()))
    }

    /// Returns the position in a recording.
    pub fn replay_state(&self) -> Option<ReplayState> {
        match &self.input {
            Input::Replay(replay) => Some(replay.state(self.answered_s?)),
            Input::Simulated(_) | Input::Lines(_) => None,
        }
    }

    /// Returns the simulated source, to change its motion and fault.
    pub fn simulated(&mut self) -> Option<&mut Simulated> {
        match &mut self.input {
            Input::Simulated(simulated) => Some(&mut simulated.source),
            Input::Replay(_) | Input::Lines(_) => None,
        }
    }

    /// Returns the replay, to seek, pause or change its speed.
    pub fn replay_mut(&mut self) -> Option<&mut Replay> {
        match &mut self.input {
            Input::Replay(replay) => Some(replay),
            Input::Simulated(_) | Input::Lines(_) => None,
        }
    }

    /// Begins to record the frames of an array to a new file in `folder`, and returns its path; `None` if they are recorded
    /// already.
    ///
    /// # Errors
    /// If the file cannot be created, with the reason.
    pub fn record(&mut self, folder: &Path) -> Result<Option<PathBuf>, String> {
        let Some(array) = self.array.as_ref().filter(|_| self.recording.is_none()) else {
            return Ok(None);
        };
        let recording = RecordingFile::create(folder, &array.rows, array.sensor.scale.columns())?;
        let path = recording.path().to_owned();
        self.recording = Some(recording);
        Ok(Some(path))
    }

    /// Returns the number of frames recorded, and the time from the first to the last, in seconds.
    pub fn recording(&self) -> Option<(u64, f64)> {
        self.recording.as_ref().map(RecordingFile::length)
    }

    /// Ends the recording, if there is one.
    pub fn end_recording(&mut self) -> Option<Recorded> {
        self.recording.take().map(RecordingFile::end)
    }
}

/// Records a frame; if that fails, the recording ends.
fn record(recording: &mut Option<RecordingFile>, time_s: f64, frame_ohm: &[f64], notes: &mut Vec<Note>) {
    let Some(open) = recording else { return };
    if let Err(reason) = open.record(time_s, frame_ohm)
        && let Some(ended) = recording.take()
    {
        notes.push(Note::RecordingEnded(ended.end(), reason));
    }
}

#[cfg(test)]
mod tests {
    use std::{fmt::Write as _, fs, ops::ControlFlow};

    use decoupler_core::{
        dataset::{Memory, Span},
        decoupling::{Decoder, resistance_residual},
        evaluation::{Run, RunSettings},
        job::Job,
        scene::RowModel,
    };

    use super::*;
    use crate::{
        import::{Plan, Recipe, Recorded as RecordedFiles, Setup},
        live::{Fault, Motion},
    };

    /// A network of a recording, trained on a file in `folder`.
    fn network(folder: &Path) -> Arc<NetworkFile> {
        let mut text = "time,u1,u2,x (mm)\n".to_owned();
        for row in 0..40 {
            let (u1, u2) = (f64::from(row % 7), f64::from(row % 5));
            writeln!(text, "{row},{u1},{u2},{}", u1 + 2.0 * u2).unwrap();
        }
        let path = folder.join("trained.csv");
        fs::write(&path, text).unwrap();
        let plan = Plan {
            import: Recipe {
                data: path,
                inputs: vec!["u1".to_owned(), "u2".to_owned()],
                targets: vec!["x".to_owned()],
                time: Some("time".to_owned()),
                ..Recipe::default()
            },
            ..Plan::default()
        };
        let mut settings = RunSettings::measured(RowModel::Shared);
        settings.training.stopping.epochs = 3;
        let setup = Setup::recording(settings, plan);
        let sets = setup.sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ()).unwrap();
        let mut run = sets.run(&setup, None, &Job::UNINTERRUPTED).unwrap();
        while run.step().is_none() {}
        Arc::new(NetworkFile::from_run(&run, sets.recorded()).unwrap())
    }

    fn plan(network: &Arc<NetworkFile>, source: SourcePlan) -> SessionPlan {
        SessionPlan {
            network: Arc::clone(network),
            source,
            noise: Noise::default(),
            zero: None,
            unit: Unit::Frames,
        }
    }

    fn replay(path: &Path) -> SourcePlan {
        SourcePlan::Replay {
            path: path.to_owned(),
            at_s: 0.0,
            speed: 1.0,
            is_playing: true,
        }
    }

    fn open(plan: SessionPlan) -> Session {
        Session::open(plan, &|| true).unwrap().unwrap()
    }

    /// Goes to a time of the recording and replays from there, on a clock of its own, which jumps from frame to frame; returns
    /// the seconds that it took.
    fn play(session: &mut Session, at_s: f64) -> f64 {
        let start = Instant::now();
        session.replay_mut().unwrap().seek(at_s, start);
        let mut now = start;
        while let Some(due) = session.due(now) {
            now = due.max(now);
            assert!(matches!(session.next(now, Duration::ZERO), SessionEvent::Answer));
            session.count();
        }
        (now - start).as_secs_f64()
    }

    #[test]
    fn a_recording_is_replayed_by_its_own_times_and_all_of_its_rows_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let network = network(folder.path());
        let path = folder.path().join("press.csv");
        let even = |row: u32| 0.01 * f64::from(row);
        let uneven = |row: u32| f64::from(row) * 0.1 + f64::from(row / 180);
        let cases: [(u32, &dyn Fn(u32) -> f64); 2] = [(800, &even), (3600, &uneven)];
        for (rows, time_s) in cases {
            let mut text = "time (ms),u1,u2\n".to_owned();
            for row in 0..rows {
                writeln!(text, "{},{},{}", 5e6 + 1e3 * time_s(row), row % 7, row % 5).unwrap();
            }
            fs::write(&path, text).unwrap();
            let mut session = open(plan(&network, replay(&path)));
            let length_s = time_s(rows - 1);
            let took_s = play(&mut session, 0.0);
            assert!((took_s - length_s).abs() < 1e-3, "{took_s} s instead of {length_s} s");
            assert!((session.replay_state().unwrap().length_s - length_s).abs() < 1e-6);
            let all = session.history().all();
            let expected_s = |row: usize| 5e3 + time_s(row as u32);
            let differences = all
                .iter()
                .enumerate()
                .map(|(row, (found_s, _))| (found_s - expected_s(row)).abs());
            assert!(all.len() == rows as usize && differences.fold(0.0, f64::max) < 1e-6);
            assert_eq!(session.counts().decoded, u64::from(rows));
        }
    }

    /// What is skipped is decoded too, in the order of the file, and once.
    #[test]
    fn seeking_in_a_replay_leaves_no_gap_in_its_history() {
        let folder = tempfile::tempdir().unwrap();
        let network = network(folder.path());
        let path = folder.path().join("press.csv");
        let rows = (0..100).map(|row| format!("{row},{},{}\n", row % 7, row % 5));
        fs::write(&path, format!("time,u1,u2\n{}", rows.collect::<String>())).unwrap();
        let mut session = open(plan(&network, replay(&path)));
        session.replay_mut().unwrap().play(false, Instant::now());
        let mut shown = Vec::new();
        for (at_s, decoded) in [(60.0, 61), (10.0, 61), (61.0, 62), (99.0, 100)] {
            play(&mut session, at_s);
            assert_eq!((session.time_s(), session.history().all().len()), (Some(at_s), decoded));
            shown.push((at_s, session.values().to_vec()));
        }
        let history = session.history().all();
        let mut decoder = network.decoder();
        for (row, (time_s, values)) in history.iter().enumerate() {
            let mut expected = [0.0];
            decoder
                .decode_row(0, &[(row % 7) as f64, (row % 5) as f64], &mut expected)
                .unwrap();
            assert_eq!((*time_s, &values[..]), (row as f64, &expected[..]));
        }
        assert!(
            shown
                .iter()
                .all(|(at_s, values)| values[..] == history[*at_s as usize].1[..])
        );
    }

    #[test]
    fn a_replayed_file_is_decoded_by_the_names_of_its_columns() {
        let folder = tempfile::tempdir().unwrap();
        let network = network(folder.path());
        // Other columns before and between, in another order, and no times.
        let path = folder.path().join("other.csv");
        fs::write(&path, "note,u2,u1\n1,2,3\n1,4,6\n").unwrap();
        let mut session = open(plan(&network, replay(&path)));
        assert!(matches!(
            session.next(Instant::now(), Duration::ZERO),
            SessionEvent::Answer
        ));
        session.count();
        let mut expected = [0.0];
        network.decoder().decode_row(0, &[3.0, 2.0], &mut expected).unwrap();
        assert_eq!(session.values(), expected);
        let length_s = session.replay_state().unwrap().length_s;
        assert_eq!((session.counts().decoded, length_s), (1, 0.02));
        fs::write(&path, "u2,v\n1,2\n").unwrap();
        let refused = Session::open(plan(&network, replay(&path)), &|| true);
        let message = refused.unwrap_err().to_string();
        assert!(message.contains("u1"), "{message}");
    }

    /// Three row-wires that share a network take turns, and the time steps back in the middle.
    #[test]
    fn a_replay_and_a_stream_have_the_past_of_training() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("press.csv");
        let mut text = "time,row,u,x\n".to_owned();
        for sample in 0..600_u32 {
            let (time_s, row) = (0.1 * f64::from(sample % 300), sample % 3 + 1);
            writeln!(text, "{time_s},{row},{},1", f64::from(sample).sin()).unwrap();
        }
        fs::write(&path, text.replace(",1\n", ",2\n")).unwrap();
        let import = Recipe {
            data: path.clone(),
            inputs: vec!["u".to_owned()],
            targets: vec!["x".to_owned()],
            time: Some("time".to_owned()),
            row_wire: Some("row".to_owned()),
            memory: Some(Memory {
                lags: vec![Span::Samples(2.0)],
                ..Memory::default()
            }),
            ..Recipe::default()
        };
        let trained = import
            .import(Path::new(""), &mut |_| ControlFlow::Continue(()))
            .unwrap();
        let other = network(folder.path());
        let file = Arc::new(NetworkFile {
            problem: trained.problem(),
            recorded: Some(RecordedFiles {
                plan: Plan {
                    import,
                    ..Plan::default()
                },
                ..other.recorded.clone().unwrap()
            }),
            ..NetworkFile::clone(&other)
        });
        fs::write(&path, text).unwrap();
        let source: Source = path.display().to_string().parse().unwrap();
        for source in [replay(&path), SourcePlan::Stream(source)] {
            let mut session = open(plan(&file, source));
            let start = Instant::now();
            for sample in 0..600 {
                let now = session.due(start).map_or(start, |due| due.max(start));
                while !matches!(session.next(now, Duration::from_secs(60)), SessionEvent::Answer) {}
                let expected = trained.set.sample_readings(sample).to_vec();
                assert_eq!(session.readings(), expected, "sample {sample}");
            }
        }
    }

    fn array() -> Arc<NetworkFile> {
        let mut settings = RunSettings::default();
        settings.simulation_mut().unwrap().sensor.scale = "4x4_3x12".parse().unwrap();
        (settings.simulation_mut().unwrap().samples, settings.hidden) = (200, 6);
        settings.training.stopping.epochs = 10;
        let mut run = Run::prepare(settings).unwrap();
        while run.step().is_none() {}
        Arc::new(NetworkFile::from_run(&run, None).unwrap())
    }

    #[test]
    fn the_residual_equals_the_librarys_and_leaves_out_faulty_wires() {
        let network = array();
        let sensor = network.settings.simulation().unwrap().sensor;
        let mut session = open(SessionPlan {
            noise: Noise::relative(1e-3),
            ..plan(
                &network,
                SourcePlan::Simulated {
                    frames_per_second: 50.0,
                    motion: Motion::Wandering,
                    fault: None,
                },
            )
        });
        let mut now = Instant::now();
        let mut decode = |session: &mut Session| {
            // Every frame is checked.
            now = session.due(now).unwrap().max(now) + Duration::from_millis(20);
            assert!(matches!(session.next(now, Duration::ZERO), SessionEvent::Answer));
            session.count();
        };
        decode(&mut session);
        let rows = session
            .readings()
            .chunks_exact(12)
            .zip(session.values().chunks_exact(12));
        let squares = rows.map(|(ohm, mm)| resistance_residual(&sensor, ohm, mm).powi(2));
        let expected = (squares.sum::<f64>() / 4.0).sqrt();
        assert!((session.array().unwrap().residual(session.values()) / expected - 1.0).abs() < 1e-9);

        let fault = Fault::OpenColumn {
            column: 4,
            before_node: 0,
        };
        session.simulated().unwrap().set_fault(Some(fault)).unwrap();
        (1..20).for_each(|_| decode(&mut session));
        let array = session.array().unwrap();
        assert!(array.watched.wire().is_some(), "{:?}", array.watched);
        let residual = array.residual(session.values());
        assert!(residual < 3e-3, "{residual}");
        let [by_all, left_out] = session.truth_errors().unwrap().since_named_mm.unwrap();
        assert!(left_out < by_all, "{left_out} and {by_all}");
    }
}
