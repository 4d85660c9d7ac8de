use super::{CalibrationError, PressedRow};
use crate::{numerics::median, sensor::SensorModel};

/// Displacements that nodes may have in samples of known presses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PressLimits {
    /// Largest downward displacement.
    pub largest_depth_mm: f64,
    /// Largest sideways displacement, along x and along y.
    pub largest_shift_mm: f64,
}

impl PressLimits {
    /// Tolerance beyond the limits for measurement errors of a displacement, relative to the height.
    const TOLERANCE: f64 = 0.02;
    /// Factor by which a reading may differ from the value that the sensor model and the other readings suggest.
    pub const LARGEST_FACTOR: f64 = 1e3;

    /// Limits for a sensor without a known scene: nodes move down as far as the column-wires, and sideways by any
    /// distance.
    pub fn of_sensor(model: &SensorModel) -> Self {
        Self {
            largest_depth_mm: model.geometry.height_mm,
            largest_shift_mm: f64::INFINITY,
        }
    }

    /// Checks samples of known presses on a sensor like `nominal`, before they are used to calibrate it or to train a
    /// network. A sensor whose readings all differ from those of `nominal` by the same factor passes.
    ///
    /// # Errors
    /// If the nominal sensor is impossible, or a sample does not belong to the array, has a reading that is not a
    /// resistance or is implausible, or a displacement outside these limits.
    pub fn check(self, nominal: &SensorModel, samples: &[PressedRow]) -> Result<(), CalibrationError> {
        nominal.check()?;
        for (sample, pressed) in samples.iter().enumerate() {
            check_shape(nominal, sample, pressed)?;
            self.check_displacements(nominal, sample, pressed)?;
            let mut readings = pressed.resistances_ohm.iter().enumerate();
            if let Some((column, &ohm)) = readings.find(|(_, ohm)| !(**ohm > 0.0 && ohm.is_finite())) {
                return Err(CalibrationError::Reading { sample, column, ohm });
            }
        }
        check_factors(nominal, samples)
    }

    fn check_displacements(
        self,
        nominal: &SensorModel,
        sample: usize,
        pressed: &PressedRow,
    ) -> Result<(), CalibrationError> {
        let height_mm = nominal.geometry.height_mm;
        let tolerance_mm = Self::TOLERANCE * height_mm;
        for (node, displacement) in pressed.displacements_mm.iter().enumerate() {
            if !(displacement.is_finite() && displacement.z < height_mm) {
                return Err(CalibrationError::Displacement { sample, node });
            }
            let shift_mm = displacement.truncate().abs().max_element();
            let directions = [
                ("pressed down", displacement.z, "only 0 to", self.largest_depth_mm),
                ("shifted sideways", shift_mm, "at most", self.largest_shift_mm),
            ];
            let is_outside = |mm: f64, largest_mm: f64| mm < -tolerance_mm || mm > largest_mm + tolerance_mm;
            let outside = directions
                .into_iter()
                .find(|&(_, mm, _, largest_mm)| is_outside(mm, largest_mm));
            if let Some((direction, mm, at_most, largest_mm)) = outside {
                return Err(CalibrationError::Press {
                    sample,
                    node,
                    direction,
                    mm,
                    at_most,
                    largest_mm,
                });
            }
        }
        Ok(())
    }
}

fn check_shape(nominal: &SensorModel, sample: usize, pressed: &PressedRow) -> Result<(), CalibrationError> {
    let scale = nominal.scale;
    let counts = [
        ("displacements", pressed.displacements_mm.len(), scale.nodes_per_row()),
        ("readings", pressed.resistances_ohm.len(), scale.columns()),
    ];
    let wrong = counts.into_iter().find(|(_, found, expected)| found != expected);
    let row = ("as row-wire number", pressed.row + 1, scale.rows());
    match wrong.or_else(|| (pressed.row >= scale.rows()).then_some(row)) {
        Some((what, found, expected)) => Err(CalibrationError::Shape {
            sample,
            what,
            found,
            expected,
            scale: scale.to_string(),
        }),
        None => Ok(()),
    }
}

/// Compares ln of each reading and of the resistance of `nominal` with the median of their differences.
fn check_factors(nominal: &SensorModel, samples: &[PressedRow]) -> Result<(), CalibrationError> {
    let mut differences = Vec::with_capacity(samples.len() * nominal.scale.columns());
    for pressed in samples {
        let resistances_ohm = nominal.row_resistances(pressed.row, &pressed.displacements_mm)?;
        let pairs = pressed.resistances_ohm.iter().zip(resistances_ohm);
        differences.extend(pairs.map(|(read_ohm, ohm)| read_ohm.ln() - ohm.ln()));
    }
    if differences.is_empty() {
        return Ok(());
    }
    let median = median(differences.clone());
    let is_absurd = |difference: &f64| (difference - median).abs() > PressLimits::LARGEST_FACTOR.ln();
    match differences.iter().position(is_absurd) {
        Some(place) => {
            let (sample, column) = (place / nominal.scale.columns(), place % nominal.scale.columns());
            let ohm = samples[sample].resistances_ohm[column];
            let expected_ohm = ohm / (differences[place] - median).exp();
            Err(CalibrationError::Absurd {
                sample,
                column,
                ohm,
                expected_ohm,
            })
        }
        None => Ok(()),
    }
}
