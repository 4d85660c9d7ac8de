use std::{
    io,
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant},
};

use decoupler_core::{
    dataset::{DatasetError, Seed},
    decoupling::{Decoder, ProgramDecoder},
    job::Job,
    live::{Drift, DriftMonitor, FaultEvent, FaultyWire, LiveError, ZeroGains},
    scene::{Noise, Scene},
    sensor::{SensorError, short},
};
use thiserror::Error;

use super::{
    FaultError, History, Input, Keeping, LineInput, LiveArray, Recorded, Recording, RecordingFile, Replay, Simulated,
    Source, SourceError, SourcePlan, Tally, Watched,
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
    /// Gains of the unloaded state by which the readings of whole frames are divided, if it was taken before.
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
    /// The source.
    pub input: Input,
    /// The array whose frames are decoded; `None` for a network of a recording.
    pub array: Option<LiveArray>,
    /// The last answer, which later readings without one leave as it is.
    pub last: Answer,
    /// Number of answers, and their times.
    pub tally: Tally,
    /// Events besides the answers, for the caller to remove.
    pub notes: Vec<Note>,
    /// Recording of the frames of the array in progress, which ends when it is dropped.
    pub recording: Option<RecordingFile>,
    /// Values of a network of a recording.
    pub history: History,
    /// Monitor of the drift of the readings, or the reason why they are not monitored.
    pub monitor: Result<DriftMonitor, LiveError>,
    /// Smallest and largest of the values of each target so far.
    pub ranges: Vec<(f64, f64)>,
    network: Arc<NetworkFile>,
    decoder: ProgramDecoder,
    unit: Unit,
    /// Latest readings.
    arrived: Answer,
    is_row_missing: bool,
}

/// Readings of a line, sample or frame, and their answer.
#[derive(Clone, Debug, Default)]
pub struct Answer {
    /// Number of the line, from 1; 0 if it is not of a stream.
    pub line: u64,
    /// Index of the row-wire or network with which the readings begin; `None` if it is unknown.
    pub first_row: Option<usize>,
    /// Readings: rows × channels.
    pub readings: Vec<f64>,
    /// Cells of the line that are copied to the output.
    pub kept: Vec<KeptCell>,
    /// Time in its source, in seconds.
    pub time_s: f64,
    /// The answer: rows × targets.
    pub values: Vec<f64>,
    /// Wire that it was decoded without.
    pub left_out: Option<FaultyWire>,
    /// Time at which its last byte was read, or at which it was simulated or due.
    pub(super) read_at: Option<Instant>,
    /// False for a last line without a line break.
    pub(super) is_ended: bool,
    /// Time of the line in seconds, if it has a time.
    pub(super) recorded_s: Option<f64>,
    /// True for a sample of a replay that was answered before.
    pub(super) is_repeated: bool,
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
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Note {
    /// Lines from here on are not decoded.
    #[error("line {0}: the lines at the start give the means of derived columns and are not decoded")]
    Start(u64),
    /// The time steps back for the first time.
    #[error(
        "line {0}: the time steps back: the history of readings restarts here and at every further step back; send the lines \
         in order of time"
    )]
    StepBack(u64),
    /// The wires cannot be checked.
    #[error(
        "line {0}: wires are not checked for faults, because the line has no row number; add a column named row, or send \
         whole snapshots in one line"
    )]
    NoRow(u64),
    /// The state of the wires has changed.
    #[error("line {0}: {1}{after}", after = consequence(.1))]
    Fault(u64, FaultEvent),
    /// A drift has begun or ended.
    #[error("line {0}: the drift of the readings has changed")]
    Drift(u64, Drift),
    /// The recording has ended by itself.
    #[error("{1}")]
    RecordingEnded(Recorded, String),
}

/// Returns what follows from a fault for the answers.
fn consequence(event: &FaultEvent) -> &'static str {
    match event {
        FaultEvent::Named { .. } => {
            "; left out from here on; frames are decoded from the other readings by the Gauss-Newton method"
        }
        FaultEvent::Unexplained => {
            ", and no single-wire fault explains them: the answers may be wrong; check the wiring, the geometry and the \
             order of the rows"
        }
        FaultEvent::Recovered => "; all wires are used",
    }
}

