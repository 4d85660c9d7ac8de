use std::collections::HashMap;

use faer::Mat;

use super::{
    super::SensorModel,
    CalibrationError, PressedRow,
    equations::{COUNT, Slopes},
    levenberg_marquardt::residuals,
};

/// Eigenvalues and eigenvectors of JᵀJ for some of the parameters.
pub(super) struct Decomposition {
    /// Squares of the singular values of J, largest first.
    pub(super) values: Vec<f64>,
    /// Parameter × pattern.
    vectors: Mat<f64>,
}

impl Decomposition {
    pub(super) fn of(gram: &[[f64; COUNT]; COUNT], free: &[usize]) -> Result<Self, CalibrationError> {
        let matrix = Mat::from_fn(free.len(), free.len(), |one, other| gram[free[one]][free[other]]);
        let svd = matrix.thin_svd().map_err(|_| CalibrationError::NotConverged)?;
        Ok(Self {
            values: svd.S().column_vector().iter().copied().collect(),
            vectors: svd.U().to_owned(),
        })
    }

    /// Largest eigenvalue; 0 without parameters.
    pub(super) fn largest(&self) -> f64 {
        self.values.first().copied().unwrap_or(0.0)
    }

    /// (JᵀJ + damping · I)⁻¹ `right`, without patterns that rounding hides.
    pub(super) fn solve(&self, right: &[f64], damping: f64) -> Vec<f64> {
        let mut solution = vec![0.0; right.len()];
        for (pattern, &value) in self.values.iter().enumerate() {
            if value > self.rounding() {
                let along: f64 = (0..right.len()).map(|k| self.vectors[(k, pattern)] * right[k]).sum();
                for (k, part) in solution.iter_mut().enumerate() {
                    *part += self.vectors[(k, pattern)] * along / (value + damping);
                }
            }
        }
        solution
    }

    /// Diagonal entry of (JᵀJ)⁻¹; infinite where rounding hides a pattern of which the parameter is part.
    pub(super) fn inverse_diagonal(&self, parameter: usize) -> f64 {
        let part = |(pattern, &value): (usize, &f64)| {
            let share = self.vectors[(parameter, pattern)].powi(2);
            match value > self.rounding() {
                true => share / value,
                false if share > 1e-12 => f64::INFINITY,
                false => 0.0,
            }
        };
        self.values.iter().enumerate().map(part).sum()
    }

    fn rounding(&self) -> f64 {
        self.largest() * f64::EPSILON * 16.0
    }
}

/// Variances of the fitted parameters `free`, allowing for errors of readings that belong together: the larger of that of
/// independent errors and those of errors clustered by crossing (a wire's own misfit, in every frame) and by frame (a
/// drift of all readings), by the sandwich formula `A⁻¹ (Σ_c g_c g_cᵀ) A⁻¹`, A = JᵀJ, g_c = Σ_{i ∈ c} J_i r_i, times
/// G/(G−1) for G clusters (Liang and Zeger 1986).
pub(super) fn variances(
    model: &SensorModel,
    free: &[usize],
    references: &Slopes,
    samples: &[PressedRow],
    (decomposition, noise_variance): (&Decomposition, f64),
) -> Vec<f64> {
    let mut by_crossing: HashMap<(usize, usize), Slopes> = HashMap::new();
    let mut by_frame: HashMap<usize, Slopes> = HashMap::new();
    residuals(model, references, samples, |sample, column, residual, slopes| {
        let crossing = by_crossing.entry((sample.row, column)).or_insert([0.0; COUNT]);
        let frame = by_frame.entry(sample.frame).or_insert([0.0; COUNT]);
        for (index, slope) in slopes.iter().enumerate() {
            crossing[index] += slope * residual;
            frame[index] += slope * residual;
        }
    });
    let mut variances: Vec<f64> = (0..free.len())
        .map(|parameter| noise_variance * decomposition.inverse_diagonal(parameter))
        .collect();
    // In a fixed order, so that the sums have the same bits each time.
    let clusterings = [sorted(by_crossing), sorted(by_frame)];
    for scores in clusterings.iter().filter(|scores| scores.len() >= 3 * free.len()) {
        let mut of_clusters = vec![0.0; free.len()];
        for score in scores {
            let right: Vec<f64> = free.iter().map(|&index| score[index]).collect();
            for (sum, part) in of_clusters.iter_mut().zip(decomposition.solve(&right, 0.0)) {
                *sum += part * part;
            }
        }
        let clusters = scores.len() as f64;
        for (variance, sum) in variances.iter_mut().zip(of_clusters) {
            *variance = variance.max(sum * clusters / (clusters - 1.0));
        }
    }
    variances
}

fn sorted<K: Ord>(scores: HashMap<K, Slopes>) -> Vec<Slopes> {
    let mut scores: Vec<(K, Slopes)> = scores.into_iter().collect();
    scores.sort_by(|(one, _), (other, _)| one.cmp(other));
    scores.into_iter().map(|(_, score)| score).collect()
}
