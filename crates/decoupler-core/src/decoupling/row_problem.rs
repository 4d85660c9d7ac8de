use faer::{Mat, Par, Side, linalg::triangular_solve};
use glam::DVec3;
use rand::Rng;

use super::{Newton, NewtonRules};
use crate::{
    scene::{Loading, Scene},
    sensor::{Axes, RowConductance, SensorModel},
};

/// Eq. (2) of one row-wire as equations for the displacements that the scene allows: `ρ_k(u) = m_k · s_k(u)/g − 1 = 0`
/// with m the readings and g/s the model's resistances.
///
/// For a reading `m = R · (1 + ε)` of a true resistance R, ρ at the true deformation is ε: the residual is
/// the relative error of the reading, with no approximation. And s is a plain sum over nodes, nearly linear in u.
#[derive(Clone, Debug)]
pub(crate) struct RowProblem {
    model: SensorModel,
    axes: Axes,
    conductance: RowConductance,
    displacements_mm: Vec<DVec3>,
    readings_ohm: Vec<f64>,
    row: usize,
    residuals: Vec<f64>,
}

/// The range of one unknown in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) lowest: f64,
    pub(crate) highest: f64,
}

impl Range {
    pub(crate) fn middle(self) -> f64 {
        0.5 * (self.lowest + self.highest)
    }

    pub(crate) fn width(self) -> f64 {
        self.highest - self.lowest
    }

    /// The nearest value within the range; its middle for NaN.
    pub(crate) fn clamp(self, value: f64) -> f64 {
        if value.is_nan() {
            self.middle()
        } else {
            value.clamp(self.lowest, self.highest)
        }
    }
}

/// The ranges of the unknowns of a row-wire in a scene: node by node, the axes of each node together.
pub(crate) fn ranges(model: &SensorModel, scene: &Scene) -> Vec<Range> {
    let stroke_mm = scene.stroke_mm(&model.geometry);
    let shift_mm = scene.movement.largest_shift_mm();
    let of_axis = |axis: usize| match axis {
        2 => Range {
            lowest: 0.0,
            highest: stroke_mm,
        },
        _ => Range {
            lowest: -shift_mm,
            highest: shift_mm,
        },
    };
    let axes = scene.movement.axes().indices();
    let nodes = 0..model.scale.nodes_per_row();
    nodes.flat_map(|_| axes.iter().map(|&axis| of_axis(axis))).collect()
}

/// [`ranges`] widened by their width on both sides, but not as far as the column-wires.
pub(crate) fn wide_ranges(model: &SensorModel, scene: &Scene) -> Vec<Range> {
    let height_mm = model.geometry.height_mm;
    let lowest_gap_mm = 0.5 * (height_mm - scene.stroke_mm(&model.geometry));
    let axes = scene.movement.axes().indices();
    let widened = |(unknown, range): (usize, Range)| Range {
        lowest: range.lowest - range.width(),
        highest: match axes[unknown % axes.len()] {
            2 => (range.highest + range.width()).min(height_mm - lowest_gap_mm),
            _ => range.highest + range.width(),
        },
    };
    ranges(model, scene).into_iter().enumerate().map(widened).collect()
}

impl RowProblem {
    pub(crate) fn new(model: &SensorModel, axes: Axes) -> Self {
        Self {
            model: *model,
            axes,
            conductance: RowConductance::new(model, axes),
            displacements_mm: vec![DVec3::ZERO; model.scale.nodes_per_row()],
            readings_ohm: vec![0.0; model.scale.columns()],
            row: 0,
            residuals: vec![0.0; model.scale.columns()],
        }
    }

    pub(crate) fn unknowns(&self) -> usize {
        self.displacements_mm.len() * self.axes.count()
    }

    pub(crate) fn equations(&self) -> usize {
        self.readings_ohm.len()
    }

    /// Number of coordinates.
    pub(crate) fn coordinates(&self) -> usize {
        3 * self.displacements_mm.len()
    }

    /// Makes `row` the current row-wire.
    pub(crate) fn turn_to(&mut self, row: usize) {
        self.row = row;
    }

    /// Sets the readings of row-wire `row`, for which the equations are solved.
    pub(crate) fn read(&mut self, row: usize, readings_ohm: &[f64]) {
        self.row = row;
        self.readings_ohm.copy_from_slice(readings_ohm);
    }

