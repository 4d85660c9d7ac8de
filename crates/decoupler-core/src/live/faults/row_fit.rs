use std::f64::consts::TAU;

use glam::DVec3;
use rand::Rng;

use crate::{
    decoupling::{GaussianPrior, Range, ranges},
    scene::Scene,
    sensor::{RowConductance, SensorError, SensorModel},
};

/// Most probable deformation of a row-wire, or of two touching row-wires, given their readings, and its evidence.
///
/// With the misfit y_k = ln m_k − ln R_k(u) of reading m_k, relative noise of standard deviation σ_k, and a Gaussian
/// prior with mean μ and precision P, it minimises
///
/// `χ²(u) = Σ_k y_k²/σ_k² + (u − μ)ᵀ P (u − μ)`
///
/// by the Gauss-Newton method. The evidence, the marginal probability of the readings, follows from
/// Laplace's approximation (MacKay, "Bayesian interpolation", Neural Computation 4, 1992):
///
/// `−2 ln p(m) = χ²(û) + ln det H − ln det P + Σ_k ln 2πσ_k²,   H = P + Σ_k ∇y_k ∇y_kᵀ/σ_k²`.
///
/// The common gain error of a snapshot is an additional unknown. Nothing allocates after [`Self::new`].
#[derive(Clone, Debug)]
pub(in crate::live) struct RowFit {
    pub(super) model: SensorModel,
    pub(super) axes: &'static [usize],
    conductance: RowConductance,
    ranges: Vec<Range>,
    /// Relative standard deviation of each reading: rows of the array × M4.
    deviations: Vec<f64>,
    /// Standard deviation of the gain error of a row; 0 for none.
    pub(super) common: f64,
    /// Reading above which the converter clips.
    pub(super) full_scale_ohm: f64,
    /// Unknowns of each row, then the common gain error.
    pub(super) unknowns: Vec<f64>,
    pub(super) displacements_mm: Vec<DVec3>,
    /// ln R of every column.
    pub(super) log_ohm: Vec<f64>,
    /// −∂ ln R/∂u: unknowns × M4.
    pub(super) slopes: Vec<f64>,
    /// y/σ; 0 for readings that are left out.
    misfits: Vec<f64>,
    /// 1/σ²; 0 for readings that are left out.
    weights: Vec<f64>,
    /// One row of slopes times weights.
    weighted: Vec<f64>,
    hessian: Vec<f64>,
    pub(super) cholesky: Cholesky,
    step: Vec<f64>,
    trial: Vec<f64>,
}

/// Readings of one row-wire, or the geometric means of the readings of two touching row-wires, with what is known of
/// them.
#[derive(Clone, Copy)]
pub(in crate::live) struct RowReadings<'a> {
    /// Row-wires with their priors: one, or two touching row-wires.
    pub(in crate::live) rows: &'a [(usize, &'a FitPrior)],
    /// Readings in ohm: M4.
    pub(in crate::live) readings_ohm: &'a [f64],
    /// Column-wires that are left out.
    pub(in crate::live) left_out: [Option<usize>; 2],
    /// Number of nodes of the row-wire before its break; M2 if it is intact.
    pub(in crate::live) nodes: usize,
}

/// Fit of one row-wire.
#[derive(Clone, Copy, Debug)]
pub(in crate::live) struct RowFitReport {
    /// −2 ln of the probability density of the logarithms of the readings.
    pub(super) score: f64,
    /// Smallest χ².
    pub(super) chi_squared: f64,
    /// Number of readings that were used: neither left out nor clipped.
    pub(super) readings: usize,
}

/// Minimum noise assumed: the accuracy of the model.
const SMALLEST_NOISE: f64 = 1e-6;
/// Decrease of χ² below which iteration stops.
const TOLERANCE: f64 = 1e-2;
const MAX_STEPS: usize = 12;
const MAX_HALVINGS: usize = 6;

