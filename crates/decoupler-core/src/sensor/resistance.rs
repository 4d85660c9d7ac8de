use glam::DVec3;
use ndarray::Array3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{ArrayScale, Axes, Geometry, LARGEST_COUNT, RowConductance, conductance::sum_reciprocal_distances};

/// Default resistance per millimetre of rubber. The paper gives none: g scales all resistances alike, so relative errors
/// do not depend on it.
pub const DEFAULT_RESISTIVITY_OHM_PER_MM: f64 = 100.0;

/// The resistance model of one array: Eq. (1)-(2) of the paper and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorModel {
    /// Numbers of wires and nodes.
    pub scale: ArrayScale,
    /// Positions of the nodes.
    pub geometry: Geometry,
    /// Resistance g per millimetre of rubber.
    pub resistivity_ohm_per_mm: f64,
}

impl Default for SensorModel {
    /// The paper's main array, 10×10_5×30.
    fn default() -> Self {
        Self::new(ArrayScale::default())
    }
}

/// Error of the array scale, the geometry or the resistance model.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SensorError {
    /// The text does not have the form `M1×M2_M3×M4`.
    #[error("'{0}' is not an array scale: write M1xM2_M3xM4, for example 10x10_5x30")]
    ScaleForm(String),
    /// A count is zero or too large.
    #[error("the number of {what} is {count}: it must be from 1 to {LARGEST_COUNT}")]
    Count {
        /// Name of the count.
        what: &'static str,
        /// Value of the count.
        count: usize,
    },
    /// A length is NaN or infinite.
    #[error("{what} is {}: give a finite length in millimetres", short(*.value))]
    NotFinite {
        /// Name of the length.
        what: &'static str,
        /// Value.
        value: f64,
    },
    /// A length is not positive.
    #[error("{what} is {} mm: it must be above 0", short(*.value))]
    NotPositive {
        /// Name of the length.
        what: &'static str,
        /// Value.
        value: f64,
    },
    /// g is not a positive number.
    #[error("the resistance per millimetre is {}: it must be above 0 and finite", short(*.0))]
    Resistivity(f64),
    /// A resistance is zero, infinite or NaN.
    #[error(
        "row {}, column {}: the resistance is {} ohm; a node touches a column-wire, or a length is \
         out of range; press less deep, or give lengths closer to a millimetre",
        row + 1,
        column + 1,
        short(*.resistance_ohm)
    )]
    Resistance {
        /// Row-wire, from 0.
        row: usize,
        /// Column-wire, from 0.
        column: usize,
        /// Computed value.
        resistance_ohm: f64,
    },
    /// The array has no such row-wire.
    #[error("row {} does not exist: the array has rows 1 to {rows}", row + 1)]
    Row {
        /// Row-wire requested, from 0.
        row: usize,
        /// Number of row-wires of the array.
        rows: usize,
    },
    /// The singular value decomposition of the Jacobian of a row-wire did not converge.
    #[error("the singular values of row {} did not converge: use lengths of similar size in the geometry", .0 + 1)]
    NotConverged(usize),
}

impl SensorModel {
    /// Creates an array with the assumed geometry and resistivity.
    pub fn new(scale: ArrayScale) -> Self {
        Self {
            scale,
            geometry: Geometry::default(),
            resistivity_ohm_per_mm: DEFAULT_RESISTIVITY_OHM_PER_MM,
        }
    }

    /// Checks geometry and resistivity.
    ///
    /// # Errors
    /// If a value is invalid.
    pub fn check(&self) -> Result<(), SensorError> {
        self.geometry.check()?;
        let g = self.resistivity_ohm_per_mm;
        if g > 0.0 && g.is_finite() {
            Ok(())
        } else {
            Err(SensorError::Resistivity(g))
        }
    }

    /// Returns the position of a node displaced by `displacement_mm`, whose z is positive downwards (compression).
    pub fn displaced_mm(&self, row: usize, node: usize, displacement_mm: DVec3) -> DVec3 {
        let rest_mm = self.geometry.row_node_mm(self.scale, row, node);
        rest_mm + DVec3::new(displacement_mm.x, displacement_mm.y, -displacement_mm.z)
    }

    /// Returns the displacement of a node at `position_mm`, z positive downwards: the inverse of [`Self::displaced_mm`].
    pub fn displacement_mm(&self, row: usize, node: usize, position_mm: DVec3) -> DVec3 {
        let apart = position_mm - self.geometry.row_node_mm(self.scale, row, node);
        DVec3::new(apart.x, apart.y, -apart.z)
    }

    /// Computes the resistances of row-wire `row` whose nodes are displaced by `displacements_mm` (M2), and writes them
    /// to `resistances_ohm` (M4), by Eq. (2):
    ///
    /// `1/R_lk = Σ_i Σ_j 1 / (g · |p_li + u_li − q_kj|)`
    ///
    /// # Errors
    /// If a resistance is not positive and finite.
    ///
    /// # Panics
    /// If the slices do not have M2 and M4 elements.
    pub fn row_resistances_into(
        &self,
        row: usize,
        displacements_mm: &[DVec3],
        resistances_ohm: &mut [f64],
    ) -> Result<(), SensorError> {
        assert_eq!(displacements_mm.len(), self.scale.nodes_per_row());
        assert_eq!(resistances_ohm.len(), self.scale.columns());
        // The sum of reciprocal distances, per millimetre, is accumulated in place of the resistance.
        let at = (self, row, displacements_mm);
        sum_reciprocal_distances::<0, false>(at, resistances_ohm, &mut []);
        for (column, value) in resistances_ohm.iter_mut().enumerate() {
            *value = self.resistivity_ohm_per_mm / *value;
            if !(*value > 0.0 && value.is_finite()) {
                return Err(SensorError::Resistance {
                    row,
                    column,
                    resistance_ohm: *value,
                });
            }
        }
        Ok(())
    }

