//! Identifiability: how well the readings of a row-wire determine its deformation.

use faer::Mat;
use glam::DVec3;

use crate::{
    sensor::{Axes, RelativeNoise, RowConductance, SensorError, SensorModel},
    text::counted,
};

/// Deformation patterns that the readings of one row-wire determine, from the singular values of the Jacobian of ln
/// R.
///
/// With readings that are off by ε (relative, one standard deviation), a deformation pattern with singular value s is
/// known to ε/s millimetres: the smallest value limits the noise that the sensor can tolerate.
#[derive(Clone, Debug, PartialEq)]
pub struct Identifiability {
    /// The row-wire, from 0.
    pub row: usize,
    /// Axes along which the nodes move.
    pub axes: Axes,
    /// Number of readings of the row, M4.
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
    /// If `noise` has a common error, such as the gain of a snapshot, a change common to all readings counts only as far as
    /// that error allows. Readings with independent errors alone (`noise.own`) and these singular values then determine as
    /// much as the readings with both.
    ///
    /// # Errors
    /// If there is no such row, no resistance for the deformation, or the decomposition does not converge.
    pub fn of_row(
        model: &SensorModel,
        row: usize,
        displacements_mm: &[DVec3],
        axes: Axes,
        noise: RelativeNoise,
    ) -> Result<Self, SensorError> {
        let (rows, equations) = (model.scale.rows(), model.scale.columns());
        if row >= rows {
            return Err(SensorError::Row { row, rows });
        }
        model.row_resistances(row, displacements_mm)?;
        let mut conductance = RowConductance::new(model, axes);
        conductance.evaluate(model, row, displacements_mm);
        let unknowns = displacements_mm.len() * axes.count();
        // ln R = ln g − ln s, hence the minus sign; rows of zeros complete the basis if there are too few readings.
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
        let svd = jacobian.thin_svd().map_err(|_| SensorError::NotConverged(row))?;
        // Rounding would turn the zeros of the added rows into about 1e-17.
        let singular_values = svd.S().column_vector().iter().enumerate();
        let singular_values = singular_values.map(|(pattern, &value)| if pattern < equations { value } else { 0.0 });
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
        // The sign of a pattern is arbitrary; downwards is the direction of a press.
        let sign = if worst.sum() < 0.0 { -1.0 } else { 1.0 };
        Ok(Self {
            row,
            axes,
            equations,
            singular_values_per_mm: singular_values.collect(),
            worst_pattern: nodes.clone().map(|node| by_axis(&|u| sign * worst[u], node)).collect(),
            sensitivity_per_mm: nodes.map(|node| by_axis(&rms, node)).collect(),
        })
    }

    /// Number of unknowns of the row.
    pub fn unknowns(&self) -> usize {
        self.singular_values_per_mm.len()
    }

    /// Condition number: largest over smallest singular value; infinite if some pattern is not visible in the
    /// readings.
    pub fn condition(&self) -> f64 {
        match self.singular_values_per_mm[..] {
            [largest, .., smallest] if smallest > 0.0 => largest / smallest,
            [only] if only > 0.0 => 1.0,
            _ => f64::INFINITY,
        }
    }

    /// Standard deviation in millimetres of the worst-determined pattern, for readings with an independent relative
    /// error of `noise`; infinite if the readings do not depend on it.
    pub fn worst_spread_mm(&self, noise: f64) -> f64 {
        match self.singular_values_per_mm.last() {
            Some(&smallest) if smallest > 0.0 => noise / smallest,
            _ => f64::INFINITY,
        }
    }

    /// Share of a prior spread of `prior_mm` (standard deviation of each unknown) that remains after a reading with
    /// `noise` (relative): the root mean over patterns of 1 / (1 + (s·prior/noise)²). 0 means that everything is
    /// known, 1 that the reading carries no information. A pattern that no reading depends on (s = 0) keeps its whole
    /// spread, also without noise.
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

    /// Rows whose undeformed readings differ by less count as identical even without noise.
    pub const SAME_ROWS: f64 = 1e-9;

