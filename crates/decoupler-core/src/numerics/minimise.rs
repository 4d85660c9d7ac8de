//! Least squares with few unknowns: by the Levenberg-Marquardt method, from sums over any number of equations, and on a simplex.

use faer::{Mat, linalg::solvers::Solve};
use ndarray::{Array2, ArrayView1};

/// Sum of squares Σ r², linearised at a point.
#[derive(Clone, Debug)]
pub(crate) struct Linearised {
    /// JᵀJ, where J = ∂r/∂x.
    pub(crate) gram: Mat<f64>,
    /// −Jᵀr.
    pub(crate) descent: Vec<f64>,
    /// Σ r².
    pub(crate) squares: f64,
}

/// Minimises Σ r² from `start` by damped steps (Marquardt 1963, doi:10.1137/0111030).
///
/// `linearise` returns `None` where Σ r² is not defined. The method has converged when the Gauss-Newton step would lower
/// Σ r² by at most `negligible(Σ r²)`, whatever the length of the step (the relative offset of Bates and Watts 1981):
/// patterns of the unknowns that r hardly depends on do not delay convergence.
///
/// Returns `None` if it does not converge: Σ r² is not finite at the start, no step lowers it, or too many steps are needed.
pub(crate) fn minimise(
    start: &[f64],
    linearise: impl Fn(&[f64]) -> Option<Linearised>,
    negligible: impl Fn(f64) -> f64,
) -> Option<Vec<f64>> {
    const MAX_STEPS: usize = 200;
    /// Damping relative to the largest eigenvalue of JᵀJ: of the first step, the smallest and the largest.
    const DAMPINGS: [f64; 3] = [1e-6, 1e-15, 1e6];
    let mut at = start.to_vec();
    let mut here = linearise(&at)?;
    let mut damping = DAMPINGS[0];
    for _ in 0..MAX_STEPS {
        let spectrum = Spectrum::of(&here.gram)?;
        let newton = spectrum.solve(&here.descent, 0.0);
        let decrease: f64 = newton.iter().zip(&here.descent).map(|(step, slope)| step * slope).sum();
        if decrease <= negligible(here.squares) {
            return Some(at);
        }
        loop {
            let step = spectrum.solve(&here.descent, damping * spectrum.largest());
            let candidate: Vec<f64> = at.iter().zip(&step).map(|(at, step)| at + step).collect();
            // False for NaN.
            if let Some(next) = linearise(&candidate).filter(|next| next.squares < here.squares) {
                (at, here) = (candidate, next);
                damping = (0.1 * damping).max(DAMPINGS[1]);
                break;
            }
            damping *= 10.0;
            if damping > DAMPINGS[2] {
                return None;
            }
        }
    }
    None
}

/// Eigenvalues and eigenvectors of JᵀJ.
pub(crate) struct Spectrum {
    /// Squares of the singular values of J, largest first.
    values: Vec<f64>,
    /// Unknown × pattern.
    vectors: Mat<f64>,
}

impl Spectrum {
    /// Decomposes JᵀJ; `None` if it is not finite.
    pub(crate) fn of(gram: &Mat<f64>) -> Option<Self> {
        let svd = gram.is_all_finite().then(|| gram.thin_svd().ok()).flatten()?;
        Some(Self {
            values: svd.S().column_vector().iter().copied().collect(),
            vectors: svd.U().to_owned(),
        })
    }

    /// Largest eigenvalue; 0 without unknowns.
    fn largest(&self) -> f64 {
        self.values.first().copied().unwrap_or(0.0)
    }

