//! The decoding thread: a session decodes what its source sends, and the window displays the latest.
//!
//! [`run`] is the loop. [`Request`]s change the session while it runs. A [`Snapshot`] is sent only after the window has drawn
//! the previous one, so frames do not queue up.

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, RecvTimeoutError},
    },
    time::{Duration, Instant},
};

use decoupler_core::{
    job::Job,
    live::{DriftMonitor, FaultEvent, FaultyWire, ZeroGains},
    problem::Problem,
    surface::SurfaceMap,
    text::{capitalised, counted},
};
use decoupler_files::{
    export::{NetworkFile, format_number, format_percent},
    figure::{
        HeatMap, PlotAxis, PlotFigure, TargetSurface, TimeSeries, readings_figure,
        surface::{Quantity, Surface},
    },
    live::{
        History, Input, LiveArray, Note, Recorded, ReplayState, Session, SessionEvent, SessionPlan, Tally, Watched,
    },
};
use glam::DVec3;
use ndarray::Array2;

use crate::window::{glossary, job::Report, plotting::MAX_TRACKS};

/// Message to the thread.
pub enum Request {
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
    commands: &Receiver<Request>,
    report: &Report<LiveEvent>,
) -> Result<(), String> {
    plan.source = plan.source.resolved();
    let mut screen = Screen::new(&plan, shown);
    let mut session = match Session::open(plan, &Job::new(&|| report.is_cancelled())) {
        Err(_) if report.is_cancelled() => return Ok(()),
        opened => opened.map_err(|error| error.to_string())?,
    };
    let show = |screen: &mut Screen, session: &Session| {
        let shown = screen.show(session);
        report.progress(LiveEvent::Shown(Box::new(shown)), |_, _| {});
    };
    let (mut is_drawn, mut has_news, mut may_show_at) = (true, false, Instant::now());
    let end = loop {
        if report.is_cancelled() {
            break Ok(());
        }
        let now = Instant::now();
        if has_news && is_drawn && may_show_at <= now {
            show(&mut screen, &session);
            (has_news, is_drawn, may_show_at) = (false, false, now + BETWEEN_SHOWN);
        }
        let mut until = session.input.due(now).unwrap_or(now + LONGEST_WAIT);
        if has_news && is_drawn {
            until = until.min(may_show_at);
        }
        match commands.recv_timeout(until.saturating_duration_since(now)) {
            Ok(Request::Drawn) => is_drawn = true,
            Ok(Request::Change(change)) => {
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
                show(&mut screen, &session);
                report.send(LiveEvent::Failed(reason));
            }
        }
    };
    // The last frame stays on the screen.
    show(&mut screen, &session);
    end
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
    /// The readings of an array as drops from their values without load.
    pub readings: Option<HeatMap>,
    /// Rows and columns of the readings whose wires are faulty, from 0.
    pub faulty: [Vec<usize>; 2],
    /// The values of a network of a recording over time.
    pub chart: Option<PlotFigure>,
    /// All of them: of a recording, from its beginning.
    pub history: History,
    /// How far the answer can be trusted.
    pub confidence: Vec<Fact>,
    /// The current fault of the wires, and its consequence.
    pub fault: Option<(String, String)>,
}

/// A figure with its name and meaning.
#[derive(Clone, Debug)]
pub struct Fact {
    /// Name.
    pub name: &'static str,
    /// Meaning.
    pub hint: String,
    /// The figure with its unit.
    pub value: String,
    /// True if it is a warning.
    pub warns: bool,
}

impl Fact {
    fn new(name: &'static str, hint: impl Into<String>, value: String, warns: bool) -> Self {
        let hint = hint.into();
        Self {
            name,
            hint,
            value,
            warns,
        }
    }
}

/// Makes the snapshots of a session.
pub struct Screen {
    /// The last one.
    pub shown: Snapshot,
    /// True if the session has an answer that is not displayed yet.
    pub has_answer: bool,
    network: Arc<NetworkFile>,
    noise: f64,
    nodes: Arc<[String]>,
    surfaces: Surfaces,
    /// Recent peak of the drops of the readings.
    peak_percent: f64,
}

/// Returns the surfaces of the last answer.
type Surfaces = Box<dyn Fn(&Session) -> Vec<Surface>>;