    /// Evaluates residuals and derivatives at `unknowns_mm`; returns the rms residual.
    pub(crate) fn evaluate(&mut self, unknowns_mm: &[f64]) -> f64 {
        self.displace(unknowns_mm);
        self.conductance.evaluate(&self.model, self.row, &self.displacements_mm);
        self.write_residuals()
    }

    /// Evaluates only the residuals at `unknowns_mm`; derivatives remain those of the last [`Self::evaluate`].
    pub(crate) fn evaluate_residuals(&mut self, unknowns_mm: &[f64]) -> f64 {
        self.displace(unknowns_mm);
        self.conductance
            .evaluate_sums(&self.model, self.row, &self.displacements_mm);
        self.write_residuals()
    }

    fn displace(&mut self, unknowns_mm: &[f64]) {
        let axes = self.axes.indices();
        let nodes = unknowns_mm.chunks_exact(axes.len());
        for (displacement, values) in self.displacements_mm.iter_mut().zip(nodes) {
            for (&axis, &value) in axes.iter().zip(values) {
                displacement[axis] = value;
            }
        }
    }

    fn write_residuals(&mut self) -> f64 {
        let per_sum = 1.0 / self.model.resistivity_ohm_per_mm;
        let mut squares = 0.0;
        let pairs = self.readings_ohm.iter().zip(self.conductance.sums());
        for (residual, (reading, sum)) in self.residuals.iter_mut().zip(pairs) {
            *residual = reading * per_sum * sum - 1.0;
            squares += *residual * *residual;
        }
        (squares / self.residuals.len() as f64).sqrt()
    }

    /// ρ, one for each reading.
    pub(crate) fn residuals(&self) -> &[f64] {
        &self.residuals
    }

    /// ∂ρ_k/∂u in 1/mm.
    pub(crate) fn derivative(&self, reading: usize, unknown: usize) -> f64 {
        self.readings_ohm[reading] / self.model.resistivity_ohm_per_mm * self.conductance.derivatives(unknown)[reading]
    }

    /// R_k = g/s_k of the last evaluation, in ohm.
    pub(crate) fn resistance_ohm(&self, reading: usize) -> f64 {
        self.model.resistivity_ohm_per_mm / self.conductance.sums()[reading]
    }

    /// ∂ ln s_k/∂u in 1/mm of all unknowns, which are −∂ ln R_k/∂u.
    pub(crate) fn log_conductance_slopes(&self, reading: usize) -> impl Iterator<Item = f64> {
        let per_sum = 1.0 / self.conductance.sums()[reading];
        (0..self.unknowns()).map(move |unknown| self.conductance.derivatives(unknown)[reading] * per_sum)
    }

    /// Reading m_k in ohm.
    pub(crate) fn reading_ohm(&self, reading: usize) -> f64 {
        self.readings_ohm[reading]
    }

    /// The unknowns that correspond to absolute coordinates (3·M2) of nodes on the current row-wire.
    pub(crate) fn unknowns_of(&self, coordinates_mm: &[f64], unknowns_mm: &mut [f64]) {
        let axes = self.axes.indices();
        for (node, values) in unknowns_mm.chunks_exact_mut(axes.len()).enumerate() {
            let at = DVec3::from_slice(&coordinates_mm[3 * node..]);
            let displacement = self.model.displacement_mm(self.row, node, at);
            for (&axis, value) in axes.iter().zip(values) {
                *value = displacement[axis];
            }
        }
    }

    /// Absolute coordinates (3·M2) of nodes on the current row-wire.
    pub(crate) fn coordinates_of(&self, unknowns_mm: &[f64], coordinates_mm: &mut [f64]) {
        let axes = self.axes.indices();
        for (node, values) in unknowns_mm.chunks_exact(axes.len()).enumerate() {
            let mut displacement = DVec3::ZERO;
            for (&axis, &value) in axes.iter().zip(values) {
                displacement[axis] = value;
            }
            let at = self.model.displaced_mm(self.row, node, displacement);
            coordinates_mm[3 * node..3 * node + 3].copy_from_slice(&at.to_array());
        }
    }
}

