use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError},
    time::{Duration, Instant},
};

use decoupler_core::{
    dataset::Simulation,
    live::{FaultEvent, WireCheck},
    scene::Scene,
    sensor::{SensorError, SensorModel},
};
use decoupler_files::live::Latencies;

use super::{
    decoding::Decoding,
    frame_source::{FrameSource, Next},
    message::{Arrived, Command, Counts, LiveEvent, LiveFrame, LivePlan, LiveShown, Watched},
    recording_file::RecordingFile,
    target_session::TargetSession,
};
use crate::window::job::Report;

/// A source with the decoder and the recording of its frames.
#[derive(Debug)]
pub(super) struct Session {
    plan: LivePlan,
    source: FrameSource,
    decoding: Decoding,
    tally: Tally,
    recording: Option<RecordingFile>,
    /// The last frame as received: rows × M4, in ohm.
    readings_ohm: Vec<f64>,
    /// The last frame with an answer.
    arrived: Option<Arrived>,
    /// True if there is something to report to the window.
    has_events: bool,
}

impl Session {
    /// Prepares to decode what `plan` says; `None` if that is no longer wanted.
    pub(super) fn open(
        plan: LivePlan,
        simulation: &Simulation,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, String> {
        let decoding = Decoding::new(plan.network.clone(), &plan.scene(simulation), plan.zero.clone())?;
        let mut tally = Tally::new(Instant::now());
        let source = FrameSource::open(&plan, simulation, &decoding.rows, &mut tally, is_wanted)?;
        Ok(source.map(|source| Self {
            plan,
            source,
            readings_ohm: vec![0.0; decoding.readings()],
            decoding,
            tally,
            recording: None,
            arrived: None,
            has_events: false,
        }))
    }

    fn decode(&mut self, arrived: Arrived, send: &dyn Fn(LiveEvent)) {
        self.has_events = true;
        if let Some(recording) = &mut self.recording
            && let Err(reason) = recording.record(arrived.time_s, &self.readings_ohm)
        {
            self.end_recording(Some(reason), send);
        }
        let decoded = self
            .decoding
            .decode(&self.readings_ohm, self.source.truth(), arrived.read_at);
        match decoded {
            Ok(error_mm) => {
                self.tally.good(arrived.read_at, Instant::now(), error_mm);
                self.arrived = Some(arrived);
            }
            Err(reason) => self.tally.bad(format!("frame at {:.3} s: {reason}", arrived.time_s)),
        }
    }

    /// Returns the last frame with an answer and the status of decoding.
    fn shown(&self) -> LiveShown {
        let time_s = self.arrived.map_or(0.0, |arrived| arrived.time_s);
        LiveShown {
            frame: self.arrived.map(|arrived| self.frame(arrived)),
            targets: None,
            counts: self.tally.counts(),
            recording: self.recording.as_ref().map(RecordingFile::length),
            replay: match &self.source {
                FrameSource::Replay(replay) if self.arrived.is_some() => Some(replay.state(time_s)),
                _ => None,
            },
        }
    }

    fn frame(&self, arrived: Arrived) -> LiveFrame {
        let decoding = &self.decoding;
        let (readings_outside, coordinates_outside) = decoding.outside();
        let truth = self.source.truth();
        LiveFrame {
            sensor: decoding.sensor,
            rows: decoding.rows.clone(),
            surface: decoding.surface.clone(),
            z_range_mm: decoding.z_range_mm.clone(),
            decoupled: decoding.decoupled(),
            actual: truth.map(|truth| decoding.actual(truth)),
            drops_percent: decoding.drops_percent(),
            time_s: arrived.time_s,
            residual: decoding.residual(),
            readings_outside,
            coordinates_outside,
            watched: decoding.watch.state().clone(),
            errors: truth.map(|_| decoding.truth_errors(self.tally.error_mm())),
        }
    }
}

impl LiveSession for Session {
    fn due(&self, now: Instant) -> Option<Instant> {
        self.source.due(now)
    }

    fn is_stream(&self) -> bool {
        self.source.is_stream()
    }

    fn has_events(&self) -> bool {
        self.has_events
    }

