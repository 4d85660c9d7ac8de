use faer::Mat;

use super::{CalibrationError, PressedRow, SensorParameter};
use crate::{
    numerics::{Linearised, minimise},
    sensor::{Axes, RowConductance, SensorModel},
};

/// Number of parameters.
pub(super) const COUNT: usize = SensorParameter::ALL.len();

/// Derivatives of ln R with respect to each parameter in the order of [`SensorParameter::ALL`], relative to its reference.
pub(super) type Slopes = [f64; COUNT];

/// The readings of known presses, and the nominal sensor.
pub(super) struct Problem<'a> {
    pub(super) nominal: &'a SensorModel,
    /// See [`SensorParameter::reference`].
    pub(super) references: Slopes,
    pub(super) samples: &'a [PressedRow],
}

impl<'a> Problem<'a> {
    pub(super) fn new(nominal: &'a SensorModel, samples: &'a [PressedRow]) -> Self {
        Self {
            nominal,
            references: SensorParameter::ALL.map(|parameter| parameter.reference(nominal)),
            samples,
        }
    }

    /// Number of readings.
    pub(super) fn readings(&self) -> usize {
        self.samples.len() * self.nominal.scale.columns()
    }

    /// Calls `take` for every reading m with its sample, its column-wire, its residual ln m − ln R of `model`, and the
    /// derivatives of ln R.
    ///
    /// With s = Σ 1/d of Eq. (2) and R = g/s, ∂ ln R/∂θ = −(1/s) ∂s/∂θ for a length θ, and ∂ ln R/∂g = 1/g. A length that
    /// moves the nodes moves them along an axis in proportion to their number, so that ∂s/∂θ is a sum of derivatives by
    /// displacements. For the pitch of the column nodes it follows from Euler's theorem: s is homogeneous of degree −1 in
    /// all lengths.
    pub(super) fn residuals(&self, model: &SensorModel, mut take: impl FnMut(&PressedRow, usize, f64, &Slopes)) {
        let (scale, geometry) = (model.scale, &model.geometry);
        let middle = |count: usize| (count - 1) as f64 / 2.0;
        let mut conductance = RowConductance::new(model, Axes::Xyz);
        for sample in self.samples {
            conductance.evaluate(model, sample.row, &sample.displacements_mm);
            for (column, (&sum, &reading_ohm)) in conductance.sums().iter().zip(&sample.resistances_ohm).enumerate() {
                let by = |node: usize, axis: usize| conductance.derivatives(3 * node + axis)[column];
                let mut by_all = [0.0; 3];
                let (mut by_node_pitch, mut by_displacements) = (0.0, 0.0);
                for (node, displacement_mm) in sample.displacements_mm.iter().enumerate() {
                    by_node_pitch += (node as f64 - middle(scale.nodes_per_row())) * by(node, 1);
                    for (axis, sum) in by_all.iter_mut().enumerate() {
                        *sum += by(node, axis);
                        by_displacements += displacement_mm[axis] * by(node, axis);
                    }
                }
                let [by_x, by_y, by_depth] = by_all;
                // ∂s/∂θ, in the order of `SensorParameter::ALL`.
                let mut slopes = [
                    -by_depth,
                    sample.row as f64 * by_x,
                    by_node_pitch,
                    (middle(scale.columns()) - column as f64) * by_y,
                    -by_x,
                    0.0,
                    0.0,
                ];
                let mut by_scale = by_displacements + (geometry.row_x0_mm - geometry.column_node_x0_mm) * by_x;
                for (slope, parameter) in slopes.iter().zip(&SensorParameter::ALL[..4]) {
                    by_scale += slope * parameter.of(model);
                }
                if scale.nodes_per_column() > 1 {
                    slopes[COUNT - 2] = -(sum + by_scale) / geometry.column_node_pitch_mm;
                }
                slopes.iter_mut().for_each(|slope| *slope /= -sum);
                slopes[COUNT - 1] = 1.0 / model.resistivity_ohm_per_mm;
                slopes
                    .iter_mut()
                    .zip(&self.references)
                    .for_each(|(slope, reference)| *slope *= reference);
                let ln_ohm = (model.resistivity_ohm_per_mm / sum).ln();
                take(sample, column, reading_ohm.ln() - ln_ohm, &slopes);
            }
        }
    }

    /// Linearises the equations at `model` for all parameters.
    pub(super) fn linearise(&self, model: &SensorModel) -> Linearised {
        let mut sums = Linearised {
            gram: Mat::zeros(COUNT, COUNT),
            descent: vec![0.0; COUNT],
            squares: 0.0,
        };
        self.residuals(model, |_, _, residual, slopes| {
            sums.squares += residual * residual;
            for (one, slope) in slopes.iter().enumerate() {
                sums.descent[one] += slope * residual;
                for (other, value) in slopes.iter().enumerate() {
                    sums.gram[(one, other)] += slope * value;
                }
            }
        });
        sums
    }