/// Gauss-Newton iteration on Eq. (2) of a row-wire, as plain numbers.
///
/// The unknowns are the displacements of the nodes along the axes that move, node by node. A step minimises ‖J δ + ρ‖
/// with ρ the residuals m·s/g − 1 of the readings m and is shortened to stay within the wide ranges; the answer is
/// clamped to the ranges.
#[derive(Clone, Debug, PartialEq)]
pub struct RowProblemDescription {
    /// Positions of the nodes and resistance per millimetre.
    pub model: SensorModel,
    /// Axes along which the nodes move.
    pub axes: Axes,
    /// Row-wires read, from 0.
    pub rows: Vec<usize>,
    /// How the row-wire of a reading is determined.
    pub row_choice: RowChoice,
    /// Smallest and largest value of each unknown in millimetres.
    pub ranges: Vec<(f64, f64)>,
    /// Range of each unknown that a step may not leave.
    pub wide_ranges: Vec<(f64, f64)>,
    /// Maximum number of steps from one start.
    pub steps: usize,
    /// Step length, relative to the range of the unknown, below which the iteration ends.
    pub tolerance: f64,
    /// True if the method restarts when a start leads to no solution, and failure of all starts is an error.
    pub seeks_solution: bool,
}

/// How the row-wire of a reading is determined.
#[derive(Clone, Debug, PartialEq)]
pub enum RowChoice {
    /// Given with the readings, or the only one.
    Given,
    /// The row-wire whose x is nearest to that of the first answer.
    Nearest,
    /// By trial, in order of similarity with the readings at rest.
    Tried {
        /// Logarithms of the resistances in ohm of each row-wire at rest.
        rest: Vec<Vec<f64>>,
    },
}

impl RowProblemDescription {
    /// Describes the iteration for `rows` of `model` in `scene` with these rules.
    pub(super) fn new(
        (model, scene): (&SensorModel, &Scene),
        (rows, row_choice): (&[usize], RowChoice),
        rules: NewtonRules,
        seeks_solution: bool,
    ) -> Self {
        let pairs = |ranges: Vec<Range>| ranges.iter().map(|range| (range.lowest, range.highest)).collect();
        Self {
            model: *model,
            axes: scene.movement.axes(),
            rows: rows.to_vec(),
            row_choice,
            ranges: pairs(ranges(model, scene)),
            wide_ranges: pairs(wide_ranges(model, scene)),
            steps: rules.steps.min(Newton::MAX_PLAIN_STEPS),
            tolerance: rules.tolerance,
            seeks_solution,
        }
    }
}

/// Gaussian prior of the unknowns of a row-wire, in units of the widths of their ranges: the covariance is invertible
/// for ranges of any length, and of different lengths.
#[derive(Clone, Debug)]
pub(crate) struct GaussianPrior {
    pub(crate) mean: Vec<f64>,
    /// L⁻¹ of the covariance L Lᵀ, lower triangular.
    pub(crate) inverse_root: Mat<f64>,
}

/// Mean and scatter of draws, updated draw by draw (Welford 1962), so that memory does not grow with their number.
#[derive(Clone, Debug)]
struct Moments {
    count: f64,
    mean: Vec<f64>,
    /// Sums of products of deviations from the mean; only the lower triangle is used.
    products: Vec<f64>,
}

impl Moments {
    fn new(unknowns: usize) -> Self {
        Self {
            count: 0.0,
            mean: vec![0.0; unknowns],
            products: vec![0.0; unknowns * unknowns],
        }
    }

    fn add(&mut self, values: impl Iterator<Item = f64>) {
        let n = self.mean.len();
        self.count += 1.0;
        let before: Vec<f64> = values.zip(&self.mean).map(|(value, mean)| value - mean).collect();
        let share = (self.count - 1.0) / self.count;
        for (i, (mean, apart)) in self.mean.iter_mut().zip(&before).enumerate() {
            *mean += apart / self.count;
            let products = &mut self.products[i * n..=i * n + i];
            products
                .iter_mut()
                .zip(&before)
                .for_each(|(sum, other)| *sum += share * apart * other);
        }
    }
}

/// Number of draws that estimate a scene's mean and covariance.
const DRAWS: usize = 4000;

impl GaussianPrior {
    /// Independent unknowns centred in their ranges, with this standard deviation.
    pub(crate) fn independent(ranges: &[Range], deviation: f64) -> Self {
        let (n, inverse) = (ranges.len(), 1.0 / deviation);
        Self {
            mean: ranges.iter().map(|range| range.middle() / range.width()).collect(),
            inverse_root: Mat::from_fn(n, n, |i, j| if i == j { inverse } else { 0.0 }),
        }
    }

