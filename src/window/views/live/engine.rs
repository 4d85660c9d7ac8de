//! The decoding thread: a session decodes what its source sends, and the window displays the latest.
//!
//! [`run`] is the loop. [`Command`]s change the session while it runs. A [`Snapshot`] is sent only after the window has drawn
//! the previous one, so frames do not queue up.

use std::{
    ops::RangeInclusive,
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError},
    },
    time::{Duration, Instant},
};

use decoupler_core::{
    job::Job,
    live::{Drift, LiveError, ZeroGains},
    surface::SurfaceMap,
};
use decoupler_files::{
    export::NetworkFile,
    figure::{
        HeatMap, PlotFigure, TargetSurface, readings_figure,
        surface::{Quantity, Surface},
        targets_over_time_figure,
    },
    live::{
        History, Input, LiveArray, Note, Recorded, ReplayState, Session, SessionEvent, SessionPlan, Tally, Watched,
    },
};
use glam::DVec3;
use ndarray::Array2;

use crate::window::job::Report;

/// Message to the thread.
pub enum Command {
    /// The last snapshot was drawn: send the next one.
    Drawn,
    /// Change the session.
    Change(Change),
}

/// Change of the session, which may fail with a reason.
pub type Change = Box<dyn FnOnce(&mut Session) -> Result<(), String> + Send>;

/// Event from the thread.
#[derive(Debug)]
pub enum LiveEvent {
    /// The latest state.
    Shown(Box<Snapshot>),
    /// A change has failed, or a recording has ended by itself, with the reason.
    Failed(String),
    /// Decoding has ended, with the reason if it could not continue.
    Ended(Result<(), String>),
}

/// State of a session, ready to be drawn.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// The last answer; `None` before the first.
    pub answer: Option<Arc<Answered>>,
    /// Number of answers and their times.
    pub counts: Tally,
    /// The latest recording, possibly of an earlier session.
    pub recorded: Option<Recorded>,
    /// True while it is under way.
    pub is_recording: bool,
    /// Position in the replayed recording.
    pub replay: Option<ReplayState>,
    /// Gains of the unloaded state by which readings are divided.
    pub zero: Option<ZeroGains>,
}

/// One answer, ready to be drawn.
#[derive(Clone, Debug)]
pub struct Answered {
    /// The network, which describes the targets and may have prediction intervals.
    pub network: Arc<NetworkFile>,
    /// Time in its source, in seconds.
    pub time_s: f64,
    /// The decoded values: rows × targets.
    pub values: Vec<f64>,
    /// The decoded surface, and the actual one if it is known; none if the targets have no positions.
    pub surfaces: Vec<Surface>,
    /// Names of the nodes of the surfaces.
    pub nodes: Arc<[String]>,
    /// Readings outside the range seen in training, `None` if that is not known, and targets far outside.
    pub outside: (Option<usize>, usize),
    /// What tells how far the answer can be trusted.
    pub evidence: Evidence,
}

/// What a source shows besides its answers.
#[derive(Clone, Debug)]
pub enum Evidence {
    /// Of an array, whose sensor model explains the readings.
    Array {
        /// Row-wires read, from 0.
        rows: Arc<[usize]>,
        /// The readings as drops from their values without load.
        readings: HeatMap,
        /// Faults of wires.
        watched: Watched,
        /// Root mean square of m/R − 1 over the readings m that are used, R from Eq. (2) at the decoded deformation.
        residual: f64,
        /// Noise of a reading, relative to the reading.
        noise: f64,
    },
    /// Of a network of a recording.
    Targets {
        /// The values over time.
        chart: PlotFigure,
        /// Present drift of the readings, or the reason why they are not monitored.
        drift: Result<Option<Drift>, LiveError>,
        /// All values: of a recording, from its beginning.
        all: History,
    },
}

/// What the answers of a session are drawn on.
enum Ground {
    /// The nodes of an array, and z from full compression to rest in millimetres.
    Nodes(Arc<SurfaceMap>, RangeInclusive<f64>),
    /// Targets with positions.
    Targets(TargetSurface),
    /// Targets without.
    None,
}

