//! The decoding thread: a session decodes what its source sends, and the window displays the latest.
//!
//! [`run`] is the loop. [`Command`]s change the session while it runs, and [`LiveEvent`]s report its results. A [`LiveShown`] is
//! sent only after the window has drawn the previous one, so frames do not queue up.

use std::{
    ops::RangeInclusive,
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError, TryRecvError},
    },
    time::{Duration, Instant},
};

use decoupler_core::{
    live::{Drift, LiveError, ZeroGains},
    problem::Problem,
    sensor::SensorModel,
    surface::SurfaceMap,
};
use decoupler_files::{
    export::NetworkFile,
    figure::TargetSurface,
    live::{
        Counts, Fault, History, Motion, Note, Recorded, ReplayState, Session, SessionEvent, SessionPlan, SourcePlan,
        TruthErrors, Watched,
    },
};
use glam::DVec3;
use ndarray::Array2;

use crate::window::{job::Report, test_view::Frame};

/// Frames to be decoded, the network that decodes them, and the folder of recordings.
#[derive(Clone, Debug)]
pub struct LivePlan {
    /// Source and network.
    pub session: SessionPlan,
    /// Folder of the recordings.
    pub recordings: PathBuf,
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
    /// Times in seconds and values of the targets that are displayed, the latest last.
    pub history: Vec<(f64, Arc<[f64]>)>,
    /// All values: of a recording, from its beginning.
    pub all: History,
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

/// What the answers of a session are drawn on.
struct Canvas {
    network: Arc<NetworkFile>,
    /// Surface through the nodes of an array, and z from full compression to rest in millimetres.
    nodes: Option<(Arc<SurfaceMap>, RangeInclusive<f64>)>,
    problem: Arc<Problem>,
    targets: Option<Arc<TargetSurface>>,
}

impl Canvas {
    fn new(network: Arc<NetworkFile>) -> Result<Self, String> {
        let problem = Arc::new(network.problem.clone());
        let nodes = match &problem.sensor {
            None => None,
            Some(simulation) => {
                let (sensor, scene) = (&simulation.sensor, &simulation.scene);
                let rows = scene.rows.read(sensor.scale.rows());
                let rows = rows.map_err(|error| error.to_string())?;
                let (x_mm, y_mm) = sensor.geometry.lattice_mm(sensor.scale, &rows);
                let surface = SurfaceMap::shared(&x_mm, &y_mm).map_err(|error| error.to_string())?;
                let height_mm = sensor.geometry.height_mm;
                Some((surface, height_mm - scene.stroke_mm(&sensor.geometry)..=height_mm))
            }
        };
        let targets = TargetSurface::new(&problem.positions, &problem.targets);
        let targets = targets.ok().filter(|_| !problem.positions.is_empty());
        Ok(Self {
            network,
            nodes,
            targets: targets.map(Arc::new),
            problem,
        })
    }

    /// Draws the last answer, if there is a new one, and the status of decoding.
    fn draw(&self, session: &Session, is_new: bool, shown: &mut LiveShown) {
        if is_new {
            (shown.frame, shown.targets) = (self.frame(session), self.targets(session));
        }
        shown.counts = session.counts();
        shown.recording = session.recording();
        shown.replay = session.replay_state();
    }

    fn frame(&self, session: &Session) -> Option<LiveFrame> {
        let (surface, z_range_mm) = self.nodes.as_ref()?;
        let array = session.array()?;
        let (sensor, rows) = (&array.sensor, &array.rows);
        let frame = |nodes_mm: Arc<[DVec3]>| {
            let z_mm: Vec<f64> = nodes_mm.iter().map(|node| node.z).collect();
            Frame {
                grid_mm: surface.evaluate(&z_mm).into(),
                nodes_mm,
            }
        };
        let actual = session.truth().map(|truth| {
            let nodes_mm = rows.iter().flat_map(|&row| {
                let of_row = truth.row_mm(row).iter().enumerate();
                of_row.map(move |(node, &u)| sensor.displaced_mm(row, node, u))
            });
            frame(nodes_mm.collect())
        });
        let (readings_outside, coordinates_outside) = session.outside();
        Some(LiveFrame {
            time_s: session.time_s()?,
            sensor: *sensor,
            rows: Arc::clone(rows),
            surface: Arc::clone(surface),
            z_range_mm: z_range_mm.clone(),
            decoupled: frame(session.values().chunks_exact(3).map(DVec3::from_slice).collect()),
            actual,
            drops_percent: array.drops_percent(),
            residual: array.residual(session.values()),
            readings_outside,
            coordinates_outside,
            watched: array.watched.clone(),
            errors: session.truth_errors(),
        })
    }

