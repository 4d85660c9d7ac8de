use glam::DVec3;

use crate::sensor::{SensorError, SensorModel};

/// Converter that digitises readings: it reads from 0 to twice the largest resistance at rest, and clips beyond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Converter {
    pub(super) step_ohm: f64,
    steps: f64,
}

impl Converter {
    /// A converter of this many bits for the readings of `model`.
    ///
    /// # Errors
    /// The undeformed sensor has no resistance.
    pub(super) fn new(bits: u8, model: &SensorModel) -> Result<Self, SensorError> {
        let rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
        let mut largest_ohm = 0.0_f64;
        for row in 0..model.scale.rows() {
            largest_ohm = model
                .row_resistances(row, &rest)?
                .into_iter()
                .fold(largest_ohm, f64::max);
        }
        let steps = 2.0_f64.powi(i32::from(bits));
        Ok(Self {
            step_ohm: 2.0 * largest_ohm / steps,
            steps,
        })
    }

    /// The lowest and the highest reading.
    pub(super) fn range_ohm(self) -> (f64, f64) {
        (self.step_ohm, self.step_ohm * self.steps)
    }

    /// Rounds a reading.
    pub(super) fn round_ohm(self, reading_ohm: f64) -> f64 {
        self.step(reading_ohm) * self.step_ohm
    }

    /// The lowest and the highest value that it gives as `reading_ohm`. The last step is open, for it clips.
    pub(super) fn rounded_from_ohm(self, reading_ohm: f64) -> (f64, f64) {
        let Self { step_ohm, steps } = self;
        let step = self.step(reading_ohm);
        let lowest_ohm = if step > 1.0 { (step - 0.5) * step_ohm } else { 0.0 };
        let highest_ohm = if step < steps {
            (step + 0.5) * step_ohm
        } else {
            f64::INFINITY
        };
        (lowest_ohm, highest_ohm)
    }

    fn step(self, reading_ohm: f64) -> f64 {
        (reading_ohm / self.step_ohm).round().clamp(1.0, self.steps)
    }
}