/// What is displayed.
struct Screen {
    network: Arc<NetworkFile>,
    noise: f64,
    ground: Ground,
    nodes: Arc<[String]>,
    drops: DropScale,
    shown: Snapshot,
    /// True if the session has an answer that is not displayed yet.
    has_answer: bool,
}

impl Screen {
    fn new(plan: &SessionPlan, shown: Snapshot) -> Result<Self, String> {
        let problem = &plan.network.problem;
        let (ground, nodes) = match &problem.sensor {
            Some(simulation) => {
                let (sensor, scene) = (&simulation.sensor, &simulation.scene);
                let rows = scene.rows.read(sensor.scale.rows());
                let rows = rows.map_err(|error| error.to_string())?;
                let (x_mm, y_mm) = sensor.geometry.lattice_mm(sensor.scale, &rows);
                let map = SurfaceMap::shared(&x_mm, &y_mm).map_err(|error| error.to_string())?;
                let height_mm = sensor.geometry.height_mm;
                let of_row =
                    |row| (1..=sensor.scale.nodes_per_row()).map(move |node| format!("Row {row}, node {node}"));
                let nodes = rows.iter().flat_map(|row| of_row(row + 1)).collect();
                let range_mm = height_mm - scene.stroke_mm(&sensor.geometry)..=height_mm;
                (Ground::Nodes(map, range_mm), nodes)
            }
            None => match TargetSurface::new(&problem.positions, &problem.targets) {
                Ok(surface) if !problem.positions.is_empty() => {
                    let nodes = surface.nodes().iter().map(|node| problem.targets[node.target].title());
                    let nodes = nodes.collect();
                    (Ground::Targets(surface), nodes)
                }
                _ => (Ground::None, Arc::default()),
            },
        };
        Ok(Self {
            network: Arc::clone(&plan.network),
            noise: plan.noise.relative,
            ground,
            nodes,
            drops: DropScale::default(),
            shown,
            has_answer: false,
        })
    }

    /// Takes the length of the recording in progress, which is gone once it has ended.
    fn follow_recording(&mut self, session: &Session) {
        self.shown.is_recording = session.recording.is_some();
        if let Some(file) = &session.recording {
            self.shown.recorded = Some(file.recorded.clone());
        }
    }

    /// Displays the last answer, if there is a new one, and the state of decoding.
    fn show(&mut self, session: &Session, report: &Report<LiveEvent>) {
        if std::mem::take(&mut self.has_answer) {
            self.shown.answer = Some(Arc::new(self.answered(session)));
        }
        self.follow_recording(session);
        self.shown.counts = session.tally.clone();
        self.shown.zero = session.array.as_ref().and_then(|array| array.zero.clone());
        self.shown.replay = match &session.input {
            Input::Replay(replay) => Some(replay.state),
            _ => None,
        };
        report.progress(LiveEvent::Shown(Box::new(self.shown.clone())), |_, _| {});
    }

    fn answered(&mut self, session: &Session) -> Answered {
        let last = &session.last;
        let evidence = match &session.array {
            Some(array) => {
                let drops_percent = array.drops_percent(&last.readings);
                let largest_percent = self.drops.largest_percent(&drops_percent, array);
                Evidence::Array {
                    readings: readings_figure(drops_percent, &array.rows, largest_percent),
                    rows: Arc::clone(&array.rows),
                    watched: array.watched.clone(),
                    residual: array.residual(last),
                    noise: self.noise,
                }
            }
            None => {
                let history = session.history.until(last.time_s);
                let (targets, intervals) = (&self.network.problem.targets, self.network.intervals.as_ref());
                let monitor = session.monitor.as_ref();
                Evidence::Targets {
                    chart: targets_over_time_figure(targets, &history, intervals),
                    drift: monitor.map(|monitor| monitor.drift().copied()).map_err(Clone::clone),
                    all: session.history.clone(),
                }
            }
        };
        Answered {
            network: Arc::clone(&self.network),
            time_s: last.time_s,
            values: last.values.clone(),
            surfaces: self.surfaces(session),
            nodes: Arc::clone(&self.nodes),
            outside: session.outside(),
            evidence,
        }
    }

