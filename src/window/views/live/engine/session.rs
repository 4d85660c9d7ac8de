use std::time::Instant;

use super::{
    counts::Tally,
    decoding::Decoding,
    frame_source::{FrameSource, Next},
    live_loop::LiveSession,
    message::{Arrived, Command, LiveEvent, LiveFrame, LivePlan, LiveShown},
    recording_file::RecordingFile,
};
use decoupler_core::evaluation::SimulatedSettings;

/// A source and what decodes and records its frames.
#[derive(Debug)]
pub(super) struct Session {
    plan: LivePlan,
    source: FrameSource,
    decoding: Decoding,
    tally: Tally,
    recording: Option<RecordingFile>,
    /// The last frame as it came: rows × M4, in ohm.
    readings_ohm: Vec<f64>,
    /// The last frame with an answer.
    arrived: Option<Arrived>,
    /// True if something has come that the window does not know.
    has_events: bool,
}

impl Session {
    /// Prepares to decode what `plan` says; `None` if that is no longer wanted.
    pub(super) fn open(
        plan: LivePlan,
        settings: &SimulatedSettings,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, String> {
        let decoding = Decoding::new(plan.network.clone(), &plan.scene(settings), plan.zero.clone())?;
        let mut tally = Tally::new(Instant::now());
        let source = FrameSource::open((&plan, settings), &decoding.rows, &mut tally, is_wanted)?;
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

    /// The last frame with an answer, and how decoding stands.
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
            // Nothing was shown, and the view would say nothing of why.
            Next::End(Ok(())) if self.tally.counts().decoded == 0 => {
                let reason = self.tally.counts().last_bad;
                let reason = reason.unwrap_or_else(|| "it has no line of readings".to_owned());
                return Some(Err(format!("no line could be decoded: {reason}")));
            }
            Next::End(end) => return Some(end),
        }
        None
    }

    fn obey(&mut self, command: Command, send: &dyn Fn(LiveEvent)) -> Result<(), String> {
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
                self.source.obey(&command)?;
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