    fn take_next(&mut self, latest: Instant, send: &dyn Fn(LiveEvent)) -> Option<Result<(), String>> {
        let patience = latest.saturating_duration_since(Instant::now());
        let next = self.source.next(patience, &mut self.readings_ohm, &mut self.tally);
        match next {
            Next::Frame(arrived) => self.decode(arrived, send),
            Next::Bad(reason) => {
                self.tally.bad(reason);
                self.has_events = true;
            }
            Next::Nothing if self.source.is_stream() => self.has_events |= self.tally.falls_silent(Instant::now()),
            Next::Nothing => {}
            // No frame was displayed, so the view would give no reason.
            Next::End(Ok(())) if self.tally.counts().decoded == 0 => {
                let reason = self.tally.counts().last_bad;
                let reason = reason.unwrap_or_else(|| "it has no line of readings".to_owned());
                return Some(Err(format!("no line could be decoded: {reason}")));
            }
            Next::End(end) => return Some(end),
        }
        None
    }

    fn apply(&mut self, command: Command, send: &dyn Fn(LiveEvent)) -> Result<(), String> {
        match command {
            Command::Drawn => {}
            Command::Zero => send(LiveEvent::Zeroed(self.decoding.take_zero())),
            Command::UseZero(zero) => self.decoding.use_zero(zero),
            Command::Record if self.recording.is_none() => {
                let columns = self.decoding.sensor.scale.columns();
                match RecordingFile::create(&self.plan.recordings, &self.decoding.rows, columns) {
                    Ok(recording) => {
                        send(LiveEvent::Recording(recording.path().to_owned()));
                        self.recording = Some(recording);
                    }
                    Err(reason) => send(LiveEvent::NotRecorded(reason)),
                }
            }
            Command::Record => {}
            Command::EndRecording => self.end_recording(None, send),
            Command::Move(_) | Command::Break(_) | Command::Seek(_) | Command::Speed(_) | Command::Play(_) => {
                self.source.apply(&command)?;
                self.has_events = true;
            }
        }
        Ok(())
    }

    fn end_recording(&mut self, reason: Option<String>, send: &dyn Fn(LiveEvent)) {
        if let Some(recording) = self.recording.take() {
            send(LiveEvent::Recorded(recording.end(), reason));
        }
    }

    fn show(&mut self) -> LiveShown {
        self.has_events = false;
        self.shown()
    }
}

/// Counts frames, and the errors of their answers, over spans of about half a second.
#[derive(Debug)]
pub(super) struct Tally {
    counts: Counts,
    latencies: Latencies,
    span: Span,
    /// Mean error over the last whole span, in millimetres.
    error_mm: Option<f64>,
    /// Time at which the last frame arrived, or counting began.
    last: Instant,
}

#[derive(Debug)]
struct Span {
    begun: Instant,
    frames: u32,
    errors: u32,
    error_sum_mm: f64,
}

/// Length of a span.
const SPAN: Duration = Duration::from_millis(500);
/// Time without a frame after which a source counts as silent.
const SILENCE: Duration = Duration::from_secs(2);

impl Tally {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            counts: Counts::default(),
            latencies: Latencies::default(),
            span: Span::new(now),
            error_mm: None,
            last: now,
        }
    }

    /// Counts a frame that was decoded `now`, with its error in millimetres if that is known.
    pub(super) fn good(&mut self, read_at: Instant, now: Instant, error_mm: Option<f64>) {
        self.counts.decoded += 1;
        self.counts.is_waiting = false;
        self.latencies.add(now.saturating_duration_since(read_at));
        self.last = now;
        let span = &mut self.span;
        span.frames += 1;
        if let Some(error_mm) = error_mm {
            span.errors += 1;
            span.error_sum_mm += error_mm;
        }
        let length = now.saturating_duration_since(span.begun);
        if length >= SPAN {
            self.counts.frames_per_second = f64::from(span.frames) / length.as_secs_f64();
            self.error_mm = (span.errors > 0).then(|| span.error_sum_mm / f64::from(span.errors));
            *span = Span::new(now);
        }
    }

    pub(super) fn bad(&mut self, reason: String) {
        self.counts.bad += 1;
        self.counts.last_bad = Some(reason);
    }

    /// Counts dropped frames.
    pub(super) fn dropped(&mut self, frames: u64) {
        self.counts.dropped += frames;
    }

    /// Returns `true` once, when no frame has come for [`SILENCE`].
    pub(super) fn falls_silent(&mut self, now: Instant) -> bool {
        let is_silent = now.saturating_duration_since(self.last) >= SILENCE;
        if is_silent && !self.counts.is_waiting {
            self.counts.frames_per_second = 0.0;
            self.span = Span::new(now);
            self.counts.is_waiting = true;
            return true;
        }
        false
    }

    /// Returns the mean error of the recently displayed answers, in millimetres.
    pub(super) fn error_mm(&self) -> Option<f64> {
        self.error_mm
    }

    pub(super) fn counts(&self) -> Counts {
        let quantile = |share| self.latencies.quantile(share);
        Counts {
            latency: quantile(0.5).zip(quantile(0.99)).map(|(median, high)| [median, high]),
            ..self.counts.clone()
        }
    }
}

