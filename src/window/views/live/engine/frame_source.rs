use std::time::{Duration, Instant};

use decoupler_core::{
    dataset::Seed,
    evaluation::SimulatedSettings,
    live::{Lines, Simulated},
    scene::{Deformation, Fault, Noise, Rows, Scene},
    sensor::SensorModel,
};

use super::{
    message::{Arrived, Command, LivePlan, SourcePlan},
    replay::{ReplayFrames, read_replay},
    session::Tally,
    stream::{StreamFrames, open},
};

/// A source of frames under way.
#[derive(Debug)]
pub(super) enum FrameSource {
    Simulated(Box<SimulatedFrames>),
    Replay(Box<ReplayFrames>),
    Stream(Box<StreamFrames>),
}

/// The answer of a source that is asked for a frame.
#[derive(Debug)]
pub(super) enum Next {
    /// A frame.
    Frame(Arrived),
    /// Something that is no frame, and why.
    Bad(String),
    /// Nothing yet.
    Nothing,
    /// The source has ended, with the reason unless that is regular.
    End(Result<(), String>),
}

impl LivePlan {
    /// The scene of `settings` with the noise of the readings.
    pub(super) fn scene(&self, settings: &SimulatedSettings) -> Scene {
        let scene = settings.source.scene;
        Scene {
            noise: Noise {
                relative: self.noise,
                ..scene.noise.in_test()
            },
            ..scene
        }
    }
}

impl FrameSource {
    /// Opens the source of `plan`; `None` if it is no longer wanted.
    pub(super) fn open(
        (plan, settings): (&LivePlan, &SimulatedSettings),
        read: &[usize],
        tally: &mut Tally,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, String> {
        let (sensor, scene): (SensorModel, Scene) = (settings.source.sensor, plan.scene(settings));
        // The rows of a frame are told apart also where the network does not know them.
        let rows = match scene.rows {
            Rows::All => Rows::Known,
            rows => rows,
        };
        Ok(Some(match &plan.source {
            SourcePlan::Simulated {
                frames_per_second,
                motion,
                fault,
            } => {
                let mut frames = SimulatedFrames::new(&sensor, &scene, *frames_per_second, *fault)?;
                frames.source.set_motion(*motion);
                Self::Simulated(Box::new(frames))
            }
            SourcePlan::Replay {
                path,
                at_s,
                speed,
                is_playing,
            } => {
                let recording = read_replay(path, sensor.scale, rows, read, tally)?;
                let replay = ReplayFrames::new(recording, *at_s, *speed, *is_playing, Instant::now());
                Self::Replay(Box::new(replay))
            }
            SourcePlan::Stream(source) => {
                let Some(opened) = open(source, is_wanted)? else {
                    return Ok(None);
                };
                let frames = StreamFrames::new(source, opened, sensor.scale, rows, read.len())?;
                Self::Stream(Box::new(frames))
            }
        }))
    }

    /// When the next frame is due, of a source that keeps time: `None` while it is paused.
    pub(super) fn due(&self, now: Instant) -> Option<Instant> {
        match self {
            Self::Simulated(frames) => Some(frames.due()),
            Self::Replay(frames) => frames.due(now),
            Self::Stream(_) => Some(now),
        }
    }

    /// Writes the next frame, for which a stream waits at most so long.
    pub(super) fn next(&mut self, patience: Duration, frame_ohm: &mut [f64], tally: &mut Tally) -> Next {
        let arrived = match self {
            Self::Simulated(frames) => frames.next(frame_ohm, tally),
            Self::Replay(frames) => Ok(frames.next(frame_ohm, tally, Instant::now())),
            Self::Stream(frames) => return frames.next(patience, frame_ohm, tally),
        };
        match arrived {
            Ok(Some(arrived)) => Next::Frame(arrived),
            Ok(None) => Next::Nothing,
            Err(reason) => Next::End(Err(reason)),
        }
    }

    /// Obeys a command about the source.
    pub(super) fn obey(&mut self, command: &Command) -> Result<(), String> {
        let now = Instant::now();
        match (self, command) {
            (Self::Simulated(frames), Command::Move(motion)) => frames.source.set_motion(*motion),
            (Self::Simulated(frames), Command::Break(fault)) => {
                frames.source.set_fault(*fault).map_err(|error| error.to_string())?;
            }
            (Self::Replay(frames), Command::Seek(at_s)) => frames.seek(*at_s, now),
            (Self::Replay(frames), Command::Speed(speed)) => frames.set_speed(*speed, now),
            (Self::Replay(frames), Command::Play(is_playing)) => frames.play(*is_playing, now),
            _ => {}
        }
        Ok(())
    }

    /// The true deformation of the last frame, where it is known.
    pub(super) fn truth(&self) -> Option<&Deformation> {
        match self {
            Self::Simulated(frames) => Some(frames.source.deformation()),
            Self::Replay(_) | Self::Stream(_) => None,
        }
    }

    /// Returns `true` for a source that comes by itself, and so may fall silent.
    pub(super) fn is_stream(&self) -> bool {
        matches!(self, Self::Stream(_))
    }
}

/// Simulated frames at their rate.
#[derive(Debug)]
pub(super) struct SimulatedFrames {
    pub(super) source: Simulated,
    between: Duration,
    /// When the next frame is due.
    due: Instant,
}

impl SimulatedFrames {
    pub(super) fn new(
        sensor: &SensorModel,
        scene: &Scene,
        frames_per_second: f64,
        fault: Option<Fault>,
    ) -> Result<Self, String> {
        let mut source =
            Simulated::new(sensor, scene, Seed(0), frames_per_second).map_err(|error| error.to_string())?;
        source.set_fault(fault).map_err(|error| error.to_string())?;
        Ok(Self {
            source,
            between: Duration::from_secs_f64(1.0 / frames_per_second),
            due: Instant::now(),
        })
    }

    /// When the next frame is due.
    pub(super) fn due(&self) -> Instant {
        self.due
    }

    /// Writes the next frame, if it is due. Frames that no one took in time are dropped.
    pub(super) fn next(&mut self, frame_ohm: &mut [f64], tally: &mut Tally) -> Result<Option<Arrived>, String> {
        let now = Instant::now();
        if now < self.due {
            return Ok(None);
        }
        let behind = now - self.due;
        if behind > Lines::PATIENCE {
            let missed = (behind.as_secs_f64() / self.between.as_secs_f64()) as u64;
            self.source.skip(missed);
            tally.dropped(missed);
            self.due = now;
        }
        let time_s = self.source.next_frame(frame_ohm).map_err(|error| error.to_string())?;
        self.due += self.between;
        let read_at = Instant::now();
        Ok(Some(Arrived { time_s, read_at }))
    }
}