impl RowFit {
    /// Prepares for joint fits of `rows` row-wires, 1 or 2.
    pub(in crate::live) fn new(model: &SensorModel, scene: &Scene, rows: usize) -> Result<Self, SensorError> {
        let scale = model.scale;
        let noise = scene.noise.in_test();
        let source = noise.source(model)?;
        let half_way = vec![DVec3::Z * (0.5 * scene.stroke_mm(&model.geometry)); scale.nodes_per_row()];
        let mut deviations = Vec::with_capacity(scale.rows() * scale.columns());
        for row in 0..scale.rows() {
            let of_row = model.row_resistances(row, &half_way)?;
            deviations.extend(
                of_row
                    .iter()
                    .map(|&ohm| source.relative_to(ohm).own.max(SMALLEST_NOISE)),
            );
        }
        let ranges = ranges(model, scene);
        let unknowns = rows * ranges.len() + usize::from(noise.drift > 0.0);
        Ok(Self {
            model: *model,
            axes: scene.movement.axes().indices(),
            conductance: RowConductance::new(model, scene.movement.axes()),
            ranges,
            deviations,
            // The rows of a snapshot are fitted one by one but share this error: it must not be penalised more than once
            // in total.
            common: noise.drift * (scale.rows() as f64).sqrt(),
            full_scale_ohm: noise.range_ohm(model)?.1 * (1.0 - 1e-9),
            unknowns: vec![0.0; unknowns],
            displacements_mm: vec![DVec3::ZERO; scale.nodes_per_row()],
            log_ohm: vec![0.0; scale.columns()],
            slopes: vec![0.0; unknowns * scale.columns()],
            misfits: vec![0.0; scale.columns()],
            weights: vec![0.0; scale.columns()],
            weighted: vec![0.0; scale.columns()],
            hessian: vec![0.0; unknowns * unknowns],
            cholesky: Cholesky::new(unknowns),
            step: vec![0.0; unknowns],
            trial: vec![0.0; unknowns],
        })
    }

    /// Relative standard deviation of a reading.
    pub(super) fn deviation(&self, row: usize, column: usize) -> f64 {
        self.deviations[row * self.model.scale.columns() + column]
    }

    /// Finds the most probable deformation.
    pub(in crate::live) fn solve(&mut self, view: RowReadings<'_>) -> RowFitReport {
        let n = self.ranges.len();
        for (unknowns, (_, prior)) in self.unknowns.chunks_exact_mut(n).zip(view.rows) {
            unknowns.copy_from_slice(&prior.mean_mm);
        }
        if self.common > 0.0
            && let Some(gain) = self.unknowns.last_mut()
        {
            *gain = 0.0;
        }
        let mut chi_squared = self.evaluate(view);
        for _ in 0..MAX_STEPS {
            self.find_step(view);
            let decrease: f64 = self.step.iter().map(|entry| entry * entry).sum();
            // ½ gᵀH⁻¹g is the decrease of χ²/2 predicted by the linearised equations.
            if decrease < TOLERANCE {
                break;
            }
            self.cholesky.solve_upper(&mut self.step);
            let Some(next) = self.take_step(view, chi_squared) else {
                self.evaluate(view);
                self.find_step(view);
                break;
            };
            chi_squared = next;
        }
        let read = self.weights.iter().filter(|weight| **weight > 0.0);
        let noise: f64 = read.map(|weight| (TAU / weight).ln()).sum();
        let of_priors: f64 = view.rows.iter().map(|(_, prior)| prior.log_determinant).sum();
        let of_gain = if self.common > 0.0 {
            -2.0 * self.common.ln()
        } else {
            0.0
        };
        RowFitReport {
            score: chi_squared + self.cholesky.log_determinant() - of_priors - of_gain + noise,
            chi_squared,
            readings: self.weights.iter().filter(|weight| **weight > 0.0).count(),
        }
    }

    /// Sets the solution to the mean of a prior, for rows without usable readings.
    pub(in crate::live) fn set_to(&mut self, prior: &FitPrior) {
        self.unknowns[..prior.mean_mm.len()].copy_from_slice(&prior.mean_mm);
    }

