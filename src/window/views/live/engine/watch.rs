use std::time::{Duration, Instant};

use super::message::Watched;
use decoupler_core::{
    decoupling::Decoder,
    live::{FaultEvent, FaultMonitor, LeftOutDecoder},
    scene::Scene,
    sensor::{SensorError, SensorModel},
};

/// Watches frames for faults of wires, and decodes without the wires at fault.
#[derive(Debug)]
pub(super) struct Watch {
    state: Watched,
    parts: Option<Parts>,
    checked: Option<Instant>,
}

#[derive(Debug)]
struct Parts {
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
            None => Some(Parts {
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