    /// The two row-wires whose undeformed readings are most alike, with the rms over readings of the difference of ln R apart
    /// from an error common to all readings; `None` for a single row-wire.
    ///
    /// A layout that is symmetric about a line between row-wires gives mirror rows the same readings: no decoder can
    /// distinguish them unless the electronics report the row. If `noise` has a common error, such as the gain of a
    /// snapshot, a difference that is common to all readings counts only as far as that error allows.
    ///
    /// # Errors
    /// If the undeformed sensor has no resistance.
    pub fn most_alike_rows(
        model: &SensorModel,
        noise: RelativeNoise,
    ) -> Result<Option<([usize; 2], f64)>, SensorError> {
        let rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
        let readings: Vec<Vec<f64>> = (0..model.scale.rows())
            .map(|row| model.row_resistances(row, &rest))
            .collect::<Result<_, _>>()?;
        let weight = noise.weight_of_mean(model.scale.columns());
        let mut closest = None;
        for (second, of_second) in readings.iter().enumerate() {
            for (first, of_first) in readings[..second].iter().enumerate() {
                let differences = of_first.iter().zip(of_second).map(|(a, b)| (a / b).ln());
                let hidden = (1.0 - weight) * differences.clone().sum::<f64>() / of_first.len() as f64;
                let squares = differences.map(|difference| (difference - hidden).powi(2));
                let difference = (squares.sum::<f64>() / of_first.len() as f64).sqrt();
                if closest.is_none_or(|(_, smallest)| difference < smallest) {
                    closest = Some(([first, second], difference));
                }
            }
        }
        Ok(closest)
    }