/// Returns the names of the nodes, and the surfaces through them; `None` if there is no surface.
fn surfaces(problem: &Problem) -> Option<(Arc<[String]>, Surfaces)> {
    let Some(simulation) = &problem.sensor else {
        let surface = TargetSurface::new(&problem.positions, &problem.targets).ok();
        let surface = surface.filter(|_| !problem.positions.is_empty())?;
        let nodes = surface.nodes().iter();
        let nodes = nodes.map(|node| problem.targets[node.target].title()).collect();
        let surfaces = move |session: &Session| {
            let (values, range) = (&session.last.values, surface.range_of(&session.ranges));
            let [_, decoded, _] = surface.surfaces(values, values, range);
            vec![decoded]
        };
        return Some((nodes, Box::new(surfaces)));
    };
    let (sensor, scene) = (simulation.sensor, &simulation.scene);
    let rows = scene.rows.read(sensor.scale.rows()).ok()?;
    let (x_mm, y_mm) = sensor.geometry.lattice_mm(sensor.scale, &rows);
    let map = SurfaceMap::shared(&x_mm, &y_mm).ok()?;
    let height_mm = sensor.geometry.height_mm;
    let range_mm = height_mm - scene.stroke_mm(&sensor.geometry)..=height_mm;
    let name = |row: &usize, node: usize| format!("Row {}, node {node}", row + 1);
    let of_row = |row| (1..=sensor.scale.nodes_per_row()).map(move |node| name(row, node));
    let nodes = rows.iter().flat_map(of_row).collect();
    let surface = move |title: &str, nodes_mm: Vec<DVec3>| {
        Surface::through(title, &map, nodes_mm, Quantity::Height, range_mm.clone())
    };
    let surfaces = move |session: &Session| {
        let decoded = session.last.values.chunks_exact(3).map(DVec3::from_slice);
        let actual = session.input.truth().map(|truth| {
            let nodes_mm = rows.iter().flat_map(|&row| truth.row_positions_mm(&sensor, row));
            surface("Actual", nodes_mm.collect())
        });
        let decoded = surface("Decoded", decoded.collect());
        std::iter::once(decoded).chain(actual).collect()
    };
    Some((nodes, Box::new(surfaces)))
}

impl Screen {
    /// Prepares the surfaces of `plan`; `shown` is what was displayed before.
    pub fn new(plan: &SessionPlan, shown: Snapshot) -> Self {
        let none = || -> (_, Surfaces) { (Arc::default(), Box::new(|_| Vec::new())) };
        let (nodes, surfaces) = surfaces(&plan.network.problem).unwrap_or_else(none);
        Self {
            shown,
            has_answer: false,
            network: Arc::clone(&plan.network),
            noise: plan.noise.relative,
            nodes,
            surfaces,
            peak_percent: 0.0,
        }
    }

    /// Returns the snapshot of now.
    pub fn show(&mut self, session: &Session) -> Snapshot {
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
        self.shown.clone()
    }

    /// Takes the length of the recording in progress, which is gone once it has ended.
    pub fn follow_recording(&mut self, session: &Session) {
        self.shown.is_recording = session.recording.is_some();
        if let Some(file) = &session.recording {
            self.shown.recorded = Some(file.recorded.clone());
        }
    }

    fn answered(&mut self, session: &Session) -> Answered {
        let (last, problem) = (&session.last, &self.network.problem);
        let mut answered = Answered {
            network: Arc::clone(&self.network),
            time_s: last.time_s,
            values: last.values.clone(),
            surfaces: (self.surfaces)(session),
            nodes: Arc::clone(&self.nodes),
            readings: None,
            faulty: Default::default(),
            chart: None,
            history: session.history.clone(),
            confidence: Vec::new(),
            fault: None,
        };
        let Some(array) = &session.array else {
            let history = session.history.until(last.time_s);
            let intervals = self.network.intervals.as_ref();
            let (places, shape) = (
                Vec::from_iter(history.iter().map(|(time_s, _)| *time_s)),
                problem.targets.len(),
            );
            let decoded = Array2::from_shape_fn((places.len(), shape), |(sample, target)| history[sample].1[target]);
            let series = TimeSeries {
                targets: &problem.targets,
                axis: PlotAxis::linear("time (s)"),
                gaps: &[],
                decoded: decoded.view(),
                actual: None,
                intervals,
                places: &places,
            };
            let all = places.first().copied().unwrap_or(0.0)..=places.last().copied().unwrap_or(1.0);
            answered.chart = Some(series.figure(0..shape.min(MAX_TRACKS), &all));
            let outside = outside(session, problem.feature_count(), "target");
            answered.confidence = vec![outside, self.drift(session)];
            return answered;
        };
        let (fault, consequence) = fault(&array.watched);
        answered.fault = consequence.map(|consequence| (fault.value.clone(), consequence));
        if let Some(wire) = array.watched.wire() {
            let rows = (0..array.rows.len()).filter(|&place| wire == FaultyWire::Row(array.rows[place]));
            answered.faulty = [rows.collect(), wire.columns().collect()];
        }
        answered.readings = Some(self.readings(array, &last.readings));
        answered.confidence = vec![
            self.residual(array.residual(last)),
            outside(session, last.readings.len(), "coordinate"),
            fault,
        ];
        if session.input.truth().is_some() {
            let hint = "Mean |error| of z over all nodes, compared with the simulated truth, over the latest frames.";
            let error_mm = session.tally.error_mm;
            let value = error_mm.map_or_else(|| format_number(None), |mm| format!("{} mm", format_number(mm)));
            answered.confidence.push(Fact::new("Error", hint, value, false));
        }
        answered
    }

