//! The decoding thread: a session decodes what its source sends, and the window displays the latest.
//!
//! [`run`] is the loop. [`Command`]s change the session while it runs, and [`LiveEvent`]s report its results. A [`LiveShown`] is
//! sent only after the window has drawn the previous one, so frames do not queue up.

use std::{
    ops::RangeInclusive,
    path::PathBuf,
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError},
    },
    time::{Duration, Instant},
};

use decoupler_core::{
    job::Job,
    live::{Drift, LiveError, ZeroGains},
    sensor::SensorModel,
    surface::SurfaceMap,
};
use decoupler_files::{
    export::NetworkFile,
    figure::TargetSurface,
    live::{
        History, Input, LiveArray, Note, Recorded, ReplayState, Session, SessionEvent, SessionPlan, SourcePlan, Tally,
        Watched,
    },
};
use glam::DVec3;
use ndarray::Array2;

use crate::window::{job::Report, test_view::Frame};

/// Message to the thread.
pub enum Command {
    /// The last frame was drawn: send the next one.
    Drawn,
    /// Change the session, and send the event that this returns.
    Change(Change),
}

/// Change of the session.
pub type Change = Box<dyn FnOnce(&mut Session) -> Option<LiveEvent> + Send>;

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
    /// A change has failed, with the reason.
    Failed(String),
    /// Decoding has ended, with the reason if it could not continue.
    Ended(Result<(), String>),
}

/// State of decoding.
#[derive(Clone, Debug, Default)]
pub struct LiveShown {
    /// The last frame of an array with an answer; `None` before the first.
    pub frame: Option<LiveFrame>,
    /// The last sample with an answer, of a network of a recording; `None` before the first.
    pub targets: Option<LiveTargets>,
    /// Readings of this frame or sample outside the range seen in training, `None` if that is not known, and targets far outside.
    pub outside: (Option<usize>, usize),
    /// Number of frames and their times.
    pub counts: Tally,
    /// The recording under way.
    pub recording: Option<Recorded>,
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
    /// The network, which describes the targets and may have prediction intervals.
    pub network: Arc<NetworkFile>,
    /// Present drift of the readings, or the reason why they are not monitored.
    pub drift: Result<Option<Drift>, LiveError>,
    /// Surface through the targets, if they have positions.
    pub surface: Option<Arc<TargetSurface>>,
    /// Smallest and largest value of each target so far.
    pub ranges: Vec<(f64, f64)>,
    /// Times in seconds and values of the targets that are displayed, the latest last.
    pub history: Vec<(f64, Arc<[f64]>)>,
    /// All values: of a recording, from its beginning.
    pub all: History,
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
    /// Faults of wires.
    pub watched: Watched,
}

/// What is displayed, and what the answers of a session are drawn on.
struct Screen {
    network: Arc<NetworkFile>,
    /// Surface through the nodes of an array, and z from full compression to rest in millimetres.
    nodes: Option<(Arc<SurfaceMap>, RangeInclusive<f64>)>,
    targets: Option<Arc<TargetSurface>>,
    shown: LiveShown,
    /// True if the session has an answer that is not displayed yet.
    has_answer: bool,
}

impl Screen {
    fn new(network: Arc<NetworkFile>) -> Result<Self, String> {
        let problem = &network.problem;
        let mut nodes = None;
        if let Some(simulation) = &problem.sensor {
            let (sensor, scene) = (&simulation.sensor, &simulation.scene);
            let rows = scene
                .rows
                .read(sensor.scale.rows())
                .map_err(|error| error.to_string())?;
            let (x_mm, y_mm) = sensor.geometry.lattice_mm(sensor.scale, &rows);
            let surface = SurfaceMap::shared(&x_mm, &y_mm).map_err(|error| error.to_string())?;
            let height_mm = sensor.geometry.height_mm;
            nodes = Some((surface, height_mm - scene.stroke_mm(&sensor.geometry)..=height_mm));
        }
        let targets = TargetSurface::new(&problem.positions, &problem.targets);
        Ok(Self {
            nodes,
            targets: targets.ok().filter(|_| !problem.positions.is_empty()).map(Arc::new),
            network,
            shown: LiveShown::default(),
            has_answer: false,
        })
    }