impl Span {
    fn new(begun: Instant) -> Self {
        Self {
            begun,
            frames: 0,
            errors: 0,
            error_sum_mm: 0.0,
        }
    }
}

/// Minimum time between displayed frames.
const BETWEEN_SHOWN: Duration = Duration::from_micros(16_600);
/// Maximum wait for a line of a device between checks for commands.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// Maximum wait for a command while the source is paused.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// An open source and its decoder.
pub(super) trait LiveSession {
    /// Returns the time at which the next frame of a timed source is due; `None` while it is paused.
    fn due(&self, now: Instant) -> Option<Instant>;

    /// Returns `true` for a live stream, which may fall silent.
    fn is_stream(&self) -> bool;

    /// Returns `true` if there is something to report to the window.
    fn has_events(&self) -> bool;

    /// Takes the next frame of the source, waiting for a stream at most until `latest`. Returns the result of the
    /// source once it has ended.
    fn take_next(&mut self, latest: Instant, send: &dyn Fn(LiveEvent)) -> Option<Result<(), String>>;

    /// Applies a command.
    fn apply(&mut self, command: Command, send: &dyn Fn(LiveEvent)) -> Result<(), String>;

    /// Ends the recording, if there is one.
    fn end_recording(&mut self, reason: Option<String>, send: &dyn Fn(LiveEvent));

    /// Returns the last frame with an answer and the status of decoding, to be displayed now.
    fn show(&mut self) -> LiveShown;
}

/// Runs `plan` until its source ends, the sender of the commands is gone, or the work is cancelled.
///
/// # Errors
/// If decoding cannot begin or continue, with the reason.
pub fn run(plan: LivePlan, commands: &Receiver<Command>, report: &Report<LiveEvent>) -> Result<(), String> {
    let send = |event| report.send(event);
    let source = plan.source.resolved();
    send(LiveEvent::Source(source.clone()));
    let plan = LivePlan { source, ..plan };
    let is_wanted = || !report.is_cancelled();
    let session: Option<Box<dyn LiveSession>> = match plan.simulation {
        Some(simulation) => Session::open(plan, &simulation, &is_wanted)?.map(|session| Box::new(session) as _),
        None => TargetSession::open(&plan, &is_wanted)?.map(|session| Box::new(session) as _),
    };
    let Some(mut session) = session else { return Ok(()) };
    let end = decode(&mut *session, commands, report);
    session.end_recording(None, &send);
    // The last frame stays on the screen.
    show(&mut *session, report);
    end
}