    /// Condition number from which a row is reported as ill-conditioned: readings exact to 16 digits then leave fewer than 6
    /// in the worst-determined pattern.
    pub const LARGEST_CONDITION: f64 = 1e10;
    /// Remaining share of the prior spread from which noise is reported: the readings then explain less than a tenth
    /// of the variance.
    pub const HOPELESS_SHARE: f64 = 0.95;
    /// Describes obstacles to decoupling and what to change, most severe first. `noise` is the independent relative error of
    /// a reading (for a common error see [`Self::of_row`] and [`Self::most_alike_rows`]), `prior_mm` the standard deviation
    /// of each unknown before reading; `alike` the most similar rows if the row is not known beforehand.
    pub fn warnings(&self, noise: f64, prior_mm: f64, alike: Option<([usize; 2], f64)>) -> Vec<String> {
        let (equations, unknowns, condition) = (self.equations, self.unknowns(), self.condition());
        let mut warnings = Vec::new();
        if equations < unknowns {
            warnings.push(format!(
                "a row has {unknowns} unknowns but only {}: some deformations cannot be determined; use at least {unknowns} \
                 column-wires, or let nodes move along z only",
                counted(equations, "reading")
            ));
        }
        let same = alike.filter(|(_, difference)| *difference <= noise.max(Self::SAME_ROWS));
        if let Some(([first, second], difference)) = same {
            warnings.push(format!(
                "row-wires {} and {} cannot be told apart: at rest their readings differ by {difference:.1e}, the noise is {noise:.1e}; \
                 shift the column nodes so that no row mirrors another, or use a known row",
                first + 1,
                second + 1
            ));
        }
        let share = self.remaining_share(noise, prior_mm);
        if share >= Self::HOPELESS_SHARE {
            warnings.push(format!(
                "with noise of {noise:.1e} the readings hardly constrain the deformation ({:.0} % of its spread remains); \
                 lower the noise, reduce the height, widen the node pitch, or add column-wires",
                100.0 * share
            ));
        }
        if condition >= Self::LARGEST_CONDITION {
            let finding = match condition {
                f64::INFINITY => "changes no reading at all".to_owned(),
                _ => format!("is determined {condition:.0e} times worse than another: even rounding hides it"),
            };
            warnings.push(format!(
                "some deformation pattern {finding}; reduce the height, widen the node pitch, add column-wires, or let nodes \
                 move along z only"
            ));
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::Identifiability;
    use super::*;
    use crate::sensor::{ArrayScale, Axes, SensorModel};

    pub(super) fn at_rest(model: &SensorModel, row: usize, axes: Axes) -> Identifiability {
        let rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
        Identifiability::of_row(model, row, &rest, axes, RelativeNoise::default()).unwrap()
    }

    /// One node over one column node: R = g·d, so ∂ ln R/∂uz = −z/d².
    #[test]
    fn a_single_pair_has_a_closed_form() {
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
    fn a_common_gain_agrees_with_the_dense_covariance_formula() {
        let model = SensorModel::new("3x2_2x8".parse().unwrap());
        let noise = RelativeNoise { own: 1e-3, common: 0.1 };
        let rest = [DVec3::ZERO; 2];
        let seen = Identifiability::of_row(&model, 1, &rest, Axes::Z, noise).unwrap();
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
        // One reading of one unknown: the spread of the gain alone remains.
        let single = SensorModel::new("1x1_1x1".parse().unwrap());
        let seen = |noise| Identifiability::of_row(&single, 0, &[DVec3::ZERO], Axes::Z, noise).unwrap();
        let exact = RelativeNoise { own: 0.0, ..noise };
        let spread = seen(noise).worst_spread_mm(noise.own);
        let alone = at_rest(&single, 0, Axes::Z).worst_spread_mm(noise.total());
        assert!((spread / alone - 1.0).abs() < 1e-9, "{spread} {alone}");
        assert!(seen(exact).singular_values_per_mm[0] < 1e-14);
    }

    #[test]
    fn the_worst_pattern_changes_readings_least() {
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

    /// Four readings determine four of six patterns exactly; the other two keep their whole prior spread.
    #[test]
    fn unseen_patterns_keep_their_whole_spread_without_noise() {
        let seen = at_rest(&SensorModel::new("2x6_3x4".parse().unwrap()), 1, Axes::Z);
        let share = seen.remaining_share(0.0, 0.3);
        assert!((share - (2.0_f64 / 6.0).sqrt()).abs() < 1e-12, "{share}");
        // Nearly the same with a little noise, which hides a little more.
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

    #[test]
    fn mirror_rows_are_reported() {
        let mut model = SensorModel::new("10x6_3x18".parse().unwrap());
        let default = Identifiability::most_alike_rows(&model, RelativeNoise::default())
            .unwrap()
            .unwrap();
        assert!(default.1 > 1e-3, "{default:?}");
        // Column nodes at 7.5, 12.5, 17.5 are symmetric about x = 12.5, the middle of rows 8 to 17.
        model.geometry.column_node_x0_mm = 7.5;
        let pair = Identifiability::most_alike_rows(&model, RelativeNoise::default())
            .unwrap()
            .unwrap();
        let ([first, second], difference) = pair;
        assert!(difference < 1e-14, "{pair:?}");
        assert_eq!(first + second, 9);
        let warnings = Identifiability::of_row(&model, 0, &[DVec3::ZERO; 6], Axes::Z, RelativeNoise::default())
            .unwrap()
            .warnings(0.0, 0.3, Some(pair));
        let words = &warnings[0];
        assert!(
            words.contains("cannot be told apart") && words.contains("shift"),
            "{words}"
        );
        assert_eq!(
            Identifiability::most_alike_rows(&SensorModel::new("1x6_3x18".parse().unwrap()), RelativeNoise::default()),
            Ok(None)
        );
    }

    #[test]
    fn errors_count_rows_from_one() {
        let model = SensorModel::new(ArrayScale::default());
        let error =
            Identifiability::of_row(&model, 10, &[DVec3::ZERO; 10], Axes::Z, RelativeNoise::default()).unwrap_err();
        assert_eq!(error.to_string(), "row 11 does not exist: the array has rows 1 to 10");
        assert!(SensorError::NotConverged(0).to_string().contains("row 1 "));
    }

    #[test]
    fn too_few_readings_leave_a_pattern_unseen() {
        let model = SensorModel::new("2x6_3x4".parse().unwrap());
        let seen = at_rest(&model, 1, Axes::Z);
        assert_eq!(seen.condition(), f64::INFINITY);
        assert_eq!(seen.unknowns(), 6);
        let length = seen.worst_pattern.iter().map(|p| p.length_squared()).sum::<f64>();
        assert!((length - 1.0).abs() < 1e-12);
        let warnings = seen.warnings(0.0, 0.3, None);
        assert!(warnings[0].contains("6 unknowns but only 4 readings"), "{warnings:?}");
    }

    #[test]
    fn noise_is_reported_only_when_it_hides_nearly_everything() {
        let seen = at_rest(&SensorModel::new(ArrayScale::default()), 0, Axes::Z);
        assert_eq!(seen.remaining_share(0.0, 0.3), 0.0);
        assert!(seen.warnings(1e-4, 0.3, None).is_empty());
        assert!((seen.remaining_share(1e3, 0.3) - 1.0).abs() < 1e-6);
        let words = &seen.warnings(1.0, 0.3, None)[0];
        assert!(words.contains("100 %") || words.contains("99 %"), "{words}");
    }
}
