use faer::{Mat, linalg::solvers::Solve};
use ndarray::{Array2, ArrayView1};

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