    /// Evaluates misfits and slopes at the current unknowns; returns χ².
    fn evaluate(&mut self, view: RowReadings<'_>) -> f64 {
        let (n, columns) = (self.ranges.len(), self.model.scale.columns());
        self.slopes.fill(0.0);
        self.log_ohm.fill(0.0);
        // First the sums s of all rows and their slopes, then the logarithms of the resistances g/s̄, where s̄ is the
        // mean.
        for (place, &(row, _)) in view.rows.iter().enumerate() {
            let unknowns = &self.unknowns[place * n..(place + 1) * n];
            for (displacement, values) in self
                .displacements_mm
                .iter_mut()
                .zip(unknowns.chunks_exact(self.axes.len()))
            {
                for (&axis, &value) in self.axes.iter().zip(values) {
                    displacement[axis] = value;
                }
            }
            let slopes = &mut self.slopes[place * n * columns..(place + 1) * n * columns];
            let before_break = &self.displacements_mm[..view.nodes];
            let electrodes = self.model.scale.nodes_per_column();
            self.conductance
                .evaluate_broken(&self.model, row, before_break, electrodes);
            for (total, sum) in self.log_ohm.iter_mut().zip(self.conductance.sums()) {
                *total += sum;
            }
            let slopes = slopes.chunks_exact_mut(columns).take(view.nodes * self.axes.len());
            for (unknown, slopes) in slopes.enumerate() {
                slopes.copy_from_slice(self.conductance.derivatives(unknown));
            }
        }
        let moving = view.rows.len() * n * columns;
        for slopes in self.slopes[..moving].chunks_exact_mut(columns) {
            slopes
                .iter_mut()
                .zip(&self.log_ohm)
                .for_each(|(slope, sum)| *slope /= sum);
        }
        // A gain error η adds to ln R.
        self.slopes[moving..].fill(-1.0);
        let gain = if self.common > 0.0 {
            self.unknowns[view.rows.len() * n]
        } else {
            0.0
        };
        let per_row = self.model.resistivity_ohm_per_mm * view.rows.len() as f64;
        self.log_ohm
            .iter_mut()
            .for_each(|sum| *sum = (per_row / *sum).ln() + gain);
        let log_full_scale = self.log_full_scale();
        let share = 1.0 / (view.rows.len() as f64).sqrt();
        let deviations = &self.deviations[view.rows[0].0 * columns..];
        let mut chi_squared = self.misfit_of_prior(view);
        for (k, (misfit, reading)) in self.misfits.iter_mut().zip(view.readings_ohm).enumerate() {
            let log_reading = reading.ln();
            let is_clipped = log_reading >= log_full_scale && self.log_ohm[k] >= log_full_scale;
            let is_read = !(view.left_out.contains(&Some(k)) || is_clipped);
            let inverse = if is_read { 1.0 / (share * deviations[k]) } else { 0.0 };
            *misfit = (log_reading - self.log_ohm[k]) * inverse;
            self.weights[k] = inverse * inverse;
            chi_squared += *misfit * *misfit;
        }
        chi_squared
    }

    fn misfit_of_prior(&self, view: RowReadings<'_>) -> f64 {
        let n = self.ranges.len();
        let mut total = 0.0;
        for (unknowns, (_, prior)) in self.unknowns.chunks_exact(n).zip(view.rows) {
            for (i, precision) in prior.precision.chunks_exact(n).enumerate() {
                let pairs = precision.iter().zip(unknowns.iter().zip(&prior.mean_mm));
                let product: f64 = pairs.map(|(p, (u, mean))| p * (u - mean)).sum();
                total += (unknowns[i] - prior.mean_mm[i]) * product;
            }
        }
        match self.unknowns.last() {
            Some(gain) if self.common > 0.0 => total + (gain / self.common).powi(2),
            _ => total,
        }
    }