    /// (JᵀJ + damping · I)⁻¹ `right`, leaving out patterns below rounding.
    pub(crate) fn solve(&self, right: &[f64], damping: f64) -> Vec<f64> {
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

    /// Diagonal entry of (JᵀJ)⁻¹; infinite if the unknown is part of a pattern below rounding.
    pub(crate) fn inverse_diagonal(&self, unknown: usize) -> f64 {
        let part = |(pattern, &value): (usize, &f64)| {
            let share = self.vectors[(unknown, pattern)].powi(2);
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

/// Returns the weights w ≥ 0 with Σ w = 1 that minimise ‖truth − answers · w‖²: non-negative least squares on a simplex, whose
/// solution is no worse than the best of the columns of `answers` (samples × members).
///
/// The members are few, so every set of members with weights above 0 is tried: the solution is the best of those whose
/// equations G w = λ 1, Σ w = 1 have weights above 0, with G the products of the errors of the members.
pub(crate) fn convex_weights(answers: &Array2<f64>, truth: ArrayView1<'_, f64>) -> Vec<f64> {
    let members = answers.ncols();
    let mut errors = answers.clone();
    errors.columns_mut().into_iter().for_each(|mut column| column -= &truth);
    let products = errors.t().dot(&errors);
    let mut best = (f64::INFINITY, vec![0.0; members]);
    for set in 1..1_usize << members {
        let chosen = Vec::from_iter((0..members).filter(|member| set >> member & 1 == 1));
        let weights = match chosen.len() {
            1 => vec![1.0],
            count => {
                // Since the weights are a multiple of G⁻¹ 1, no multiplier is needed.
                let gram = Mat::from_fn(count, count, |i, j| products[[chosen[i], chosen[j]]]);
                let Ok(factor) = gram.llt(faer::Side::Lower) else {
                    continue;
                };
                let solved = factor.solve(Mat::<f64>::from_fn(count, 1, |_, _| 1.0));
                let sum: f64 = (0..count).map(|i| solved[(i, 0)]).sum();
                (0..count).map(|i| solved[(i, 0)] / sum).collect::<Vec<_>>()
            }
        };
        if weights.iter().all(|weight| *weight > 0.0) {
            let mut all = vec![0.0; members];
            chosen
                .iter()
                .zip(&weights)
                .for_each(|(&member, weight)| all[member] = *weight);
            let all_weights = ArrayView1::from(&all);
            let square = all_weights.dot(&products.dot(&all_weights));
            if square < best.0 {
                best = (square, all);
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng, rngs::ChaCha8Rng};

    use super::*;

    /// r of n equations in two unknowns and its derivatives, as sums.
    fn linearised(equations: &[(f64, [f64; 2])]) -> Option<Linearised> {
        let mut found = Linearised {
            gram: Mat::zeros(2, 2),
            descent: vec![0.0; 2],
            squares: 0.0,
        };
        for (r, slopes) in equations {
            found.squares += r * r;
            for i in 0..2 {
                found.descent[i] -= slopes[i] * r;
                (0..2).for_each(|j| found.gram[(i, j)] += slopes[i] * slopes[j]);
            }
        }
        Some(found)
    }

    /// Rosenbrock's valley, from the usual start: problem 1 of Moré, Garbow and Hillstrom 1981.
    #[test]
    fn a_curved_valley_is_followed_to_its_minimum() {
        let valley = |x: &[f64]| {
            linearised(&[
                (10.0 * (x[1] - x[0] * x[0]), [-20.0 * x[0], 10.0]),
                (1.0 - x[0], [-1.0, 0.0]),
            ])
        };
        let found = minimise(&[-1.2, 1.0], valley, |_| 1e-28).unwrap();
        assert!(
            (found[0] - 1.0).abs() < 1e-10 && (found[1] - 1.0).abs() < 1e-10,
            "{found:?}"
        );
    }

    /// A line through (0, 1), (1, 3), (2, 4), (3, 4): intercept 1.5 and slope 1, Σ r² = 1, (XᵀX)⁻¹ = [[0.7, −0.3], [−0.3, 0.2]].
    #[test]
    fn a_line_and_its_variances_match_linear_regression() {
        let points = [(0.0, 1.0), (1.0, 3.0), (2.0, 4.0), (3.0, 4.0)];
        let line = |p: &[f64]| linearised(&points.map(|(x, y)| (p[0] + p[1] * x - y, [1.0, x])));
        let found = minimise(&[100.0, -50.0], line, |squares| 1e-14 * squares).unwrap();
        assert!((found[0] - 1.5).abs() < 1e-6 && (found[1] - 1.0).abs() < 1e-6);
        let spectrum = Spectrum::of(&line(&found).unwrap().gram).unwrap();
        assert!(
            (spectrum.inverse_diagonal(0) - 0.7).abs() < 1e-12 && (spectrum.inverse_diagonal(1) - 0.2).abs() < 1e-12
        );
    }

    #[test]
    fn undetermined_unknowns_stay_and_undefined_starts_are_reported() {
        let only_the_sum = |x: &[f64]| linearised(&[(x[0] + x[1] - 4.0, [1.0, 1.0])]);
        let found = minimise(&[1.0, 2.0], only_the_sum, |_| 1e-20).unwrap();
        assert!(
            (found[0] - 1.5).abs() < 1e-9 && (found[1] - 2.5).abs() < 1e-9,
            "{found:?}"
        );
        let spectrum = Spectrum::of(&only_the_sum(&[0.0; 2]).unwrap().gram).unwrap();
        assert_eq!(spectrum.inverse_diagonal(1), f64::INFINITY);
        assert_eq!(minimise(&[0.0; 2], |_| None, |_| 0.0), None);
        let undefined_elsewhere = |x: &[f64]| (x[0] == 0.0).then(|| only_the_sum(x)).flatten();
        assert_eq!(minimise(&[0.0; 2], undefined_elsewhere, |_| 0.0), None);
    }

    /// Projected gradient descent on the simplex, a slow and different way.
    fn descended(answers: &Array2<f64>, truth: ArrayView1<'_, f64>) -> Vec<f64> {
        let members = answers.ncols();
        let gram = answers.t().dot(answers);
        let right = answers.t().dot(&truth);
        let step = 1.0 / gram.diag().sum();
        let mut weights = ndarray::Array1::from_elem(members, 1.0 / members as f64);
        for _ in 0..200_000 {
            let moved = &weights - &((gram.dot(&weights) - &right) * step);
            // Projection on the simplex (Duchi et al. 2008).
            let mut sorted = moved.to_vec();
            sorted.sort_by(|a, b| b.total_cmp(a));
            let (mut sum, mut shift) = (0.0, 0.0);
            for (place, value) in sorted.iter().enumerate() {
                sum += value;
                let candidate = (sum - 1.0) / (place + 1) as f64;
                if value - candidate > 0.0 {
                    shift = candidate;
                }
            }
            weights = moved.mapv(|weight| (weight - shift).max(0.0));
        }
        weights.to_vec()
    }

    #[test]
    fn weights_match_projected_gradient_descent() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for members in [2, 3, 5] {
            let truth = ndarray::Array1::from_shape_simple_fn(60, || rng.random_range(-1.0..1.0));
            let quality = Vec::from_iter((0..members).map(|_| rng.random_range(0.1..1.5)));
            let answers = Array2::from_shape_fn((60, members), |(sample, member)| {
                truth[sample] + quality[member] * rng.random_range(-1.0..1.0)
            });
            let ours = convex_weights(&answers, truth.view());
            for (ours, other) in ours.iter().zip(descended(&answers, truth.view())) {
                assert!((ours - other).abs() < 1e-5, "{members}: {ours} {other}");
            }
            assert!((ours.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_perfect_member_and_two_equal_ones_are_answered() {
        let truth = ndarray::array![1.0, 2.0, 4.0];
        let answers = ndarray::array![[1.0, 0.0], [2.0, 1.0], [4.0, 1.0]];
        assert_eq!(convex_weights(&answers, truth.view()), [1.0, 0.0]);
        let same = ndarray::array![[1.5, 1.5], [2.0, 2.0], [4.0, 4.0]];
        assert_eq!(convex_weights(&same, truth.view()).iter().sum::<f64>(), 1.0);
    }
}