    fn surfaces(&self, session: &Session) -> Vec<Surface> {
        let values = &session.last.values;
        match (&self.ground, &session.array) {
            (Ground::Nodes(map, range_mm), Some(array)) => {
                let surface = |title: &str, nodes_mm: Vec<DVec3>| {
                    Surface::through(title, map, nodes_mm, Quantity::Height, range_mm.clone())
                };
                let decoded = surface("Decoded", values.chunks_exact(3).map(DVec3::from_slice).collect());
                let actual = session.input.truth().map(|truth| {
                    let rows = array.rows.iter();
                    let nodes_mm = rows.flat_map(|&row| truth.row_positions_mm(&array.sensor, row));
                    surface("Actual", nodes_mm.collect())
                });
                std::iter::once(decoded).chain(actual).collect()
            }
            (Ground::Targets(surface), _) => {
                let [_, decoded, _] = surface.surfaces(values, values, surface.range_of(&session.ranges));
                vec![decoded]
            }
            (Ground::Nodes(..) | Ground::None, _) => Vec::new(),
        }
    }
}

/// Upper limit of the colour scale of the readings. It follows the largest drop in round steps and falls slowly, which
/// keeps colours comparable from frame to frame.
#[derive(Debug, Default)]
struct DropScale {
    peak_percent: f64,
    watched: Option<Watched>,
}

impl DropScale {
    /// Returns the limit in percent with the drops of a frame, of which those of faulty wires do not count.
    fn largest_percent(&mut self, drops_percent: &Array2<f64>, array: &LiveArray) -> f64 {
        /// Decay of the peak per frame.
        const DECAY: f64 = 0.999;
        if self.watched.as_ref() != Some(&array.watched) {
            // Discard the peak that a fault has caused.
            (self.watched, self.peak_percent) = (Some(array.watched.clone()), 0.0);
        }
        let is_healthy = |row: usize, column: usize| !array.watched.leaves_out(array.rows[row], column);
        let drops = drops_percent.indexed_iter();
        let drops = drops.filter(|((row, column), drop)| is_healthy(*row, *column) && drop.is_finite());
        let largest = drops.map(|(_, &drop)| drop).fold(0.0, f64::max);
        self.peak_percent = largest.max(DECAY * self.peak_percent);
        round_up(self.peak_percent.max(0.5))
    }
}

/// Returns the next 1, 2 or 5 times a power of ten.
fn round_up(value: f64) -> f64 {
    let decade = 10_f64.powf(value.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|step| step * decade);
    let step = step.into_iter().find(|step| *step >= value * (1.0 - 1e-9));
    step.unwrap_or(10.0 * decade)
}

/// Minimum time between displayed frames.
const BETWEEN_SHOWN: Duration = Duration::from_micros(16_600);
/// Maximum wait for a line of a device between checks for commands.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// Maximum wait for a command while the source is paused.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// Runs `plan` until its source ends, the sender of the commands is gone, or the work is cancelled; `shown` is what was
/// displayed before.
///
/// # Errors
/// If decoding cannot begin or continue, with the reason.
pub fn run(
    mut plan: SessionPlan,
    shown: Snapshot,
    commands: &Receiver<Command>,
    report: &Report<LiveEvent>,
) -> Result<(), String> {
    plan.source = plan.source.resolved();
    let mut screen = Screen::new(&plan, shown)?;
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
                screen.follow_recording(&session);
                has_news = true;
                change(&mut session).unwrap_or_else(|reason| report.send(LiveEvent::Failed(reason)));
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
        for note in std::mem::take(&mut session.notes) {
            if let Note::RecordingEnded(recorded, reason) = note {
                screen.shown.recorded = Some(recorded);
                screen.show(&session, report);
                report.send(LiveEvent::Failed(reason));
            }
        }
    };
    // The last frame stays on the screen.
    screen.show(&session, report);
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_ends_at_round_numbers() {
        for (peak, expected) in [
            (0.5, 0.5),
            (0.6, 1.0),
            (1.0, 1.0),
            (1.3, 2.0),
            (4.9, 5.0),
            (73.0, 100.0),
        ] {
            let found = round_up(peak);
            assert!((found / expected - 1.0).abs() < 1e-9, "{peak}: {found}");
        }
    }
}