    /// Linearises at the current unknowns: factors H, and sets the step to L⁻¹ times the gradient of −χ²/2.
    fn find_step(&mut self, view: RowReadings<'_>) {
        let (n, columns, order) = (self.ranges.len(), self.model.scale.columns(), self.unknowns.len());
        for i in 0..order {
            let slopes = &self.slopes[i * columns..(i + 1) * columns];
            for (weighted, (slope, weight)) in self.weighted.iter_mut().zip(slopes.iter().zip(&self.weights)) {
                *weighted = slope * weight;
            }
            for j in 0..=i {
                let others = &self.slopes[j * columns..(j + 1) * columns];
                self.hessian[i * order + j] = self.weighted.iter().zip(others).map(|(a, b)| a * b).sum();
            }
            // y = ln m − ln R has the slope of −ln R, as stored in `slopes`.
            let pairs = slopes.iter().zip(self.misfits.iter().zip(&self.weights));
            self.step[i] = -pairs
                .map(|(slope, (misfit, weight))| slope * misfit * weight.sqrt())
                .sum::<f64>();
        }
        for (place, (_, prior)) in view.rows.iter().enumerate() {
            for i in 0..n {
                let at = place * n + i;
                for j in 0..n {
                    let precision = prior.precision[i * n + j];
                    if j <= i {
                        self.hessian[at * order + place * n + j] += precision;
                    }
                    self.step[at] -= precision * (self.unknowns[place * n + j] - prior.mean_mm[j]);
                }
            }
        }
        if self.common > 0.0 {
            let last = order - 1;
            self.hessian[last * order + last] += self.common.powi(-2);
            self.step[last] -= self.unknowns[last] * self.common.powi(-2);
        }
        if self.cholesky.factor(&self.hessian) {
            self.cholesky.solve_lower(&mut self.step);
        } else {
            self.step.fill(0.0);
        }
    }

    /// Takes the step, halved until χ² is below `chi_squared`, and returns the new χ²; `None` leaves the unknowns
    /// unchanged. No node leaves its range by more than the width of the range, or comes close to a column-wire.
    fn take_step(&mut self, view: RowReadings<'_>, chi_squared: f64) -> Option<f64> {
        let (n, moving) = (self.ranges.len(), view.rows.len() * self.ranges.len());
        self.trial.copy_from_slice(&self.unknowns);
        let height_mm = self.model.geometry.height_mm;
        let deepest_mm = |high_mm: f64| 0.5 * (high_mm + height_mm);
        for halving in 0..MAX_HALVINGS {
            let share = 0.5_f64.powi(i32::try_from(halving).unwrap_or(0));
            for (i, unknown) in self.unknowns.iter_mut().enumerate() {
                *unknown = self.trial[i] + share * self.step[i];
                if i < moving {
                    let Range { lowest, highest } = self.ranges[i % n];
                    let width_mm = highest - lowest;
                    let is_depth = self.axes[i % self.axes.len()] == 2;
                    let highest_mm = highest + width_mm;
                    let highest_mm = if is_depth {
                        highest_mm.min(deepest_mm(highest))
                    } else {
                        highest_mm
                    };
                    *unknown = unknown.clamp(lowest - width_mm, highest_mm);
                }
            }
            let next = self.evaluate(view);
            if next < chi_squared {
                return Some(next);
            }
        }
        self.unknowns.copy_from_slice(&self.trial);
        None
    }

    /// Writes the coordinates in mm (3·M2) of the nodes of a row-wire, the `place`-th of the fit, clamped to the ranges
    /// of the scene.
    pub(in crate::live) fn coordinates(&self, row: usize, place: usize, coordinates_mm: &mut [f64]) {
        let n = self.ranges.len();
        let unknowns = self.unknowns[place * n..(place + 1) * n].chunks_exact(self.axes.len());
        let ranges = self.ranges.chunks_exact(self.axes.len());
        let nodes = coordinates_mm.chunks_exact_mut(3).zip(unknowns.zip(ranges)).enumerate();
        for (node, (coordinates_mm, (unknowns, ranges))) in nodes {
            let mut displacement = DVec3::ZERO;
            for (&axis, (unknown, range)) in self.axes.iter().zip(unknowns.iter().zip(ranges)) {
                displacement[axis] = range.clamp(*unknown);
            }
            coordinates_mm.copy_from_slice(&self.model.displaced_mm(row, node, displacement).to_array());
        }
    }
}