    /// Displays the last answer, if there is a new one, and the status of decoding.
    fn show(&mut self, session: &Session, report: &Report<LiveEvent>) {
        if std::mem::take(&mut self.has_answer) {
            let drift = session.monitor.as_ref();
            let frame = session.array.as_ref().and_then(|array| self.frame(session, array));
            self.shown.targets = frame.is_none().then(|| LiveTargets {
                network: Arc::clone(&self.network),
                drift: drift.map(|monitor| monitor.drift().copied()).map_err(Clone::clone),
                surface: self.targets.clone(),
                ranges: session.ranges.clone(),
                history: session.history.until(session.last.time_s),
                all: session.history.clone(),
            });
            (self.shown.frame, self.shown.outside) = (frame, session.outside());
        }
        self.shown.counts = session.tally.clone();
        self.shown.recording = session.recording.as_ref().map(|file| file.recorded.clone());
        if let Input::Replay(replay) = &session.input {
            self.shown.replay = Some(replay.state);
        }
        report.progress(LiveEvent::Shown(Box::new(self.shown.clone())), |_, _| {});
    }

    fn frame(&self, session: &Session, array: &LiveArray) -> Option<LiveFrame> {
        let (surface, z_range_mm) = self.nodes.as_ref()?;
        let (sensor, answer) = (&array.sensor, &session.last);
        let frame = |nodes_mm: Arc<[DVec3]>| {
            let z_mm: Vec<f64> = nodes_mm.iter().map(|node| node.z).collect();
            Frame {
                grid_mm: surface.evaluate(&z_mm).into(),
                nodes_mm,
            }
        };
        let actual = session.input.truth().map(|truth| {
            let nodes_mm = array.rows.iter().flat_map(|&row| truth.row_positions_mm(sensor, row));
            frame(nodes_mm.collect())
        });
        Some(LiveFrame {
            time_s: answer.time_s,
            sensor: *sensor,
            rows: Arc::clone(&array.rows),
            surface: Arc::clone(surface),
            z_range_mm: z_range_mm.clone(),
            decoupled: frame(answer.values.chunks_exact(3).map(DVec3::from_slice).collect()),
            actual,
            drops_percent: array.drops_percent(&answer.readings),
            residual: array.residual(answer),
            watched: array.watched.clone(),
        })
    }
}

/// Minimum time between displayed frames.
const BETWEEN_SHOWN: Duration = Duration::from_micros(16_600);
/// Maximum wait for a line of a device between checks for commands.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// Maximum wait for a command while the source is paused.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// Runs `plan` until its source ends, the sender of the commands is gone, or the work is cancelled.
///
/// # Errors
/// If decoding cannot begin or continue, with the reason.
pub fn run(mut plan: SessionPlan, commands: &Receiver<Command>, report: &Report<LiveEvent>) -> Result<(), String> {
    plan.source = plan.source.resolved();
    report.send(LiveEvent::Source(plan.source.clone()));
    let mut screen = Screen::new(Arc::clone(&plan.network))?;
    let mut session = match Session::open(plan, &Job::new(&|| report.is_cancelled())) {
        Err(_) if report.is_cancelled() => return Ok(()),
        opened => opened.map_err(|error| error.to_string())?,
    };
    let (mut is_drawn, mut has_news, mut may_show_at) = (true, false, Instant::now());
    let end = loop {
        if report.is_cancelled() {
            break Ok(());
        }
        let now = Instant::now();
        if has_news && is_drawn && may_show_at <= now {
            screen.show(&session, report);
            (has_news, is_drawn, may_show_at) = (false, false, now + BETWEEN_SHOWN);
        }
        let mut until = session.input.due(now).unwrap_or(now + LONGEST_WAIT);
        if has_news && is_drawn {
            until = until.min(may_show_at);
        }
        match commands.recv_timeout(until.saturating_duration_since(now)) {
            Ok(Command::Drawn) => is_drawn = true,
            Ok(Command::Change(change)) => {
                has_news = true;
                change(&mut session).into_iter().for_each(|event| report.send(event));
            }
            Err(RecvTimeoutError::Timeout) => match session.next(Instant::now(), BETWEEN_LOOKS) {
                SessionEvent::Answer => {
                    session.count();
                    (has_news, screen.has_answer) = (true, true);
                }
                SessionEvent::Bad(_) => {
                    has_news = true;
                    // The truth is that of a frame without an answer.
                    screen.has_answer &= session.input.truth().is_none();
                }
                SessionEvent::Nothing => {
                    let is_stream = matches!(session.input, Input::Lines(_));
                    has_news |= is_stream && session.tally.falls_silent(Instant::now());
                }
                SessionEvent::End(end) => break end.map_err(|error| error.to_string()),
            },
            Err(RecvTimeoutError::Disconnected) => break Ok(()),
        }
        for note in session.notes.drain(..) {
            if let Note::RecordingEnded(recorded, reason) = note {
                report.send(LiveEvent::Recorded(recorded, Some(reason)));
            }
        }
    };
    if let Some(file) = session.recording.take() {
        report.send(LiveEvent::Recorded(file.recorded, None));
    }
    // The last frame stays on the screen.
    screen.show(&session, report);
    end
}
