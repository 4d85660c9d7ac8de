use std::{
    collections::VecDeque,
    io::Read,
    ops::ControlFlow,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use decoupler_core::{
    decoupling::{Decoder, ProgramDecoder},
    live::{DriftMonitor, LiveError},
    problem::Problem,
};
use decoupler_files::{
    export::NetworkFile,
    figure::TargetSurface,
    import::{LineParser, ParsedLine},
    live::{Recording, Source},
};
use ndarray::Array3;

use super::{
    frame_source::{Next, SourceLine, SourceLines, open},
    message::{Arrived, Command, LiveEvent, LivePlan, LiveShown, LiveTargets, SourcePlan},
    replay::{RATE_WITHOUT_TIMES, ReplayFrames},
    session::{LiveSession, Tally},
};

/// Length of the history in seconds.
const HISTORY_S: f64 = 20.0;
/// Maximum number of values in the history, over all targets.
const MAX_VALUES: usize = 20_000;

/// A source of samples, and the network of a recording that decodes them.
#[derive(Debug)]
pub(super) struct TargetSession {
    network: Arc<NetworkFile>,
    problem: Arc<Problem>,
    surface: Option<Arc<TargetSurface>>,
    decoder: ProgramDecoder,
    source: TargetSource,
    tally: Tally,
    /// The last sample as received: index of its network, then the readings.
    sample: Vec<f64>,
    answer: Vec<f64>,
    history: VecDeque<(f64, Arc<[f64]>)>,
    ranges: Vec<(f64, f64)>,
    outside: (Option<usize>, usize),
    drift: Result<DriftMonitor, LiveError>,
    has_events: bool,
}

impl TargetSession {
    /// Prepares to decode what `plan` says; `None` if that is no longer wanted.
    pub(super) fn open(plan: &LivePlan, is_wanted: &dyn Fn() -> bool) -> Result<Option<Self>, String> {
        let Some(source) = TargetSource::open(plan, is_wanted)? else {
            return Ok(None);
        };
        let (network, problem) = (Arc::clone(&plan.network), Arc::new(plan.network.problem.clone()));
        let surface = TargetSurface::new(&problem.positions, &problem.targets);
        let surface = surface.ok().filter(|_| !problem.positions.is_empty());
        Ok(Some(Self {
            decoder: network.decoder(),
            source,
            tally: Tally::new(Instant::now()),
            sample: vec![0.0; 1 + problem.feature_count()],
            answer: vec![0.0; problem.targets.len()],
            history: VecDeque::new(),
            ranges: vec![(f64::INFINITY, f64::NEG_INFINITY); problem.targets.len()],
            outside: (None, 0),
            drift: network.drift.clone().map(DriftMonitor::new),
            has_events: false,
            surface: surface.map(Arc::new),
            network,
            problem,
        }))
    }

    fn decode(&mut self, arrived: Arrived) {
        self.has_events = true;
        let (row_index, readings) = (self.sample[0] as usize, &self.sample[1..]);
        let is_answered = self.decoder.decode_row(row_index, readings, &mut self.answer) == Ok(());
        if !is_answered || self.answer.iter().any(|value| !value.is_finite()) {
            let reason = "readings so far from the training range that the network has no answer";
            self.tally.bad(format!("sample at {:.3} s: {reason}", arrived.time_s));
            return;
        }
        if let Ok(drift) = &mut self.drift {
            // Live does not show when a drift began.
            drift.take(0, readings);
        }
        let network = self.network.network.at(row_index);
        let inputs = network.inputs();
        let readings = inputs.range();
        let readings = readings.map(|range| range.outside(inputs.quantity(), &self.sample[1..]).count());
        self.outside = (readings, network.outputs().far_outside(&self.answer).count());
        for ((low, high), &value) in self.ranges.iter_mut().zip(&self.answer) {
            (*low, *high) = (low.min(value), high.max(value));
        }
        // Seeking backwards clears the history.
        if self.history.back().is_some_and(|(time_s, _)| *time_s > arrived.time_s) {
            self.history.clear();
        }
        self.history.push_back((arrived.time_s, self.answer.as_slice().into()));
        let max_length = (MAX_VALUES / self.answer.len().max(1)).max(2);
        let is_old = |(time_s, _): &(f64, Arc<[f64]>)| *time_s < arrived.time_s - HISTORY_S;
        while self.history.len() > max_length || self.history.front().is_some_and(is_old) {
            self.history.pop_front();
        }
        self.tally.good(arrived.read_at, Instant::now(), None);
    }
}

impl LiveSession for TargetSession {
    fn due(&self, now: Instant) -> Option<Instant> {
        match &self.source {
            TargetSource::Replay(replay) => replay.due(now),
            TargetSource::Stream(_) => Some(now),
        }
    }

    fn is_stream(&self) -> bool {
        matches!(self.source, TargetSource::Stream(_))
    }

    fn has_events(&self) -> bool {
        self.has_events
    }

    fn take_next(&mut self, latest: Instant, _send: &dyn Fn(LiveEvent)) -> Option<Result<(), String>> {
        let patience = latest.saturating_duration_since(Instant::now());
        match self.source.next(patience, &mut self.sample, &mut self.tally) {
            Next::Frame(arrived) => self.decode(arrived),
            Next::Bad(reason) => {
                self.tally.bad(reason);
                self.has_events = true;
            }
            Next::Nothing if self.is_stream() => self.has_events |= self.tally.falls_silent(Instant::now()),
            Next::Nothing => {}
            Next::End(Ok(())) if self.tally.counts().decoded == 0 => {
                let reason = self.tally.counts().last_bad;
                let reason = reason.unwrap_or_else(|| "it has no line of readings".to_owned());
                return Some(Err(format!("no line could be decoded: {reason}")));
            }
            Next::End(end) => return Some(end),
        }
        None
    }

    /// Re-zero, faults and recordings of frames need the model of an array.
    fn apply(&mut self, command: Command, _send: &dyn Fn(LiveEvent)) -> Result<(), String> {
        if let TargetSource::Replay(replay) = &mut self.source {
            let now = Instant::now();
            match command {
                Command::Seek(at_s) => replay.seek(at_s, now),
                Command::Speed(speed) => replay.set_speed(speed, now),
                Command::Play(is_playing) => replay.play(is_playing, now),
                _ => return Ok(()),
            }
            self.has_events = true;
        }
        Ok(())
    }

    fn end_recording(&mut self, _reason: Option<String>, _send: &dyn Fn(LiveEvent)) {}

    fn show(&mut self) -> LiveShown {
        self.has_events = false;
        let latest = self.history.back().map(|(time_s, _)| *time_s);
        LiveShown {
            frame: None,
            targets: latest.map(|_| LiveTargets {
                problem: Arc::clone(&self.problem),
                network: Arc::clone(&self.network),
                drift: self
                    .drift
                    .as_ref()
                    .map(|monitor| monitor.drift().copied())
                    .map_err(Clone::clone),
                surface: self.surface.clone(),
                ranges: self.ranges.clone(),
                history: self.history.iter().cloned().collect(),
                readings_outside: self.outside.0,
                targets_outside: self.outside.1,
            }),
            counts: self.tally.counts(),
            recording: None,
            replay: match (&self.source, latest) {
                (TargetSource::Replay(replay), Some(time_s)) => Some(replay.state(time_s)),
                _ => None,
            },
        }
    }
}

/// Samples for a network of a recording. Each is the index of its network, then the readings in the order of the inputs.
#[derive(Debug)]
pub(super) enum TargetSource {
    Replay(Box<ReplayFrames>),
    Stream(Box<TargetLines>),
}

/// Samples from the lines of a device or socket.
#[derive(Debug)]
pub(super) struct TargetLines {
    lines: SourceLines,
    parser: LineParser,
}

impl TargetSource {
    /// Opens the source of `plan`; `None` if it is no longer wanted.
    pub(super) fn open(plan: &LivePlan, is_wanted: &dyn Fn() -> bool) -> Result<Option<Self>, String> {
        let file = &plan.network;
        Ok(Some(match &plan.source {
            SourcePlan::Simulated { .. } => {
                return Err("a recording has no model to simulate: choose a file or a device as the source".to_owned());
            }
            SourcePlan::Replay {
                path,
                at_s,
                speed,
                is_playing,
            } => {
                let recording = read(file, path, is_wanted);
                if !is_wanted() {
                    return Ok(None);
                }
                let replay = ReplayFrames::new(recording?, *at_s, *speed, *is_playing, Instant::now());
                Self::Replay(Box::new(replay))
            }
            SourcePlan::Stream(source) => {
                let Some(opened) = open(source, is_wanted)? else {
                    return Ok(None);
                };
                Self::Stream(Box::new(TargetLines::new(source, opened, file)?))
            }
        }))
    }

    /// Writes the next sample; a stream waits for it at most for `patience`.
    pub(super) fn next(&mut self, patience: Duration, sample: &mut [f64], tally: &mut Tally) -> Next {
        match self {
            Self::Replay(replay) => match replay.next(sample, tally, Instant::now()) {
                Some(arrived) => Next::Frame(arrived),
                None => Next::Nothing,
            },
            Self::Stream(lines) => lines.next(patience, sample, tally),
        }
    }
}

/// Reads all samples of a file, which come at an even rate.
fn read(file: &NetworkFile, path: &Path, is_wanted: &dyn Fn() -> bool) -> Result<Recording, String> {
    let recipe = file.recorded.as_ref().map(|recorded| recorded.plan.import.clone());
    let watch = &mut |_| {
        if is_wanted() {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    };
    let has_rows = file.network.only().is_none();
    let table = recipe
        .unwrap_or_default()
        .read_inputs(path, &file.problem, has_rows, watch);
    let table = table.map_err(|error| error.to_string())?;
    let mut samples = Vec::with_capacity(table.readings.len() + table.readings.nrows());
    for (sample, readings) in table.readings.rows().into_iter().enumerate() {
        let row_index = match (&file.row_wires, &table.row_wires) {
            _ if !has_rows => 0,
            (Some(read), Some(of_samples)) => {
                let row = of_samples[sample];
                let index = read.iter().position(|read| *read == row);
                index.ok_or_else(|| {
                    let line = table.lines[sample];
                    format!(
                        "'{}', line {line}: there is no network for row {}",
                        path.display(),
                        row + 1
                    )
                })?
            }
            _ => {
                return Err(format!(
                    "'{}' has no column of row-wires, and there is a network for each",
                    path.display()
                ));
            }
        };
        samples.push(row_index as f64);
        samples.extend(readings);
    }
    let shape = (table.readings.nrows(), 1, 1 + table.readings.ncols());
    let samples = Array3::from_shape_vec(shape, samples).expect("each sample has its row and all inputs");
    Recording::at_rate(samples, RATE_WITHOUT_TIMES).map_err(|error| format!("'{}': {error}", path.display()))
}

impl TargetLines {
    fn new(source: &Source, opened: Box<dyn Read + Send>, file: &NetworkFile) -> Result<Self, String> {
        Ok(Self {
            // The latest sample of each row-wire.
            lines: SourceLines::new(source, opened, file.network.values().len())?,
            parser: file.line_parser(false).map_err(|error| error.to_string())?,
        })
    }

    fn next(&mut self, patience: Duration, sample: &mut [f64], tally: &mut Tally) -> Next {
        let next = self.take_line(patience, sample);
        self.lines.count_dropped(tally);
        next
    }

    fn take_line(&mut self, patience: Duration, sample: &mut [f64]) -> Next {
        let SourceLine {
            number,
            arrived,
            text,
            is_fragment,
        } = match self.lines.take(patience) {
            Ok(line) => line,
            Err(next) => return next,
        };
        match self.parser.parse(number, text) {
            Ok(ParsedLine::Row {
                row_index, readings, ..
            }) => {
                sample[0] = row_index.unwrap_or(0) as f64;
                sample[1..].copy_from_slice(readings);
                Next::Frame(arrived)
            }
            Ok(_) => Next::Nothing,
            Err(error) if error.is_final() && !is_fragment => Next::End(Err(self.lines.failed(&error))),
            Err(error) => Next::Bad(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{fmt::Write as _, fs, path::Path, sync::mpsc::channel};

    use decoupler_core::{
        dataset::{Memory, Span},
        evaluation::RunSettings,
        scene::RowModel,
    };
    use decoupler_files::import::{Plan, Recipe, Recorded, Setup};

    use super::*;
    use crate::window::{
        job::Background,
        views::live::engine::{SourcePlan, run},
    };
    use decoupler_core::job::Job;

    /// A network of a recording, and the file that it was trained on.
    fn network(folder: &Path) -> (Arc<NetworkFile>, std::path::PathBuf) {
        let mut text = "time,u1,u2,x (mm)\n".to_owned();
        for row in 0..40 {
            let (u1, u2) = (f64::from(row % 7), f64::from(row % 5));
            writeln!(text, "{row},{u1},{u2},{}", u1 + 2.0 * u2).unwrap();
        }
        let path = folder.join("press.csv");
        fs::write(&path, text).unwrap();
        let plan = Plan {
            import: Recipe {
                data: path.clone(),
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
        let file = NetworkFile::from_run(&run, sets.recorded()).unwrap();
        (Arc::new(file), path)
    }

    fn plan(network: &Arc<NetworkFile>, path: &Path) -> LivePlan {
        LivePlan {
            network: Arc::clone(network),
            simulation: None,
            source: SourcePlan::Replay {
                path: path.to_owned(),
                at_s: 0.0,
                speed: 1.0,
                is_playing: false,
            },
            noise: 0.0,
            zero: None,
            recordings: std::path::PathBuf::new(),
        }
    }

    #[test]
    fn a_replayed_file_is_decoded_by_the_names_of_its_columns() {
        let folder = tempfile::tempdir().unwrap();
        let (network, _) = network(folder.path());
        // Other columns before and between, in another order.
        let path = folder.path().join("other.csv");
        fs::write(&path, "note,u2,u1\n1,2,3\n1,4,6\n").unwrap();
        let mut session = TargetSession::open(&plan(&network, &path), &|| true).unwrap().unwrap();
        assert!(session.take_next(Instant::now(), &|_| ()).is_none());
        let shown = session.show();
        let mut expected = [0.0];
        let mut decoder = network.decoder();
        decoder.decode_row(0, &[3.0, 2.0], &mut expected).unwrap();
        let targets = shown.targets.unwrap();
        assert_eq!(targets.values(), expected);
        assert_eq!(targets.problem.targets[0].title(), "x (mm)");
        assert_eq!((shown.counts.decoded, shown.replay.unwrap().length_s), (1, 0.02));
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
        let file = NetworkFile {
            problem: trained.problem(),
            recorded: Some(Recorded {
                plan: Plan {
                    import,
                    ..Plan::default()
                },
                ..network(folder.path()).0.recorded.clone().unwrap()
            }),
            ..NetworkFile::clone(&network(folder.path()).0)
        };
        fs::write(&path, text).unwrap();
        let of_training = |sample: usize| trained.set.sample_readings(sample).to_vec();
        let mut tally = Tally::new(Instant::now());
        let mut found = [0.0; 3];
        let replayed = read(&file, &path, &|| true).unwrap();
        let source: Source = path.display().to_string().parse().unwrap();
        let mut stream = TargetLines::new(&source, Box::new(fs::File::open(&path).unwrap()), &file).unwrap();
        for sample in 0..600 {
            assert_eq!(
                replayed.frame_ohm(sample).row(0).to_vec()[1..],
                of_training(sample),
                "sample {sample}"
            );
            while !matches!(
                stream.next(Duration::from_secs(60), &mut found, &mut tally),
                Next::Frame(_)
            ) {}
            assert_eq!(found[1..], of_training(sample), "sample {sample}");
        }
    }

    #[test]
    fn a_file_without_an_input_is_refused_and_the_input_named() {
        let folder = tempfile::tempdir().unwrap();
        let (network, _) = network(folder.path());
        let path = folder.path().join("other.csv");
        fs::write(&path, "u2,v\n1,2\n").unwrap();
        let message = TargetSession::open(&plan(&network, &path), &|| true).unwrap_err();
        assert!(message.contains("u1"), "{message}");
    }

    #[test]
    fn the_loop_decodes_a_network_of_a_recording() {
        let folder = tempfile::tempdir().unwrap();
        let (network, path) = network(folder.path());
        let plan = plan(&network, &path);
        let (commands, incoming) = channel();
        let (woke, wakes) = channel();
        let mut job: Background<LiveEvent> = Background::prompt("live", Arc::new(move || woke.send(()).unwrap_or(())));
        job.start(
            move |report| run(plan, &incoming, report),
            |ended| LiveEvent::Ended(ended.unwrap_or_else(|error| Err(error.to_string()))),
        );
        let shown = loop {
            match job.next_event() {
                Some(LiveEvent::Shown(shown)) if shown.has_answer() => break shown,
                Some(LiveEvent::Ended(ended)) => panic!("{ended:?}"),
                Some(_) => {}
                None => wakes.recv_timeout(std::time::Duration::from_secs(60)).unwrap(),
            }
        };
        assert!(shown.frame.is_none() && shown.targets.unwrap().values().len() == 1);
        drop(commands);
    }
}
