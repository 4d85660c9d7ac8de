use std::time::{Duration, Instant};

use super::{counts::Tally, message::Arrived};
use decoupler_core::{
    dataset::Seed,
    live::{Lines, Simulated},
    scene::{Fault, Scene},
    sensor::SensorModel,
};

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
