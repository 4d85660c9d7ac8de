use super::{CalibrationError, PressedRow, SensorParameter};
use crate::sensor::{DVec3, SensorError, SensorModel};

/// Number of parameters.
pub(super) const COUNT: usize = SensorParameter::COUNT;

/// Derivatives of one reading with respect to each parameter, in the order of [`SensorParameter::ALL`].
pub(super) type Slopes = [f64; COUNT];

/// Writes ln R of Eq. (2) for every column-wire (M4) and its derivatives with respect to the parameters.
///
/// With s = Σ 1/d and R = g/s, ∂ ln R/∂θ = −(1/s) ∂s/∂θ for a length θ, where ∂(1/d)/∂θ = −(d · ∂d/∂θ)/d³ for the vector
/// d between a node and an electrode; and ∂ ln R/∂g = 1/g.
pub(super) fn log_resistances(model: &SensorModel, pressed: &PressedRow, mut write: impl FnMut(usize, f64, &Slopes)) {
    let SensorModel {
        scale,
        geometry,
        resistivity_ohm_per_mm: g,
    } = model;
    let middle = |count: usize| (count - 1) as f64 / 2.0;
    let row = pressed.row as f64;
    let first_x = geometry.row_x0_mm - geometry.column_node_x0_mm + geometry.row_pitch_mm * row;
    for column in 0..scale.columns() {
        let columns_off = middle(scale.columns()) - column as f64;
        let (mut sum, mut slopes) = (0.0, [0.0; COUNT]);
        for (node, displacement) in pressed.displacements_mm.iter().enumerate() {
            let nodes_off = node as f64 - middle(scale.nodes_per_row());
            let y = geometry.node_pitch_mm * nodes_off + geometry.column_pitch_mm * columns_off + displacement.y;
            let z = geometry.height_mm - displacement.z;
            for electrode in 0..scale.nodes_per_column() {
                let electrode = electrode as f64;
                let x = first_x - geometry.column_node_pitch_mm * electrode + displacement.x;
                let inverse = DVec3::new(x, y, z).length_recip();
                let cubed = inverse * inverse * inverse;
                sum += inverse;
                let [by_x, by_y, by_z] = [-x * cubed, -y * cubed, -z * cubed];
                let by = [
                    by_z,
                    row * by_x,
                    nodes_off * by_y,
                    columns_off * by_y,
                    -by_x,
                    -electrode * by_x,
                ];
                for (slope, by) in slopes.iter_mut().zip(by) {
                    *slope += by;
                }
            }
        }
        slopes.iter_mut().for_each(|slope| *slope /= -sum);
        slopes[COUNT - 1] = 1.0 / g;
        write(column, (g / sum).ln(), &slopes);
    }
}

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
        nominal
            .check()
            .map_err(|source: SensorError| CalibrationError::Sensor(source))?;
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
            let depth_mm = displacement.z;
            if depth_mm < -tolerance_mm || depth_mm > self.largest_depth_mm + tolerance_mm {
                return Err(CalibrationError::Depth {
                    sample,
                    node,
                    depth_mm,
                    largest_mm: self.largest_depth_mm,
                });
            }
            let shift_mm = displacement.truncate().abs().max_element();
            if shift_mm > self.largest_shift_mm + tolerance_mm {
                return Err(CalibrationError::Shift {
                    sample,
                    node,
                    shift_mm,
                    largest_mm: self.largest_shift_mm,
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
    let mut sorted = differences.clone();
    sorted.sort_by(f64::total_cmp);
    let Some(median) = sorted.get(sorted.len() / 2) else {
        return Ok(());
    };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::ArrayScale;

    fn pressed(scale: ArrayScale, row: usize) -> PressedRow {
        let displacement = |node: usize| DVec3::new(0.03 * node as f64, -0.02, 0.17 * (node % 5) as f64);
        PressedRow {
            frame: 0,
            row,
            displacements_mm: (0..scale.nodes_per_row()).map(displacement).collect(),
            resistances_ohm: vec![1.0; scale.columns()],
        }
    }

    /// Compares with central differences of the resistance model.
    #[test]
    fn derivatives_match_the_resistance_model() {
        for (text, row) in [("10x6_3x18", 7), ("10x10_5x30", 0), ("3x2_1x7", 2)] {
            let mut model = SensorModel::new(text.parse().unwrap());
            (model.geometry.column_node_x0_mm, model.geometry.row_pitch_mm) = (12.3, 1.4);
            let pressed = pressed(model.scale, row);
            let ln_ohm = |model: &SensorModel| -> Vec<f64> {
                let ohm = model.row_resistances(row, &pressed.displacements_mm).unwrap();
                ohm.into_iter().map(f64::ln).collect()
            };
            let at = ln_ohm(&model);
            for (index, parameter) in SensorParameter::ALL.into_iter().enumerate() {
                let step = 1e-5 * parameter.of(&model);
                let moved = |by: f64| {
                    let mut moved = model;
                    *parameter.field(&mut moved) += by;
                    ln_ohm(&moved)
                };
                let (above, below) = (moved(step), moved(-step));
                log_resistances(&model, &pressed, |column, ours, slopes| {
                    assert!((ours - at[column]).abs() < 1e-13, "{text}");
                    let expected = (above[column] - below[column]) / (2.0 * step);
                    let error = (slopes[index] - expected).abs();
                    assert!(
                        error < 1e-8 * expected.abs() + 1e-9,
                        "{text}, {parameter}, column {column}: {error}"
                    );
                });
            }
        }
    }
}