fn decode(
    session: &mut dyn LiveSession,
    commands: &Receiver<Command>,
    report: &Report<LiveEvent>,
) -> Result<(), String> {
    let send = |event| report.send(event);
    let mut is_drawn = true;
    let mut shown = Instant::now().checked_sub(BETWEEN_SHOWN);
    while !report.is_cancelled() {
        let now = Instant::now();
        let may_show_at = shown.map_or(now, |shown| shown + BETWEEN_SHOWN);
        if session.has_events() && is_drawn && may_show_at <= now {
            show(session, report);
            (is_drawn, shown) = (false, Some(now));
        }
        let mut until = session.due(now).unwrap_or(now + LONGEST_WAIT);
        if session.has_events() && is_drawn {
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
            Ok(command) => session.apply(command, &send)?,
            Err(RecvTimeoutError::Timeout) => {
                if let Some(end) = session.take_next(now + BETWEEN_LOOKS, &send) {
                    return end;
                }
            }
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    Ok(())
}

fn show(session: &mut dyn LiveSession, report: &Report<LiveEvent>) {
    report.progress(LiveEvent::Shown(Box::new(session.show())), |_, _| {});
}

/// Detects faults of wires, and decodes without the faulty wires.
#[derive(Debug)]
pub(super) struct Watch {
    state: Watched,
    check: Option<WireCheck>,
    checked: Option<Instant>,
}

/// Minimum time between checks, so that no frame is dropped because of them.
const BETWEEN_CHECKS: Duration = Duration::from_millis(10);

impl Watch {
    /// Prepares to watch frames of `rows` with the noise of `scene`.
    ///
    /// # Errors
    /// If the sensor model has no resistances.
    pub(super) fn new(sensor: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let reason = if scene.noise.is_none() {
            Some("not looked for: without noise, deviations cannot be judged; give the noise of a reading")
        } else if !WireCheck::is_affordable(sensor.scale, scene) {
            Some("not looked for: the array is too large to check every frame")
        } else {
            None
        };
        let check = match reason {
            Some(_) => None,
            None => Some(WireCheck::new(sensor, scene, rows)?),
        };
        Ok(Self {
            state: reason.map_or(Watched::Checked(FaultEvent::Recovered), Watched::Off),
            check,
            checked: None,
        })
    }

    pub(super) fn state(&self) -> &Watched {
        &self.state
    }

    /// Checks a frame for faults, unless another was checked just now: its readings, divided by the gains of the unloaded
    /// state. Returns `true` if the fault named has changed.
    pub(super) fn check(&mut self, frame_ohm: &[f64], now: Instant) -> bool {
        let Some(check) = &mut self.check else { return false };
        let is_due = |checked: Instant| now.saturating_duration_since(checked) >= BETWEEN_CHECKS;
        if !self.checked.is_none_or(is_due) {
            return false;
        }
        let Some(event) = check.check(frame_ohm) else {
            self.checked = Some(Instant::now());
            return false;
        };
        self.checked = Some(Instant::now());
        self.state = Watched::Checked(event);
        matches!(event, FaultEvent::Named { .. })
    }

    /// Decodes a frame without the wires of the named fault; returns `false` if there is no fault or no answer.
    pub(super) fn decode(&mut self, frame_ohm: &[f64], answer_mm: &mut [f64]) -> bool {
        let Some(check) = &mut self.check else { return false };
        let rows = 0..frame_ohm.len() / check.columns();
        check.named().is_some()
            && check.decode(frame_ohm, rows, answer_mm).is_ok()
            && answer_mm.iter().all(|mm| mm.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_and_error_are_those_of_the_last_half_second() {
        let start = Instant::now();
        let after = |millis| start + Duration::from_millis(millis);
        let mut tally = Tally::new(start);
        assert_eq!((tally.counts(), tally.error_mm()), (Counts::default(), None));
        (1..=50).for_each(|k| tally.good(after(10 * k - 2), after(10 * k), Some(0.1)));
        (51..=75).for_each(|k| tally.good(after(20 * k - 502), after(20 * k - 500), Some(0.3)));
        let counts = tally.counts();
        assert_eq!((counts.decoded, counts.frames_per_second), (75, 50.0));
        assert!((tally.error_mm().unwrap() - 0.3).abs() < 1e-12);
        let [median, high] = counts.latency.unwrap();
        assert!(median == high && (2.0..2.1).contains(&(median.as_secs_f64() * 1e3)));
    }

    #[test]
    fn silence_is_reported_once_and_ends_with_a_frame() {
        let start = Instant::now();
        let mut tally = Tally::new(start);
        assert!(!tally.falls_silent(start + Duration::from_secs(1)));
        assert!(tally.falls_silent(start + SILENCE) && !tally.falls_silent(start + 2 * SILENCE));
        let now = start + 2 * SILENCE;
        tally.good(now, now, None);
        assert!(!tally.counts().is_waiting && tally.falls_silent(now + SILENCE));
    }
}