/// Reason why a session cannot begin or continue.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SessionError {
    /// The source cannot be opened.
    #[error(transparent)]
    Source(#[from] SourceError),
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
    /// The array does not have the wires of a simulated fault.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// The rate of a simulated source is out of range.
    #[error("{} frames per second: give a number above 0 and at most 1000000", short(*.0))]
    Rate(f64),
    /// The array has no resistance.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// The scene is invalid, the array does not have its rows, or the lines cannot be read for the network.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

/// Readings so far from the training range that they have no answer.
const NO_ANSWER: &str =
    "the readings are so far outside the training range that the network's output is not a finite number";

impl Session {
    /// Opens the source of `plan`. A stream is opened on its own thread, and reported as ended if that fails; reading a file to
    /// be replayed stops when `job` is cancelled.
    ///
    /// # Errors
    /// If the source cannot be simulated or replayed, or the array has no resistance.
    pub fn open(plan: SessionPlan, job: &Job<'_>) -> Result<Self, SessionError> {
        let (network, noise, mut tally) = (plan.network, plan.noise, Tally::default());
        let sensor = network.problem.sensor.as_ref();
        let scene = sensor.map_or_else(Scene::default, |simulation| Scene {
            noise,
            ..simulation.scene
        });
        let array = sensor.map(|simulation| LiveArray::new(&simulation.sensor, &scene, plan.zero));
        let array = array.transpose()?;
        let input = match &plan.source {
            SourcePlan::Simulated(frames_per_second) => {
                let sensor = &array.as_ref().ok_or(SessionError::NoModel)?.sensor;
                let source = Simulated::new(sensor, &scene, Seed(0), *frames_per_second)?;
                Input::Simulated(Box::new(source), Instant::now())
            }
            SourcePlan::Replay(path) => {
                let recording = Recording::read(path, &network, &mut tally, job)?;
                Input::Replay(Box::new(Replay::new(recording, array.is_none(), Instant::now())))
            }
            SourcePlan::Stream(source) => {
                let parser = network.line_parser(plan.unit == Unit::Frames, source.keeping() == Keeping::All)?;
                let rows = array.as_ref().map(|array| array.rows.len());
                let lines = LineInput::open(source, parser, rows.unwrap_or(network.network.values().len()))?;
                Input::Lines(Box::new(lines))
            }
        };
        Ok(Self {
            input,
            array,
            tally,
            notes: Vec::new(),
            history: History::default(),
            ranges: vec![(f64::INFINITY, f64::NEG_INFINITY); network.problem.targets.len()],
            decoder: network.decoder(),
            monitor: network.drift.clone().map(DriftMonitor::new),
            network,
            unit: plan.unit,
            arrived: Answer::default(),
            last: Answer::default(),
            is_row_missing: false,
            recording: None,
        })
    }

    /// Takes what the source has at `now`; a stream waits for a line at most for `patience`.
    pub fn next(&mut self, now: Instant, patience: Duration) -> SessionEvent {
        let (answer, tally, notes) = (&mut self.arrived, &mut self.tally, &mut self.notes);
        let mut event = self.input.take((now, patience), answer, tally, notes);
        if matches!(event, SessionEvent::Answer) {
            event = self.decode(now);
        }
        match (&event, &self.input) {
            (SessionEvent::Bad(reason), _) => self.tally.bad(reason),
            (SessionEvent::End(Ok(())), Input::Lines(lines)) if self.tally.decoded == 0 => {
                let reason = self.tally.first_bad.clone();
                let reason = reason.unwrap_or_else(|| "it has no line of readings".to_owned());
                return SessionEvent::End(Err(SessionError::NothingDecoded(lines.source.clone(), reason)));
            }
            _ => {}
        }
        event
    }

    /// Decodes the readings that have arrived.
    fn decode(&mut self, now: Instant) -> SessionEvent {
        let Self { arrived, notes, .. } = self;
        let (channels, targets) = (self.decoder.channels(), self.network.problem.targets.len());
        arrived.left_out = None;
        match (&mut self.array, arrived.first_row) {
            (Some(array), Some(first_row)) => {
                let is_whole = array.take(first_row, &arrived.readings);
                if self.unit == Unit::Frames {
                    if !is_whole {
                        return SessionEvent::Nothing;
                    }
                    if let Some(recording) = &mut self.recording
                        && let Err(reason) = recording.record_whole(arrived.time_s, &array.frame_ohm)
                    {
                        notes.push(Note::RecordingEnded(recording.recorded.clone(), reason));
                        self.recording = None;
                    }
                    array.whole();
                    arrived.readings.clone_from(&array.frame_ohm);
                    arrived.first_row = Some(0);
                }
                // No frame is left unchecked if the source waits.
                let waits = matches!(&self.input, Input::Lines(lines) if lines.source.keeping() == Keeping::All);
                if is_whole && let Some(event) = array.check(waits, now) {
                    notes.push(Note::Fault(arrived.line, event));
                }
                let first_row = arrived.first_row.unwrap_or(first_row);
                arrived.left_out = array.decode(first_row, &arrived.readings, &mut arrived.values);
            }
            (Some(array), None) if matches!(array.watched, Watched::Checked(_)) => {
                let is_first = !std::mem::replace(&mut self.is_row_missing, true);
                notes.extend(is_first.then_some(Note::NoRow(arrived.line)));
            }
            _ => {}
        }
        let first_row = arrived.first_row.unwrap_or(0);
        arrived.values.resize(arrived.readings.len() / channels * targets, 0.0);
        let rows = arrived.readings.chunks_exact(channels);
        let mut rows = rows.zip(arrived.values.chunks_exact_mut(targets)).enumerate();
        let is_answered = arrived.left_out.is_some()
            || rows.all(|(row, (readings, values))| {
                let decoded = self.decoder.decode_row(first_row + row, readings, values);
                decoded.is_ok() && values.iter().all(|value| value.is_finite())
            });
        if !is_answered {
            return SessionEvent::Bad(match (&self.input, &self.array) {
                (Input::Lines(_), _) => format!("line {}: {NO_ANSWER}", arrived.line),
                (_, Some(_)) => format!("frame at {:.3} s: {NO_ANSWER}", arrived.time_s),
                (_, None) => format!("sample at {:.3} s: {NO_ANSWER}", arrived.time_s),
            });
        }
        std::mem::swap(&mut self.arrived, &mut self.last);
        if !self.last.is_repeated {
            self.follow();
        }
        SessionEvent::Answer
    }

    /// Takes the last answer into the monitor of drift and the history.
    fn follow(&mut self) {
        let last = &self.last;
        if let Ok(monitor) = &mut self.monitor {
            let rows = last.readings.chunks_exact(self.decoder.channels());
            let drifts = rows.filter_map(|readings| monitor.take(last.line, readings));
            self.notes.extend(drifts.map(|drift| Note::Drift(last.line, drift)));
        }
        if self.unit == Unit::Frames && self.array.is_none() {
            for ((low, high), &value) in self.ranges.iter_mut().zip(&last.values) {
                (*low, *high) = (low.min(value), high.max(value));
            }
            let is_stream = matches!(self.input, Input::Lines(_));
            self.history.push(last.time_s, &last.values, is_stream);
        }
    }

    /// Counts the answer, which has now been used.
    pub fn count(&mut self) {
        let truth = self.input.truth().zip(self.array.as_ref());
        let error_mm = truth.map(|(truth, array)| array.error_mm(&self.last.values, truth));
        let now = Instant::now();
        self.tally.good(self.last.read_at.unwrap_or(now), now, error_mm);
    }

    /// Returns the numbers of readings, except those left out, and of targets of the last answer outside the range seen in
    /// training; the first is `None` if that range is not known.
    pub fn outside(&self) -> (Option<usize>, usize) {
        let answer = &self.last;
        let mut outside = (Some(0), 0);
        let rows = answer.readings.chunks_exact(self.decoder.channels());
        let rows = rows.zip(answer.values.chunks_exact(self.network.problem.targets.len()));
        for (row, (readings, values)) in (answer.first_row.unwrap_or(0)..).zip(rows) {
            let network = self.network.network.at(row);
            let is_used = |channel: &usize| {
                let array = self.array.as_ref();
                array.is_none_or(|array| !array.watched.leaves_out(array.rows[row], *channel))
            };
            let inputs = network.inputs();
            let of_row = inputs
                .range()
                .map(|range| range.outside(inputs.quantity(), readings).filter(is_used).count());
            outside.0 = outside.0.zip(of_row).map(|(sum, count)| sum + count);
            outside.1 += network.outputs().far_outside(values).count();
        }
        outside
    }
}

#[cfg(test)]
mod tests {
    use std::{fmt::Write as _, fs, ops::ControlFlow, path::Path};

    use decoupler_core::{
        dataset::{Memory, Span},
        decoupling::{Decoder, resistance_residual},
        evaluation::{Run, RunSettings},
        scene::RowModel,
    };

    use super::*;
    use crate::import::{Plan, Recipe, Recorded as RecordedFiles, Setup};

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
        SourcePlan::Replay(path.to_owned())
    }

    fn open(plan: SessionPlan) -> Session {
        Session::open(plan, &Job::UNINTERRUPTED).unwrap()
    }

    fn replay_of(session: &mut Session) -> &mut Replay {
        match &mut session.input {
            Input::Replay(replay) => replay,
            other => panic!("{other:?}"),
        }
    }

    /// Goes to a time of the recording and replays from there, on a clock of its own, which jumps from frame to frame; returns
    /// the seconds that it took.
    fn play(session: &mut Session, at_s: f64) -> f64 {
        let start = Instant::now();
        replay_of(session).seek(at_s, start);
        let mut now = start;
        while let Some(due) = session.input.due(now) {
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
            assert!((replay_of(&mut session).state.length_s - length_s).abs() < 1e-6);
            let all = session.history.all();
            let expected_s = |row: usize| 5e3 + time_s(row as u32);
            let differences = all
                .iter()
                .enumerate()
                .map(|(row, (found_s, _))| (found_s - expected_s(row)).abs());
            assert!(all.len() == rows as usize && differences.fold(0.0, f64::max) < 1e-6);
            assert_eq!(session.tally.decoded, u64::from(rows));
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
        replay_of(&mut session).play(false, Instant::now());
        let mut shown = Vec::new();
        for (at_s, decoded) in [(60.0, 61), (10.0, 61), (61.0, 62), (99.0, 100)] {
            play(&mut session, at_s);
            assert_eq!((session.last.time_s, session.history.all().len()), (at_s, decoded));
            shown.push((at_s, session.last.values.clone()));
        }
        let history = session.history.all();
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
        assert_eq!(session.last.values, expected);
        let length_s = replay_of(&mut session).state.length_s;
        assert_eq!((session.tally.decoded, length_s), (1, 0.02));
        fs::write(&path, "u2,v\n1,2\n").unwrap();
        let refused = Session::open(plan(&network, replay(&path)), &Job::UNINTERRUPTED);
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
            problem: trained.problem.clone(),
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
                let now = session.input.due(start).map_or(start, |due| due.max(start));
                while !matches!(session.next(now, Duration::from_secs(600)), SessionEvent::Answer) {}
                let expected = trained.set.sample_readings(sample).to_vec();
                assert_eq!(session.last.readings, expected, "sample {sample}");
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
            ..plan(&network, SourcePlan::Simulated(50.0))
        });
        let mut now = Instant::now();
        let mut decode = |session: &mut Session| {
            // Every frame is checked.
            now = session.input.due(now).unwrap().max(now) + Duration::from_millis(20);
            assert!(matches!(session.next(now, Duration::ZERO), SessionEvent::Answer));
            session.count();
        };
        decode(&mut session);
        let rows = session.last.readings.chunks_exact(12);
        let rows = rows.zip(session.last.values.chunks_exact(12));
        let squares = rows.map(|(ohm, mm)| resistance_residual(&sensor, ohm, mm).powi(2));
        let expected = (squares.sum::<f64>() / 4.0).sqrt();
        assert!((session.array.as_ref().unwrap().residual(&session.last) / expected - 1.0).abs() < 1e-9);

        let fault = "open-column:5".parse().unwrap();
        let Input::Simulated(simulated, _) = &mut session.input else {
            panic!("a simulated source");
        };
        simulated.set_fault(Some(fault)).unwrap();
        (1..20).for_each(|_| decode(&mut session));
        let array = session.array.as_ref().unwrap();
        assert!(array.watched.wire().is_some(), "{:?}", array.watched);
        let residual = array.residual(&session.last);
        assert!(residual < 3e-3, "{residual}");
        let mut by_all = vec![0.0; session.last.values.len()];
        session.decoder.decode(&session.last.readings, &mut by_all).unwrap();
        let truth = session.input.truth().unwrap();
        let [by_all, left_out] = [&by_all, &session.last.values].map(|answer| array.error_mm(answer, truth));
        assert!(left_out < by_all, "{left_out} and {by_all}");
    }
}