/// Cholesky factor L Lᵀ of a small symmetric positive definite matrix, with storage that is reused. Up to order 16,
/// typical of row-wires, it is faster than the factorisation of faer, which is optimised for large matrices.
#[derive(Clone, Debug)]
pub(super) struct Cholesky {
    order: usize,
    /// L, row by row; entries above the diagonal are not used.
    lower: Vec<f64>,
}

impl Cholesky {
    pub(super) fn new(order: usize) -> Self {
        Self {
            order,
            lower: vec![0.0; order * order],
        }
    }

    /// Factors `matrix` (order × order), reading only its lower triangle. Returns `false` if it is not positive definite.
    pub(super) fn factor(&mut self, matrix: &[f64]) -> bool {
        let n = self.order;
        for i in 0..n {
            for j in 0..=i {
                let (row_i, row_j) = (&self.lower[i * n..i * n + j], &self.lower[j * n..j * n + j]);
                let product: f64 = row_i.iter().zip(row_j).map(|(a, b)| a * b).sum();
                let rest = matrix[i * n + j] - product;
                self.lower[i * n + j] = if i == j {
                    if !(rest > 0.0 && rest.is_finite()) {
                        return false;
                    }
                    rest.sqrt()
                } else {
                    rest / self.lower[j * n + j]
                };
            }
        }
        true
    }

    /// Logarithm of the determinant of the matrix.
    pub(super) fn log_determinant(&self) -> f64 {
        let diagonal = (0..self.order).map(|i| self.lower[i * self.order + i].ln());
        2.0 * diagonal.sum::<f64>()
    }

    /// Replaces b by L⁻¹ b, whose squared norm is bᵀ A⁻¹ b.
    pub(super) fn solve_lower(&self, b: &mut [f64]) {
        let n = self.order;
        for i in 0..n {
            let product: f64 = self.lower[i * n..i * n + i].iter().zip(&*b).map(|(l, x)| l * x).sum();
            b[i] = (b[i] - product) / self.lower[i * n + i];
        }
    }

    /// Replaces b by L⁻ᵀ b.
    pub(super) fn solve_upper(&self, b: &mut [f64]) {
        let n = self.order;
        for i in (0..n).rev() {
            let product: f64 = (i + 1..n).map(|j| self.lower[j * n + i] * b[j]).sum();
            b[i] = (b[i] - product) / self.lower[i * n + i];
        }
    }
}

/// Predictions of readings left out of a fit.
impl RowFit {
    /// Logarithm of the reading above which the converter clips.
    pub(super) fn log_full_scale(&self) -> f64 {
        self.full_scale_ohm.ln()
    }

    /// Returns `true` if the reading is at the end of the converter's range and the resistance beyond it.
    pub(super) fn is_clipped(&self, log_reading: f64, log_ohm: f64) -> bool {
        log_reading >= self.log_full_scale() && log_ohm >= self.log_full_scale()
    }

    /// Variance of ln R with these slopes by the unknowns; `slopes` is overwritten.
    pub(super) fn variance(&self, slopes: &mut [f64]) -> f64 {
        self.cholesky.solve_lower(slopes);
        slopes.iter().map(|entry| entry * entry).sum()
    }

    /// Writes the slopes of −ln R of a column by all unknowns to `slopes`.
    pub(super) fn slopes_of(&self, column: usize, slopes: &mut [f64]) {
        let of_column = self.slopes.iter().skip(column).step_by(self.model.scale.columns());
        slopes.iter_mut().zip(of_column).for_each(|(to, slope)| *to = *slope);
    }