    fn targets(&self, session: &Session) -> Option<LiveTargets> {
        let time_s = session.time_s().filter(|_| self.nodes.is_none())?;
        let (readings_outside, targets_outside) = session.outside();
        Some(LiveTargets {
            problem: Arc::clone(&self.problem),
            network: Arc::clone(&self.network),
            drift: session.drift(),
            surface: self.targets.clone(),
            ranges: session.ranges().to_vec(),
            history: session.history().until(time_s),
            all: session.history().clone(),
            readings_outside,
            targets_outside,
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
pub fn run(mut plan: LivePlan, commands: &Receiver<Command>, report: &Report<LiveEvent>) -> Result<(), String> {
    plan.session.source = plan.session.source.resolved();
    report.send(LiveEvent::Source(plan.session.source.clone()));
    let canvas = Canvas::new(Arc::clone(&plan.session.network))?;
    let session = Session::open(plan.session, &|| !report.is_cancelled());
    let Some(mut session) = session.map_err(|error| error.to_string())? else {
        return Ok(());
    };
    let mut screen = Screen {
        canvas,
        shown: LiveShown::default(),
        has_answer: false,
    };
    let end = decode(&mut session, &mut screen, &plan.recordings, commands, report);
    if let Some(recorded) = session.end_recording() {
        report.send(LiveEvent::Recorded(recorded, None));
    }
    // The last frame stays on the screen.
    screen.show(&session, report);
    end
}

/// What is displayed.
struct Screen {
    canvas: Canvas,
    shown: LiveShown,
    /// True if the session has an answer that is not displayed yet.
    has_answer: bool,
}

impl Screen {
    fn show(&mut self, session: &Session, report: &Report<LiveEvent>) {
        let is_new = std::mem::take(&mut self.has_answer);
        self.canvas.draw(session, is_new, &mut self.shown);
        report.progress(LiveEvent::Shown(Box::new(self.shown.clone())), |_, _| {});
    }
}

fn decode(
    session: &mut Session,
    screen: &mut Screen,
    recordings: &Path,
    commands: &Receiver<Command>,
    report: &Report<LiveEvent>,
) -> Result<(), String> {
    let mut is_drawn = true;
    let mut has_news = false;
    let mut shown = Instant::now().checked_sub(BETWEEN_SHOWN);
    while !report.is_cancelled() {
        let now = Instant::now();
        let may_show_at = shown.map_or(now, |shown| shown + BETWEEN_SHOWN);
        if has_news && is_drawn && may_show_at <= now {
            screen.show(session, report);
            (has_news, is_drawn, shown) = (false, false, Some(now));
        }
        let mut until = session.due(now).unwrap_or(now + LONGEST_WAIT);
        if has_news && is_drawn {
            until = until.min(may_show_at);
        }
        // A stream waits for its lines instead.
        let command = if until <= now || session.is_stream() {
            commands.try_recv().map_err(|error| match error {
                TryRecvError::Empty => RecvTimeoutError::Timeout,
                TryRecvError::Disconnected => RecvTimeoutError::Disconnected,
            })
        } else {
            commands.recv_timeout(until - now)
        };
        match command {
            Ok(Command::Drawn) => is_drawn = true,
            Ok(command) => {
                apply(session, command, recordings, report)?;
                has_news = true;
            }
            Err(RecvTimeoutError::Timeout) => match session.next(Instant::now(), BETWEEN_LOOKS) {
                SessionEvent::Answer => {
                    session.count();
                    (has_news, screen.has_answer) = (true, true);
                }
                SessionEvent::Bad(_) => {
                    has_news = true;
                    // Readings without an answer cannot be drawn.
                    screen.has_answer &= session.has_answer();
                }
                SessionEvent::Nothing => has_news |= session.falls_silent(Instant::now()),
                SessionEvent::End(end) => return end.map_err(|error| error.to_string()),
            },
            Err(RecvTimeoutError::Disconnected) => break,
        }
        for note in session.notes() {
            if let Note::RecordingEnded(recorded, reason) = note {
                report.send(LiveEvent::Recorded(recorded, Some(reason)));
            }
        }
    }
    Ok(())
}

fn apply(session: &mut Session, command: Command, recordings: &Path, report: &Report<LiveEvent>) -> Result<(), String> {
    let now = Instant::now();
    match command {
        Command::Drawn => {}
        Command::Move(motion) => {
            if let Some(simulated) = session.simulated() {
                simulated.set_motion(motion);
            }
        }
        Command::Break(fault) => {
            let broken = session.simulated().map(|simulated| simulated.set_fault(fault));
            broken.transpose().map_err(|error| error.to_string())?;
        }
        Command::Zero => {
            if let Some(array) = session.array_mut() {
                report.send(LiveEvent::Zeroed(array.take_zero().map_err(|error| error.to_string())));
            }
        }
        Command::UseZero(zero) => {
            if let Some(array) = session.array_mut() {
                array.use_zero(zero);
            }
        }
        Command::Record => match session.record(recordings) {
            Ok(Some(path)) => report.send(LiveEvent::Recording(path)),
            Ok(None) => {}
            Err(reason) => report.send(LiveEvent::NotRecorded(reason)),
        },
        Command::EndRecording => {
            if let Some(recorded) = session.end_recording() {
                report.send(LiveEvent::Recorded(recorded, None));
            }
        }
        Command::Seek(at_s) => {
            if let Some(replay) = session.replay_mut() {
                replay.seek(at_s, now);
            }
        }
        Command::Speed(speed) => {
            if let Some(replay) = session.replay_mut() {
                replay.set_speed(speed, now);
            }
        }
        Command::Play(is_playing) => {
            if let Some(replay) = session.replay_mut() {
                replay.play(is_playing, now);
            }
        }
    }
    Ok(())
}
