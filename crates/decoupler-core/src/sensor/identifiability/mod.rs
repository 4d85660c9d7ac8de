//! Identifiability: how well the readings of a row-wire determine its deformation.

mod alike_rows;
mod error;
mod warning;

pub use alike_rows::RowPair;
pub use error::IdentifiabilityError;
pub use warning::IdentifiabilityWarning;

use faer::Mat;
use glam::DVec3;

use super::{Axes, RelativeNoise, RowConductance, SensorModel};

/// Deformation patterns that the readings of one row-wire see, from the singular values of the Jacobian of ln R.
///
/// With readings that are off by ε (relative, one standard deviation), a deformation pattern whose singular value is s
/// is known to ε/s millimetres: the smallest value decides what noise the sensor can bear.
#[derive(Clone, Debug, PartialEq)]
pub struct Identifiability {
    /// The row-wire, from 0.
    pub row: usize,
    /// Along which axes the nodes move.
    pub axes: Axes,
    /// Readings of the row: M4.
    pub equations: usize,
    /// Singular values of ∂ ln R/∂u in 1/mm, largest first, one for each unknown (0 where readings are too few).
    pub singular_values_per_mm: Vec<f64>,
    /// The pattern of unit length that changes the readings least: one displacement for each node.
    pub worst_pattern: Vec<DVec3>,
    /// Sensitivity of the row's readings to each node: rms over readings of ∂ ln R/∂u, for each axis, in 1/mm.
    pub sensitivity_per_mm: Vec<DVec3>,
}

impl Identifiability {
    /// Analyses row-wire `row` whose nodes are displaced by `displacements_mm` (M2 of them) and move along `axes`.
    ///
    /// # Errors
    /// No such row, no resistance for the deformation, or a decomposition that does not converge.
    pub fn of_row(
        model: &SensorModel,
        row: usize,
        displacements_mm: &[DVec3],
        axes: Axes,
    ) -> Result<Self, IdentifiabilityError> {
        Self::of_row_with_gain(model, row, displacements_mm, axes, RelativeNoise::default())
    }

    /// As [`Self::of_row`], for readings with this noise: where they have a common error, such as the gain of a snapshot,
    /// what all of them have in common counts only as far as that error leaves it. Readings with an error of their own
    /// alone (`noise.own`) and these singular values then determine as much as the readings with both.
    ///
    /// # Errors
    /// As [`Self::of_row`].
    pub fn of_row_with_gain(
        model: &SensorModel,
        row: usize,
        displacements_mm: &[DVec3],
        axes: Axes,
        noise: RelativeNoise,
    ) -> Result<Self, IdentifiabilityError> {
        let (rows, equations) = (model.scale.rows(), model.scale.columns());
        if row >= rows {
            return Err(IdentifiabilityError::Row { row, rows });
        }
        model.row_resistances(row, displacements_mm)?;
        let mut conductance = RowConductance::new(model, axes);
        conductance.evaluate(model, row, displacements_mm);
        let unknowns = displacements_mm.len() * axes.count();
        // ln R = ln g − ln s, so the signs turn; rows of zeros complete the basis where readings are too few.
        let mut jacobian = Mat::from_fn(equations.max(unknowns), unknowns, |k, unknown| {
            if k < equations {
                -conductance.derivatives(unknown)[k] / conductance.sums()[k]
            } else {
                0.0
            }
        });
        let weight = noise.weight_of_mean(equations);
        if weight < 1.0 {
            for unknown in 0..unknowns {
                let mean = (0..equations).map(|k| jacobian[(k, unknown)]).sum::<f64>() / equations as f64;
                (0..equations).for_each(|k| jacobian[(k, unknown)] -= (1.0 - weight) * mean);
            }
        }
        let svd = jacobian
            .thin_svd()
            .map_err(|_| IdentifiabilityError::NotConverged(row))?;
        // Rounding would leave the zeros of the added rows at about 1e-17.
        let singular_values_per_mm = svd.S().column_vector().iter().enumerate();
        let singular_values_per_mm =
            singular_values_per_mm.map(|(pattern, &value)| if pattern < equations { value } else { 0.0 });
        let worst = svd.V().col(unknowns - 1);
        let nodes = 0..displacements_mm.len();
        let by_axis = |value: &dyn Fn(usize) -> f64, node: usize| {
            let mut vector = [0.0; 3];
            for (place, &axis) in axes.indices().iter().enumerate() {
                vector[axis] = value(node * axes.count() + place);
            }
            DVec3::from_array(vector)
        };
        let rms = |unknown: usize| jacobian.col(unknown).norm_l2() / (equations as f64).sqrt();
        // Which way a pattern points means nothing; downwards is what presses.
        let sign = if worst.sum() < 0.0 { -1.0 } else { 1.0 };
        Ok(Self {
            row,
            axes,
            equations,
            singular_values_per_mm: singular_values_per_mm.collect(),
            worst_pattern: nodes.clone().map(|node| by_axis(&|u| sign * worst[u], node)).collect(),
            sensitivity_per_mm: nodes.map(|node| by_axis(&rms, node)).collect(),
        })
    }