    /// Mean and covariance of each of `rows` in `scene`: those of the uniform distribution for nodes that move
    /// independently, estimated from draws for other loadings. No pattern gets a prior spread below
    /// `smallest_spread`.
    pub(crate) fn of_rows(
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        smallest_spread: f64,
        rng: &mut impl Rng,
    ) -> Vec<Self> {
        let ranges = ranges(model, scene);
        if scene.loading == Loading::RandomNodes {
            // The standard deviation of a uniform distribution is its width/√12.
            return vec![Self::independent(&ranges, 1.0 / 12.0_f64.sqrt()); rows.len()];
        }
        let sampler = scene.sampler(model);
        let axes = scene.movement.axes().indices();
        let mut moments = vec![Moments::new(ranges.len()); rows.len()];
        for _ in 0..DRAWS {
            let deformation = sampler.draw(rng);
            for (&row, moments) in rows.iter().zip(&mut moments) {
                let nodes = deformation.row_mm(row).iter();
                let values = nodes.flat_map(|u| axes.iter().map(|&axis| u[axis]));
                moments.add(values.zip(&ranges).map(|(value, range)| value / range.width()));
            }
        }
        moments
            .into_iter()
            .map(|moments| Self::of_moments(moments, smallest_spread))
            .collect()
    }

    /// Approximate number of bytes that [`Self::of_rows`] needs.
    pub(crate) fn bytes(loading: Loading, rows: usize, unknowns: usize) -> u64 {
        // Nodes that move independently have priors in closed form.
        if loading == Loading::RandomNodes {
            return 0;
        }
        let entries = 2 * rows as u64 * (unknowns * unknowns) as u64;
        entries.saturating_mul(size_of::<f64>() as u64)
    }

    fn of_moments(moments: Moments, smallest_spread: f64) -> Self {
        let Moments { count, mean, products } = moments;
        let n = mean.len();
        let mut covariance = Mat::from_fn(n, n, |i, j| products[i * n + j] / count);
        for i in 0..n {
            covariance[(i, i)] += smallest_spread * smallest_spread;
        }
        let factor = covariance.llt(Side::Lower);
        let factor = factor
            .expect("entries are at most 1 and the diagonal was raised by at least 1e-6, far above their rounding");
        let mut inverse_root = Mat::identity(n, n);
        triangular_solve::solve_lower_triangular_in_place(factor.L(), inverse_root.as_mut(), Par::Seq);
        Self { mean, inverse_root }
    }

    /// ln det of the inverse covariance.
    pub(crate) fn log_precision(&self) -> f64 {
        let diagonal = (0..self.mean.len()).map(|place| self.inverse_root[(place, place)]);
        2.0 * diagonal.map(f64::ln).sum::<f64>()
    }

    /// Appends the prior to equations `[A, b]` (row by row, `unknowns` + 1 columns) for
    /// x = (displacement − `at_mm`) / width.
    pub(crate) fn append_to(&self, equations: &mut Vec<f64>, unknowns: usize, at_mm: &[f64], ranges: &[Range]) {
        let n = at_mm.len();
        for row in 0..n {
            let value = |column| {
                if column < n {
                    self.inverse_root[(row, column)]
                } else {
                    0.0
                }
            };
            equations.extend((0..unknowns).map(value));
            let apart = |column: usize| self.mean[column] - at_mm[column] / ranges[column].width();
            equations.push(
                (0..=row)
                    .map(|column| self.inverse_root[(row, column)] * apart(column))
                    .sum(),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::Movement,
    };

    fn prior(largest_shift_mm: f64) -> GaussianPrior {
        let model = SensorModel::new("3x4_2x12".parse().unwrap());
        let scene = Scene {
            loading: "smooth:4".parse().unwrap(),
            movement: Movement::Xyz { largest_shift_mm },
            ..Scene::default()
        };
        let mut rng = Seed(0).rng(Stream::Expectation);
        GaussianPrior::of_rows(&model, &scene, &[1], 1e-3, &mut rng).remove(0)
    }

    /// The prior of shifts is proportional to them, down to lengths whose squares underflow.
    #[test]
    fn priors_scale_down_to_tiny_lengths() {
        let (long, short) = (prior(0.25), prior(0.25 * 1e-170));
        assert!((&long.inverse_root - &short.inverse_root).norm_max() < 1e-9 * long.inverse_root.norm_max());
        for (long, short) in long.mean.iter().zip(&short.mean) {
            assert!((long - short).abs() < 1e-12);
        }
    }
}