    /// The nominal sensor with changes of the parameters `free`, relative to their references.
    pub(super) fn changed(&self, free: &[SensorParameter], changes: &[f64]) -> SensorModel {
        let mut model = *self.nominal;
        for (parameter, change) in free.iter().zip(changes) {
            *parameter.field(&mut model) += change * self.references[parameter.index()];
        }
        model
    }

    /// Fits the parameters `free` from `start` (their changes), on the logarithms of the resistances, so that relative
    /// errors count alike: minimises `Σ r² + prior_weight · Σ θ²` over the changes θ, and returns them.
    ///
    /// The fit has converged when a step would be negligible compared with the uncertainty of the parameters. Exact
    /// readings converge when rounding is reached.
    pub(super) fn fit(
        &self,
        free: &[SensorParameter],
        start: &[f64],
        prior_weight: f64,
    ) -> Result<Vec<f64>, CalibrationError> {
        /// Convergence tolerance: length of the remaining step, in standard deviations of the parameters.
        const OFFSET: f64 = 1e-4;
        /// Relative change of Σ r² that is attributed to rounding.
        const ROUNDING_OF_SUM: f64 = 1e-14;
        /// Rounding error of a residual: that of a reading, a resistance and their logarithms.
        const ROUNDING: f64 = 16.0 * f64::EPSILON;
        let redundancy = self.readings().saturating_sub(free.len()).max(1) as f64;
        let share = (OFFSET * OFFSET / redundancy).max(ROUNDING_OF_SUM);
        let rounding = self.readings() as f64 * ROUNDING * ROUNDING;
        let linearise = |changes: &[f64]| {
            let model = self.changed(free, changes);
            let mut nodes = self.samples.iter().flat_map(|sample| &sample.displacements_mm);
            let is_possible = model.check().is_ok() && nodes.all(|node| node.z < model.geometry.height_mm);
            let all = is_possible.then(|| self.linearise(&model))?;
            let mut found = restricted(&all, free);
            for (unknown, change) in changes.iter().enumerate() {
                found.gram[(unknown, unknown)] += prior_weight;
                found.descent[unknown] -= prior_weight * change;
                found.squares += prior_weight * change * change;
            }
            Some(found)
        };
        let negligible = |squares: f64| share * squares + rounding;
        minimise(start, linearise, negligible).ok_or(CalibrationError::NotConverged)
    }

    /// Fits the parameters `free` with a normal prior around their nominal values, whose standard deviation is `tolerance`
    /// relative to their references, and with the noise estimated from the residuals. This fit exists for any number of
    /// readings.
    pub(super) fn fit_with_prior(
        &self,
        free: &[SensorParameter],
        tolerance: f64,
    ) -> Result<Vec<f64>, CalibrationError> {
        /// Maximum iterations of the noise estimate, and the relative change at which it has converged.
        const ROUNDS: usize = 20;
        const SETTLED: f64 = 1e-2;
        let redundancy = self.readings().saturating_sub(free.len()).max(1) as f64;
        let variance_at = |changes: &[f64]| {
            let squares = self.linearise(&self.changed(free, changes)).squares;
            (squares / redundancy).max(f64::EPSILON * f64::EPSILON)
        };
        let mut changes = vec![0.0; free.len()];
        let mut variance = variance_at(&changes);
        for _ in 0..ROUNDS {
            changes = self.fit(free, &changes, variance / (tolerance * tolerance))?;
            let last = std::mem::replace(&mut variance, variance_at(&changes));
            if (variance / last - 1.0).abs() <= SETTLED {
                break;
            }
        }
        Ok(changes)
    }
}

/// The equations of some parameters only.
pub(super) fn restricted(all: &Linearised, free: &[SensorParameter]) -> Linearised {
    let index = |unknown: usize| free[unknown].index();
    Linearised {
        gram: Mat::from_fn(free.len(), free.len(), |one, other| {
            all.gram[(index(one), index(other))]
        }),
        descent: free.iter().map(|parameter| all.descent[parameter.index()]).collect(),
        squares: all.squares,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::ArrayScale;
    use glam::DVec3;

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
            let samples = [pressed.clone()];
            let mut problem = Problem::new(&model, &samples);
            problem.references = [1.0; COUNT];
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
                problem.residuals(&model, |_, column, residual, slopes| {
                    assert!((residual + at[column]).abs() < 1e-13, "{text}");
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