    /// Returns the resistances of [`Self::row_resistances_into`] in ohm as a new vector (M4).
    ///
    /// # Errors
    /// If a resistance is not positive and finite.
    pub fn row_resistances(&self, row: usize, displacements_mm: &[DVec3]) -> Result<Vec<f64>, SensorError> {
        let mut resistances_ohm = vec![0.0; self.scale.columns()];
        self.row_resistances_into(row, displacements_mm, &mut resistances_ohm)?;
        Ok(resistances_ohm)
    }

    /// Returns the analytic derivatives ∂R_lk/∂u_li of row-wire `row` in ohm per millimetre: M4 × M2 × 3, the last axis
    /// being ux, uy, uz (uz downwards).
    ///
    /// With s = Σ 1/d and R = g/s, ∂R/∂u = −(R/s) ∂s/∂u.
    ///
    /// # Errors
    /// If a resistance is not positive and finite.
    pub fn row_jacobian(&self, row: usize, displacements_mm: &[DVec3]) -> Result<Array3<f64>, SensorError> {
        let resistances_ohm = self.row_resistances(row, displacements_mm)?;
        let mut conductance = RowConductance::new(self, Axes::Xyz);
        conductance.evaluate(self, row, displacements_mm);
        let shape = (self.scale.columns(), self.scale.nodes_per_row(), 3);
        Ok(Array3::from_shape_fn(shape, |(column, node, axis)| {
            let slope = conductance.derivatives(3 * node + axis)[column];
            -resistances_ohm[column] / conductance.sums()[column] * slope
        }))
    }
}

/// Noise of a reading relative to the reading, from all sources of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelativeNoise {
    /// Standard deviation of the independent error of each reading.
    pub own: f64,
    /// Standard deviation of the error that all readings of a snapshot have in common.
    pub common: f64,
}

impl RelativeNoise {
    /// Returns the standard deviation of the total error of a reading.
    pub fn total(self) -> f64 {
        libm::hypot(self.own, self.common)
    }

    /// Returns the factor for the mean of `readings` by which readings with a common error can be weighted like
    /// independent ones: own / √(own² + readings · common²), from the eigenvalues of the covariance own² I + common² 1
    /// 1ᵀ. The independent error of exact readings is the rounding of double precision.
    pub(crate) fn weight_of_mean(self, readings: usize) -> f64 {
        if self.common == 0.0 {
            return 1.0;
        }
        let own = self.own.max(f64::EPSILON);
        own / libm::hypot(own, self.common * (readings as f64).sqrt())
    }
}

/// Formats a number of any size in a few characters for messages: `0.5`, `-5`, `1e300`.
pub fn short(value: f64) -> String {
    if value == 0.0 || (1e-4..1e6).contains(&value.abs()) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One node over one column node: R is g times their distance.
    #[test]
    fn a_single_pair_has_the_resistance_of_its_distance() {
        let mut model = SensorModel::new("1x1_1x1".parse().unwrap());
        model.geometry.column_node_x0_mm = model.geometry.row_x0_mm;
        model.resistivity_ohm_per_mm = 470.0;
        let pressed = DVec3::new(0.0, 0.0, 1.0);
        assert_eq!(model.row_resistances(0, &[pressed]).unwrap(), [470.0 * 4.0]);
    }

    #[test]
    fn resistivity_scales_resistances() {
        for g in [1e-12, 1.0, 1e12] {
            let mut model = SensorModel::new(ArrayScale::default());
            let rest = vec![DVec3::ZERO; 10];
            let reference = model.row_resistances(3, &rest).unwrap();
            model.resistivity_ohm_per_mm = g;
            for (scaled, value) in model.row_resistances(3, &rest).unwrap().iter().zip(&reference) {
                let ratio = scaled / value * DEFAULT_RESISTIVITY_OHM_PER_MM / g;
                assert!((ratio - 1.0).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn a_touching_node_is_an_error_and_a_nearly_touching_one_is_not() {
        let mut model = SensorModel::new("1x1_1x1".parse().unwrap());
        model.geometry.column_node_x0_mm = model.geometry.row_x0_mm;
        let touch = DVec3::new(0.0, 0.0, model.geometry.height_mm);
        let error = model.row_resistances(0, &[touch]).unwrap_err();
        assert!(error.to_string().contains("row 1, column 1"), "{error}");
        let near = DVec3::new(0.0, 0.0, model.geometry.height_mm * (1.0 - 1e-15));
        assert!(model.row_resistances(0, &[near]).is_ok());
        assert!(model.row_resistances(0, &[DVec3::NAN]).is_err());
    }

    #[test]
    fn extreme_numbers_are_short() {
        let cases = [
            (0.0, "0"),
            (-5.0, "-5"),
            (0.25, "0.25"),
            (1e6, "1e6"),
            (-1e300, "-1e300"),
            (2.5e-300, "2.5e-300"),
            (f64::NAN, "NaN"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(short(value), text);
        }
        assert!(short(f64::MAX).len() < 25 && short(-f64::MIN_POSITIVE).len() < 25);
    }
}