    /// Returns the map of the readings. Its scale follows the largest drop in round steps and falls slowly, which keeps colours
    /// comparable from frame to frame; faulty wires do not count.
    fn readings(&mut self, array: &LiveArray, frame_ohm: &[f64]) -> HeatMap {
        /// Decay of the peak per frame.
        const DECAY: f64 = 0.995;
        let drops_percent = array.drops_percent(frame_ohm);
        let drops = drops_percent.indexed_iter();
        let drops = drops.filter(|((row, column), _)| !array.watched.leaves_out(array.rows[*row], *column));
        let drops = drops.map(|(_, &drop)| drop).filter(|drop| drop.is_finite());
        self.peak_percent = drops.fold(DECAY * self.peak_percent, f64::max);
        readings_figure(drops_percent, &array.rows, round_up(self.peak_percent.max(0.5)))
    }

    fn residual(&self, residual: f64) -> Fact {
        let mut value = format_percent(100.0 * residual);
        if self.noise > 0.0 && residual.is_finite() {
            value += &format!(" ({} × noise)", format_number(residual / self.noise));
        }
        let hint = format!(
            "{}\n\nIt is as small as the noise of a reading if the answer explains the readings.",
            glossary::RESIDUAL.hint
        );
        Fact::new("Residual of Eq. (2)", hint, value, false)
    }

    fn drift(&self, session: &Session) -> Fact {
        let (hint, value, warns) = match session.monitor.as_ref().map(DriftMonitor::drift) {
            Err(reason) => (
                format!("Drift is not monitored: {reason}."),
                "not monitored".to_owned(),
                false,
            ),
            Ok(None) => (DRIFT.to_owned(), "none".to_owned(), false),
            Ok(Some(drift)) => {
                let text = drift.describe(&self.network.problem.inputs);
                (DRIFT.to_owned(), capitalised(&text), true)
            }
        };
        Fact::new("Drift of the readings", hint, value, warns)
    }
}

const DRIFT: &str = "Readings that do not look like those of the training: prediction intervals do not hold. Check the sensor and \
                     its connection, re-zero it, or train with recent samples. The warning ends when the readings are back to \
                     normal. In readings like those of the training, a false alarm occurs on average at most once in 10 000 \
                     blocks of readings, each at least five times as long as neighbouring readings are correlated.";

/// Returns how many of `of` readings, and of the targets, are outside the range seen in training.
fn outside(session: &Session, of: usize, target: &str) -> Fact {
    let (readings, targets) = session.outside();
    let mut value = match readings {
        None => "readings not known".to_owned(),
        Some(0) if targets == 0 => "none".to_owned(),
        Some(readings) => format!("{} of {of}", counted(readings, "reading")),
    };
    if targets > 0 {
        value += &format!(", {}", counted(targets, target));
    }
    let hint = format!(
        "Readings beyond the range seen in training by more than a tenth of it, and {target}s beyond by more than all of it. \
         There the network extrapolates: check these readings, or train with samples that cover them."
    );
    let warns = readings.unwrap_or(0) + targets > 0;
    Fact::new("Outside training", hint, value, warns)
}

/// Returns the current fault of the wires, and its consequence if there is one.
fn fault(watched: &Watched) -> (Fact, Option<String>) {
    let (value, consequence) = match watched {
        Watched::NoNoise | Watched::TooLarge => ("not looked for".to_owned(), None),
        Watched::Checked(FaultEvent::Recovered) => ("none".to_owned(), None),
        Watched::Checked(event @ FaultEvent::Named { wire, .. }) => {
            let after = "Its readings are left out, and the others decoded by Gauss-Newton steps on Eq. (2).";
            (wire.to_string(), Some(format!("{event}. {after}")))
        }
        Watched::Checked(event @ FaultEvent::Unexplained) => {
            let after = "and no fault of a single wire explains them: the answers may be wrong. Check the wiring, the geometry, \
                         the order of the rows, and the relative noise on the left.";
            ("not a single-wire fault".to_owned(), Some(format!("{event}, {after}")))
        }
    };
    let hint = format!(
        "{} Looked for if the noise of a reading is known and the array not too large.",
        glossary::WIRE_FAULT.hint
    );
    let fact = Fact::new("Fault", hint, value, consequence.is_some());
    (fact, consequence.map(|text| capitalised(&text)))
}

/// Returns the next 1, 2 or 5 times a power of ten.
fn round_up(value: f64) -> f64 {
    let decade = 10_f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 5.0].map(|step| step * decade);
    let step = steps.into_iter().find(|step| *step >= value * (1.0 - 1e-9));
    step.unwrap_or(10.0 * decade)
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
