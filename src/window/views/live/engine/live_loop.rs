use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError},
    time::{Duration, Instant},
};

use decoupler_core::{
    decoupling::Decoder,
    live::{FaultEvent, FaultMonitor, LeftOutDecoder},
    scene::Scene,
    sensor::{SensorError, SensorModel},
};

use super::{
    message::{Command, LiveEvent, LivePlan, LiveShown, Watched},
    session::Session,
    target_session::TargetSession,
};
use crate::window::job::Report;

/// Shortest time between frames that are shown.
const BETWEEN_SHOWN: Duration = Duration::from_micros(16_600);
/// Longest wait for a line of a device between looks at commands.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);
/// Longest wait for a command of a source that is paused.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// A source under way and what decodes it.
pub(super) trait LiveSession {
    /// When the next frame is due, of a source that keeps time: `None` while it is paused.
    fn due(&self, now: Instant) -> Option<Instant>;

    /// Returns `true` for a source that comes by itself, and so may fall silent.
    fn is_stream(&self) -> bool;

    /// Returns `true` if something has come that the window does not know.
    fn has_events(&self) -> bool;

    /// Takes what the source has, waiting for a stream at most until `latest`. Returns the end of the source once it
    /// comes.
    fn take_next(&mut self, latest: Instant, send: &dyn Fn(LiveEvent)) -> Option<Result<(), String>>;

    /// Obeys a command.
    fn obey(&mut self, command: Command, send: &dyn Fn(LiveEvent)) -> Result<(), String>;

    /// Ends the recording, if there is one.
    fn end_recording(&mut self, reason: Option<String>, send: &dyn Fn(LiveEvent));

    /// The last frame with an answer, and how decoding stands, to be shown now.
    fn show(&mut self) -> LiveShown;
}

/// Decodes what `plan` says until its source ends, the sender of the commands is gone, or the work is cancelled.
///
/// # Errors
/// If decoding cannot begin or go on, with the reason.
pub fn run(plan: LivePlan, commands: &Receiver<Command>, report: &Report<LiveEvent>) -> Result<(), String> {
    let send = |event| report.send(event);
    let source = plan.source.looked_up();
    send(LiveEvent::Source(source.clone()));
    let plan = LivePlan { source, ..plan };
    let is_wanted = || !report.is_cancelled();
    let session: Option<Box<dyn LiveSession>> = match plan.settings {
        Some(settings) => Session::open(plan, &settings, &is_wanted)?.map(|session| Box::new(session) as _),
        None => TargetSession::open(&plan, &is_wanted)?.map(|session| Box::new(session) as _),
    };
    let Some(mut session) = session else { return Ok(()) };
    let end = decode(&mut *session, commands, report);
    session.end_recording(None, &send);
    // What came last stays in view.
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
            Ok(command) => session.obey(command, &send)?,
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

/// Watches frames for faults of wires, and decodes without the wires at fault.
#[derive(Debug)]
pub(super) struct Watch {
    state: Watched,
    parts: Option<LiveParts>,
    checked: Option<Instant>,
}

#[derive(Debug)]
struct LiveParts {
    monitor: FaultMonitor,
    left_out: LeftOutDecoder,
}

/// Shortest time between checks, so that they cost no frame.
const BETWEEN_CHECKS: Duration = Duration::from_millis(10);

impl Watch {
    /// Prepares to watch frames of `rows` with the noise of `scene`.
    ///
    /// # Errors
    /// A sensor without resistances.
    pub(super) fn new(sensor: &SensorModel, scene: &Scene, rows: &[usize]) -> Result<Self, SensorError> {
        let reason = if scene.noise.is_none() {
            Some("not looked for: without noise there is nothing to judge readings by; give the noise of a reading")
        } else if !FaultMonitor::is_affordable(sensor.scale, scene) {
            Some("not looked for: the array is too large to check every frame")
        } else {
            None
        };
        let parts = match reason {
            Some(_) => None,
            None => Some(LiveParts {
                monitor: FaultMonitor::new(sensor, scene, rows)?,
                left_out: LeftOutDecoder::new(sensor, scene, rows)?,
            }),
        };
        Ok(Self {
            state: reason.map_or(Watched::Sound, Watched::Off),
            parts,
            checked: None,
        })
    }

    pub(super) fn state(&self) -> &Watched {
        &self.state
    }

    /// Returns `true` for a reading that is left out.
    pub(super) fn leaves_out(&self, row: usize, column: usize) -> bool {
        match &self.state {
            Watched::Named(diagnosis) => diagnosis.wire.is_row(row) || diagnosis.wire.columns().contains(&Some(column)),
            Watched::Off(_) | Watched::Sound | Watched::Unexplained => false,
        }
    }

    /// Checks a frame, which came as `raw_ohm` and was divided by the gains of the unloaded state, unless another was checked just now. Returns `true` if another fault is named than before.
    pub(super) fn check(&mut self, raw_ohm: &[f64], frame_ohm: &[f64], now: Instant) -> bool {
        let Some(parts) = &mut self.parts else { return false };
        let is_due = |checked: Instant| now.saturating_duration_since(checked) >= BETWEEN_CHECKS;
        if !self.checked.is_none_or(is_due) {
            return false;
        }
        let Some(event) = parts.monitor.check_zeroed(raw_ohm, frame_ohm) else {
            self.checked = Some(Instant::now());
            return false;
        };
        self.checked = Some(Instant::now());
        self.state = match event {
            FaultEvent::Named(diagnosis) => Watched::Named(diagnosis),
            FaultEvent::Unexplained => Watched::Unexplained,
            FaultEvent::Recovered => Watched::Sound,
        };
        parts.left_out.leave_out(parts.monitor.named());
        matches!(event, FaultEvent::Named(_))
    }

    /// Decodes a frame without the wires of the fault that is named; returns `false` if there is none, or no answer.
    pub(super) fn decode(&mut self, frame_ohm: &[f64], answer_mm: &mut [f64]) -> bool {
        match (&self.state, &mut self.parts) {
            (Watched::Named(_), Some(parts)) => {
                parts.left_out.decode(frame_ohm, answer_mm).is_ok() && answer_mm.iter().all(|mm| mm.is_finite())
            }
            _ => false,
        }
    }
}