    /// Returns ln R of a column that is broken before node `electrodes`, and writes its slopes as [`Self::slopes_of`]
    /// does, after a fit of one row-wire.
    pub(super) fn broken_column(
        &mut self,
        (row, column, electrodes): (usize, usize, usize),
        slopes: &mut [f64],
    ) -> f64 {
        self.conductance
            .evaluate_broken(&self.model, row, &self.displacements_mm, electrodes);
        let sum = self.conductance.sums()[column];
        for (unknown, slope) in slopes.iter_mut().enumerate().take(self.ranges.len()) {
            *slope = self.conductance.derivatives(unknown)[column] / sum;
        }
        let gain = match slopes.last_mut().zip(self.unknowns.last()) {
            Some((slope, gain)) if self.common > 0.0 => {
                *slope = -1.0;
                *gain
            }
            _ => 0.0,
        };
        (self.model.resistivity_ohm_per_mm / sum).ln() + gain
    }
}

/// Gaussian prior of the unknowns of one row-wire (node by node, each node's axes together), prepared for fits and their
/// evidence.
#[derive(Clone, Debug)]
pub(in crate::live) struct FitPrior {
    pub(super) mean_mm: Vec<f64>,
    /// Inverse of the covariance in 1/mm²: unknowns × unknowns.
    pub(super) precision: Vec<f64>,
    /// Logarithm of the determinant of the precision.
    pub(super) log_determinant: f64,
}

/// Minimum prior standard deviation of a pattern, relative to the range.
const SMALLEST_SPREAD: f64 = 1e-2;

impl FitPrior {
    /// Weak prior of a row-wire, centred in every range of `scene`, with the width of the range as standard deviation: it
    /// only bounds unknowns that the readings do not determine.
    pub(super) fn weak(model: &SensorModel, scene: &Scene) -> Self {
        let ranges = ranges(model, scene);
        Self::of(&GaussianPrior::independent(&ranges, 1.0), &ranges)
    }

    /// Priors of `rows` in `scene`.
    pub(in crate::live) fn of_rows(
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        rng: &mut impl Rng,
    ) -> Vec<Self> {
        let ranges = ranges(model, scene);
        let priors = GaussianPrior::of_rows(model, scene, rows, SMALLEST_SPREAD, rng);
        priors.iter().map(|prior| Self::of(prior, &ranges)).collect()
    }

    fn of(prior: &GaussianPrior, ranges: &[Range]) -> Self {
        let widths = ranges.iter().map(|range| range.width());
        let mut precision = Vec::with_capacity(ranges.len() * ranges.len());
        for (i, row_width) in widths.clone().enumerate() {
            for (j, column_width) in widths.clone().enumerate() {
                let root = &prior.inverse_root;
                let sum: f64 = (i.max(j)..ranges.len()).map(|k| root[(k, i)] * root[(k, j)]).sum();
                precision.push(sum / (row_width * column_width));
            }
        }
        let diagonal = widths.clone().enumerate();
        Self {
            mean_mm: prior
                .mean
                .iter()
                .zip(widths)
                .map(|(mean, width)| mean * width)
                .collect(),
            precision,
            log_determinant: 2.0
                * diagonal
                    .map(|(i, width)| (prior.inverse_root[(i, i)] / width).ln())
                    .sum::<f64>(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factored_matrix_returns_its_solution_and_determinant() {
        let matrix = [4.0, 0.0, 0.0, 2.0, 5.0, 0.0, -1.0, 1.5, 3.0];
        let mut cholesky = Cholesky::new(3);
        assert!(cholesky.factor(&matrix));
        // A x for x = (1, −2, 3), where A is symmetric with this lower triangle.
        let mut b = [-3.0, -3.5, 5.0];
        cholesky.solve_lower(&mut b);
        cholesky.solve_upper(&mut b);
        for (found, expected) in b.iter().zip([1.0, -2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-14);
        }
        // 4·(15 − 2.25) − 2·(6 + 1.5) − 1·(3 + 5).
        assert!((cholesky.log_determinant() - 28.0_f64.ln()).abs() < 1e-14);
        assert!(!cholesky.factor(&[1.0, 0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 1.0]));
        assert!(!cholesky.factor(&[f64::NAN; 9]));
    }
}