    /// Unknowns of the row.
    pub fn unknowns(&self) -> usize {
        self.singular_values_per_mm.len()
    }

    /// Largest singular value over the smallest; infinite where some pattern is not seen at all.
    pub fn condition(&self) -> f64 {
        match self.singular_values_per_mm[..] {
            [largest, .., smallest] if smallest > 0.0 => largest / smallest,
            [only] if only > 0.0 => 1.0,
            _ => f64::INFINITY,
        }
    }

    /// Standard deviation in millimetres to which readings with an own error of `noise` (relative) know the worst-seen pattern; infinite
    /// where they do not see it at all.
    pub fn worst_spread_mm(&self, noise: f64) -> f64 {
        match self.singular_values_per_mm.last() {
            Some(&smallest) if smallest > 0.0 => noise / smallest,
            _ => f64::INFINITY,
        }
    }

    /// Share of a prior spread of `prior_mm` (standard deviation of each unknown) that remains after a reading with
    /// `noise` (relative): the root mean over patterns of 1 / (1 + (s·prior/noise)²). 0 means that everything is known, 1
    /// that the reading told nothing. Of a pattern that no reading sees (s = 0) everything remains, also without noise.
    pub fn remaining_share(&self, noise: f64, prior_mm: f64) -> f64 {
        let remaining = |&s: &f64| {
            let seen = s * prior_mm / noise;
            if s == 0.0 {
                1.0
            } else if seen.is_finite() {
                1.0 / (1.0 + seen * seen)
            } else {
                0.0
            }
        };
        (self.singular_values_per_mm.iter().map(remaining).sum::<f64>() / self.unknowns() as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::ArrayScale;

    pub(super) fn at_rest(model: &SensorModel, row: usize, axes: Axes) -> Identifiability {
        let rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
        Identifiability::of_row(model, row, &rest, axes).unwrap()
    }

    /// One node over one column node: R = g·d, so ∂ ln R/∂uz = −z/d².
    #[test]
    fn a_single_pair_is_known_in_closed_form() {
        let mut model = SensorModel::new("1x1_1x1".parse().unwrap());
        model.geometry.column_node_x0_mm = model.geometry.row_x0_mm + 12.0;
        let seen = at_rest(&model, 0, Axes::Z);
        assert!((seen.singular_values_per_mm[0] - 5.0 / 169.0).abs() < 1e-15);
        assert_eq!(seen.condition(), 1.0);
        assert!((seen.worst_pattern[0].z - 1.0).abs() < 1e-15);
        assert!((seen.sensitivity_per_mm[0].z - 5.0 / 169.0).abs() < 1e-15);
        assert!((seen.worst_spread_mm(1e-3) - 1e-3 * 169.0 / 5.0).abs() < 1e-15);
    }

    /// The dense formula: (Jᵀ Σ⁻¹ J)⁻¹ with Σ = own² I + common² 1 1ᵀ, J by differences of the resistances.
    #[test]
    fn a_common_gain_leaves_what_the_covariance_of_the_readings_says() {
        let model = SensorModel::new("3x2_2x8".parse().unwrap());
        let noise = RelativeNoise { own: 1e-3, common: 0.1 };
        let rest = [DVec3::ZERO; 2];
        let seen = Identifiability::of_row_with_gain(&model, 1, &rest, Axes::Z, noise).unwrap();
        let ln_ohm = |u: [f64; 2]| -> Vec<f64> {
            let ohm = model.row_resistances(1, &u.map(|z| DVec3::Z * z)).unwrap();
            ohm.into_iter().map(f64::ln).collect()
        };
        let slopes = [[1e-5, 0.0], [0.0, 1e-5]].map(|step| {
            let (above, below) = (ln_ohm(step), ln_ohm(step.map(|z| -z)));
            let slopes = above.iter().zip(&below).map(|(a, b)| (a - b) / 2e-5);
            slopes.collect::<Vec<f64>>()
        });
        // Sherman and Morrison: Σ⁻¹ = I/own² − common²/(own² (own² + 8 common²)) 1 1ᵀ.
        let share = 0.01 / (1e-6 + 8.0 * 0.01);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let entry = |a: &[f64], b: &[f64]| 1e6 * (dot(a, b) - share * a.iter().sum::<f64>() * b.iter().sum::<f64>());
        let [a, b] = &slopes;
        let (trace, determinant) = (
            entry(a, a) + entry(b, b),
            entry(a, a) * entry(b, b) - entry(a, b).powi(2),
        );
        let [large, small] = seen.singular_values_per_mm[..] else {
            panic!("two unknowns")
        };
        let found = [large, small].map(|value| (value / noise.own).powi(2));
        assert!(((found[0] + found[1]) / trace - 1.0).abs() < 1e-6);
        assert!((found[0] * found[1] / determinant - 1.0).abs() < 1e-6);
        // One reading of one unknown: nothing is left but the gain's own spread.
        let single = SensorModel::new("1x1_1x1".parse().unwrap());
        let seen = |noise| Identifiability::of_row_with_gain(&single, 0, &[DVec3::ZERO], Axes::Z, noise).unwrap();
        let exact = RelativeNoise { own: 0.0, ..noise };
        let spread = seen(noise).worst_spread_mm(noise.own);
        let alone = at_rest(&single, 0, Axes::Z).worst_spread_mm(noise.total());
        assert!((spread / alone - 1.0).abs() < 1e-9, "{spread} {alone}");
        assert!(seen(exact).singular_values_per_mm[0] < 1e-14);
    }

    #[test]
    fn moving_along_the_worst_pattern_changes_readings_least() {
        let model = SensorModel::new(ArrayScale::default());
        let seen = at_rest(&model, 4, Axes::Z);
        let rest = model.row_resistances(4, &[DVec3::ZERO; 10]).unwrap();
        let step_mm = 1e-3;
        let change = |pattern: &[DVec3]| {
            let moved: Vec<DVec3> = pattern.iter().map(|&p| step_mm * p).collect();
            let moved = model.row_resistances(4, &moved).unwrap();
            let squares = moved.iter().zip(&rest).map(|(a, b)| (a / b).ln().powi(2));
            squares.sum::<f64>().sqrt() / step_mm
        };
        let smallest = seen.singular_values_per_mm[9];
        assert!((change(&seen.worst_pattern) / smallest - 1.0).abs() < 0.05);
        for node in 0..10 {
            let mut single = [DVec3::ZERO; 10];
            single[node] = DVec3::Z;
            assert!(change(&single) > smallest);
        }
    }

    /// Four readings determine four of six patterns exactly; of the other two the whole prior remains.
    #[test]
    fn unseen_patterns_remain_whole_without_noise() {
        let seen = at_rest(&SensorModel::new("2x6_3x4".parse().unwrap()), 1, Axes::Z);
        let share = seen.remaining_share(0.0, 0.3);
        assert!((share - (2.0_f64 / 6.0).sqrt()).abs() < 1e-12, "{share}");
        // With a little noise the same, except for what that hides.
        assert!((seen.remaining_share(1e-9, 0.3) - share).abs() < 1e-3);
        assert_eq!(seen.worst_spread_mm(0.0), f64::INFINITY);
    }

    #[test]
    fn sideways_unknowns_are_worse_conditioned() {
        let model = SensorModel::new(ArrayScale::default());
        let (z, xyz) = (at_rest(&model, 3, Axes::Z), at_rest(&model, 3, Axes::Xyz));
        assert_eq!((z.unknowns(), xyz.unknowns()), (10, 30));
        assert!(xyz.condition() > z.condition());
        assert!(z.worst_pattern.iter().all(|p| p.x == 0.0 && p.y == 0.0));
    }
}
