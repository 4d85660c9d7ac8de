use faer::Mat;
use ndarray::{Array2, ArrayView2, Axis};

use super::minima::minima;
use crate::network::ScalingError;

/// Ridge regressions of outputs on inputs for any penalty, from one singular value decomposition, with their
/// leave-one-out errors.
///
/// With A = U S Vᵀ the centred inputs and t = penalty / (s² + penalty) the fraction of a singular direction that the
/// penalty removes, the answers to the training samples are ȳ + U (1 − t) Uᵀ(y − ȳ). Without sample i, its answer
/// would be wrong by residual_i / (1 − leverage_i) (Golub, Heath and Wahba 1979). Residual and 1 − leverage are
/// computed as their values without penalty plus U t Uᵀ(y − ȳ) and Σ t u²: if the map goes through every sample and
/// both vanish, they keep full relative accuracy.
///
/// A sample may represent several copies. Its row of A and of y is then multiplied by the square root of their
/// number, and the error is that of leaving out all copies at once.
pub(super) struct Ridge {
    x_mean: Vec<f64>,
    y_mean: Vec<f64>,
    /// Singular values s, above rounding.
    singular: Vec<f64>,
    /// Right singular vectors: inputs × singular values.
    directions: Mat<f64>,
    /// Uᵀ(y − ȳ): singular values × outputs.
    projected: Mat<f64>,
    left_out: LeftOut,
}

/// Samples that are left out, and additional noise.
struct LeftOut {
    /// Left singular vectors U of the samples: samples × singular values.
    samples: Mat<f64>,
    /// Squares of the entries of U.
    squares: Mat<f64>,
    /// The same vectors of the noise: its sources × singular values.
    noise: Mat<f64>,
    /// Residuals without penalty: samples × outputs.
    residual: Mat<f64>,
    /// 1 − leverage of each sample without penalty.
    free: Vec<f64>,
    /// Sum of the squared errors of the mean of all other samples, for each output.
    of_mean: Vec<f64>,
}

/// Maximum number of samples that are left out in turn: evenly spaced ones of a larger set give as good an estimate.
const MAX_LEFT_OUT: usize = 4000;

impl Ridge {
    /// Decomposes the inputs `x` (samples × inputs) for the outputs `y` (samples × outputs); `weights` are the
    /// numbers of samples that each row represents.
    ///
    /// `unseen` (sources × inputs) are the changes of the inputs by one standard deviation of each noise source that
    /// `x` lacks. The coefficients then minimise the expected error with this noise.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn new(
        x: ArrayView2<'_, f64>,
        y: ArrayView2<'_, f64>,
        weights: &[f64],
        unseen: ArrayView2<'_, f64>,
    ) -> Result<Self, ScalingError> {
        let (samples, inputs) = x.dim();
        assert_eq!((y.nrows(), weights.len()), (samples, samples));
        if samples == 0 {
            return Err(ScalingError::Empty);
        }
        let total: f64 = weights.iter().sum();
        let column = ArrayView2::from_shape((samples, 1), weights).expect("as many as samples");
        // As the mean of deviations, so that a large offset does not hide small changes.
        let mean = |values: &ArrayView2<'_, f64>| {
            let first = values.row(0);
            ((values - &first) * column).sum_axis(Axis(0)) / total + first
        };
        let (x_mean, y_mean) = (mean(&x), mean(&y));
        let roots: Vec<f64> = weights.iter().map(|weight| weight.sqrt()).collect();
        // The squared error that noise adds, summed over all samples, is that of these additional rows.
        let root = total.sqrt();
        let a = Mat::from_fn(samples + unseen.nrows(), inputs, |row, i| {
            match row.checked_sub(samples) {
                None => roots[row] * (x[[row, i]] - x_mean[i]),
                Some(source) => root * unseen[[source, i]],
            }
        });
        let b = Mat::from_fn(samples, y.ncols(), |s, t| roots[s] * (y[[s, t]] - y_mean[t]));
        let svd = a.thin_svd().map_err(|_| ScalingError::NotConverged)?;
        drop(a);
        let mut singular: Vec<f64> = svd.S().column_vector().iter().copied().collect();
        let smallest = f64::EPSILON * inputs as f64 * singular.first().copied().unwrap_or(0.0);
        singular.retain(|&value| value > smallest);
        let kept = singular.len();
        let u = svd.U().subcols(0, kept);
        let (of_samples, of_noise) = u.split_at_row(samples);
        let projected = of_samples.transpose() * &b;
        let rest = &b - of_samples * &projected;
        let stride = samples.div_ceil(MAX_LEFT_OUT);
        let chosen: Vec<usize> = (0..samples).step_by(stride).collect();
        let is_all_spanned = unseen.nrows() == 0 && kept + 1 >= samples;
        let share = |sample: usize| 1.0 - weights[sample] / total;
        let free = |&sample: &usize| {
            let free = share(sample) - of_samples.row(sample).squared_norm_l2();
            // A sample that alone spans a direction; the remainder is rounding.
            let is_rounding = free < f64::EPSILON * samples as f64;
            if is_all_spanned || is_rounding { 0.0 } else { free }
        };
        let free: Vec<f64> = chosen.iter().map(free).collect();
        let rows = chosen.len();
        let residual = |row: usize, t: usize| if free[row] > 0.0 { rest[(chosen[row], t)] } else { 0.0 };
        let of_mean = |t: usize| {
            chosen
                .iter()
                .map(|&sample| (b[(sample, t)] / share(sample)).powi(2))
                .sum()
        };
        let part = (chosen.iter().map(|&sample| weights[sample]).sum::<f64>() / total).sqrt();
        let of_chosen = Mat::from_fn(rows, kept, |row, k| of_samples[(chosen[row], k)]);
        let left_out = LeftOut {
            squares: Mat::from_fn(rows, kept, |row, k| of_chosen[(row, k)] * of_chosen[(row, k)]),
            samples: of_chosen,
            noise: Mat::from_fn(unseen.nrows(), kept, |row, k| part * of_noise[(row, k)]),
            residual: Mat::from_fn(rows, y.ncols(), residual),
            of_mean: (0..y.ncols()).map(of_mean).collect(),
            free,
        };
        Ok(Self {
            x_mean: x_mean.to_vec(),
            y_mean: y_mean.to_vec(),
            directions: svd.V().subcols(0, kept).to_owned(),
            singular,
            projected,
            left_out,
        })
    }

    /// Returns the penalty with the minimum leave-one-out error for each output; infinite if none is better than the
    /// mean.
    pub fn best_penalties(&self) -> Vec<f64> {
        let Some(decades) = self.decades() else {
            return vec![f64::INFINITY; self.y_mean.len()];
        };
        let errors = |decades: &[f64]| {
            let penalties: Vec<f64> = decades.iter().map(|decade| 10.0_f64.powf(*decade)).collect();
            self.leave_one_out(&penalties)
        };
        let found = minima(decades, self.y_mean.len(), errors);
        let penalty = |((decade, error), of_mean): ((f64, f64), &f64)| {
            if error < *of_mean {
                10.0_f64.powf(decade)
            } else {
                f64::INFINITY
            }
        };
        found.into_iter().zip(&self.left_out.of_mean).map(penalty).collect()
    }

    /// Returns the penalty with the minimum leave-one-out error of all outputs together; infinite if none is better
    /// than the mean.
    pub fn common_penalty(&self) -> f64 {
        let Some(decades) = self.decades() else {
            return f64::INFINITY;
        };
        let error = |decades: &[f64]| {
            let penalties = vec![10.0_f64.powf(decades[0]); self.y_mean.len()];
            vec![self.leave_one_out(&penalties).iter().sum()]
        };
        let (decade, error) = minima(decades, 1, error)[0];
        if error < self.left_out.of_mean.iter().sum() {
            10.0_f64.powf(decade)
        } else {
            f64::INFINITY
        }
    }

    /// Range of the logarithms of penalties. Beyond it, a penalty has no effect in double precision, or removes
    /// nearly everything.
    fn decades(&self) -> Option<(f64, f64)> {
        let (largest, smallest) = (self.singular.first()?, self.singular.last()?);
        Some((2.0 * smallest.log10() - 16.0, 2.0 * largest.log10() + 4.0))
    }

    /// Sum of the squared leave-one-out errors for each output with its penalty, including the contribution of noise.
    fn leave_one_out(&self, penalties: &[f64]) -> Vec<f64> {
        let LeftOut {
            samples,
            squares,
            noise,
            residual,
            free,
            ..
        } = &self.left_out;
        let (kept, outputs) = self.projected.shape();
        let taken = |penalty: f64, k: usize| penalty / (self.singular[k] * self.singular[k] + penalty);
        let lost = Mat::from_fn(kept, outputs, |k, t| taken(penalties[t], k) * self.projected[(k, t)]);
        let residual = residual + samples * &lost;
        let answers = noise * (&self.projected - &lost);
        // Leverages depend on the penalty alone.
        let distinct = if penalties.iter().all(|penalty| *penalty == penalties[0]) {
            outputs.min(1)
        } else {
            outputs
        };
        let leverages = squares * Mat::from_fn(kept, distinct, |k, t| taken(penalties[t], k));
        let of_output = |t: usize| {
            let leverages = leverages.col(t.min(distinct - 1));
            let rows = free.iter().zip(leverages.iter()).enumerate();
            let errors = rows.map(|(row, (free, leverage))| (residual[(row, t)] / (free + leverage)).powi(2));
            errors.sum::<f64>() + answers.col(t).squared_norm_l2()
        };
        (0..outputs).map(of_output).collect()
    }

    /// Coefficients with a penalty for each output: inputs + 1 × outputs, the constant last. For an infinite penalty
    /// they are 0, and the constant is the mean.
    pub fn coefficients(&self, penalties: &[f64]) -> Array2<f64> {
        let (kept, outputs) = self.projected.shape();
        let shrunk = Mat::from_fn(kept, outputs, |k, t| {
            let s = self.singular[k];
            s / (s * s + penalties[t]) * self.projected[(k, t)]
        });
        let gains = &self.directions * shrunk;
        Array2::from_shape_fn((gains.nrows() + 1, outputs), |(i, t)| {
            if i < gains.nrows() {
                return gains[(i, t)];
            }
            let shifts = self.x_mean.iter().enumerate().map(|(i, mean)| mean * gains[(i, t)]);
            self.y_mean[t] - shifts.sum::<f64>()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array1;
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use crate::scene::standard_normal;

    fn normal(rows: usize, columns: usize, seed: u64) -> Array2<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Array2::from_shape_simple_fn((rows, columns), || standard_normal(&mut rng))
    }

    fn none(inputs: usize) -> Array2<f64> {
        Array2::zeros((0, inputs))
    }

    fn ones(x: &Array2<f64>) -> Vec<f64> {
        vec![1.0; x.nrows()]
    }

    fn fit(x: &Array2<f64>, y: &Array2<f64>) -> (Array2<f64>, Vec<f64>) {
        let ridge = Ridge::new(x.view(), y.view(), &ones(x), none(x.ncols()).view()).unwrap();
        let penalties = ridge.best_penalties();
        (ridge.coefficients(&penalties), penalties)
    }

    /// Coefficients without the constant.
    fn gains(map: &Array2<f64>) -> ArrayView2<'_, f64> {
        map.slice_axis(Axis(0), ndarray::Slice::from(..map.nrows() - 1))
    }

    #[test]
    fn an_affine_relation_is_found_and_noise_is_not_fitted() {
        let x = normal(60, 20, 1);
        let clean = Array2::from_shape_fn((60, 1), |(s, _)| 3.0 * x[[s, 0]] - x[[s, 5]] + 0.5);
        let (exact, _) = fit(&x, &clean);
        assert!((exact[[0, 0]] - 3.0).abs() < 1e-8 && (exact[[5, 0]] + 1.0).abs() < 1e-8);
        assert!((exact[[20, 0]] - 0.5).abs() < 1e-8);
        // Pure noise: nearly everything is left out.
        let (fitted, penalties) = fit(&x, &normal(60, 1, 2));
        assert!(penalties[0] > 1.0);
        assert!(fitted.iter().take(20).map(|c| c * c).sum::<f64>() < 0.2);
    }

    /// Compares with fits that leave out each sample in turn.
    #[test]
    fn leave_one_out_errors_match_refits() {
        for (samples, inputs) in [(25, 6), (9, 8), (9, 20)] {
            let mut x = normal(samples, inputs, 3);
            // Singular values over six decades.
            for (i, mut column) in x.columns_mut().into_iter().enumerate() {
                column *= 10.0_f64.powf(-6.0 * i as f64 / inputs as f64);
            }
            let y = normal(samples, 2, 4);
            let noise = normal(3, inputs, 5) * 0.03;
            for unseen in [none(inputs), noise] {
                let ridge = Ridge::new(x.view(), y.view(), &ones(&x), unseen.view()).unwrap();
                for penalty in [1e-9, 1e-4, 1.0] {
                    let mut expected = 0.0;
                    for left_out in 0..samples {
                        let others: Vec<usize> = (0..samples).filter(|&sample| sample != left_out).collect();
                        let (x_others, y_others) = (x.select(Axis(0), &others), y.select(Axis(0), &others));
                        // The noise has the same weight as for all samples.
                        let weight = (samples as f64 / others.len() as f64).sqrt();
                        let fit = Ridge::new(
                            x_others.view(),
                            y_others.view(),
                            &ones(&x_others),
                            (&unseen * weight).view(),
                        )
                        .unwrap();
                        let map = fit.coefficients(&[penalty; 2]);
                        let answer = x.row(left_out).dot(&gains(&map)) + map.row(inputs);
                        expected += (&answer - &y.row(left_out)).mapv(|error| error * error).sum();
                    }
                    let map = ridge.coefficients(&[penalty; 2]);
                    let added = unseen.dot(&gains(&map));
                    expected += samples as f64 * added.mapv(|change| change * change).sum();
                    let ratio = ridge.leave_one_out(&[penalty; 2]).iter().sum::<f64>() / expected;
                    assert!((ratio - 1.0).abs() < 1e-6, "{samples}×{inputs}, {penalty}: {ratio}");
                }
            }
        }
    }

    /// If the map goes through all samples, residuals and 1 − leverage are pure rounding unless computed separately.
    #[test]
    fn interpolating_fits_keep_distinct_errors() {
        let x = normal(12, 30, 6);
        let ridge = Ridge::new(x.view(), normal(12, 1, 7).view(), &ones(&x), none(30).view()).unwrap();
        let smooth = [1e-3, 1e-6, 1e-9, 1e-12].map(|penalty| ridge.leave_one_out(&[penalty])[0]);
        for pair in smooth.windows(2) {
            assert!((pair[1] / pair[0] - 1.0).abs() < 1e-3, "{smooth:?}");
        }
    }

    #[test]
    fn unseen_noise_gives_a_penalty_of_its_size() {
        // One input of variance 1 and noise of variance 1/4: the best gain is 1 / (1 + 1/4).
        let x = normal(20_000, 1, 8);
        let unseen = Array2::from_elem((1, 1), 0.5);
        let ridge = Ridge::new(x.view(), x.view(), &ones(&x), unseen.view()).unwrap();
        let gain = ridge.coefficients(&ridge.best_penalties())[[0, 0]];
        assert!((gain - 0.8).abs() < 0.01, "{gain}");
    }

    /// Compares with fits to all copies, leaving out all copies of each sample in turn.
    #[test]
    fn a_weight_equals_copies_left_out_together() {
        let (x, y) = (normal(9, 4, 9), normal(9, 2, 10));
        let weights = [1.0, 3.0, 2.0, 7.0, 1.0, 1.0, 5.0, 2.0, 4.0];
        let copies: Vec<usize> = (0..9).flat_map(|s| vec![s; weights[s] as usize]).collect();
        let fit_to = |samples: &[usize]| {
            let (x, y) = (x.select(Axis(0), samples), y.select(Axis(0), samples));
            Ridge::new(x.view(), y.view(), &ones(&x), none(4).view()).unwrap()
        };
        let ridge = Ridge::new(x.view(), y.view(), &weights, none(4).view()).unwrap();
        // A separate penalty for each output.
        for penalties in [[1e-6, 0.3], [10.0, 1e-2]] {
            let (ours, truth) = (ridge.coefficients(&penalties), fit_to(&copies).coefficients(&penalties));
            assert!(
                (&ours - &truth).iter().all(|error| error.abs() < 1e-12),
                "{ours} {truth}"
            );
            let mut expected = Array1::<f64>::zeros(2);
            for (left_out, weight) in weights.iter().enumerate() {
                let others: Vec<usize> = copies.iter().copied().filter(|&s| s != left_out).collect();
                let map = fit_to(&others).coefficients(&penalties);
                let answer = x.row(left_out).dot(&gains(&map)) + map.row(4);
                expected += &(*weight * (&answer - &y.row(left_out)).mapv(|error| error * error));
            }
            let errors = ridge.leave_one_out(&penalties);
            for (ours, truth) in errors.iter().zip(&expected) {
                assert!((ours / truth - 1.0).abs() < 1e-9, "{errors:?} {expected}");
            }
        }
    }

    #[test]
    fn each_output_has_its_own_penalty() {
        let x = normal(40, 12, 11);
        let mut y = normal(40, 3, 12);
        // Exact, noisy, and noise alone.
        for s in 0..40 {
            y[[s, 0]] = x[[s, 3]] - x[[s, 4]];
            y[[s, 1]] += x[[s, 7]];
        }
        let (together, penalties) = fit(&x, &y);
        for (t, together_penalty) in penalties.iter().enumerate() {
            let (alone, penalty) = fit(&x, &y.select(Axis(1), &[t]));
            assert!((together_penalty / penalty[0]).ln().abs() < 0.1 || *together_penalty == penalty[0]);
            assert!(
                (&together.column(t) - &alone.column(0))
                    .iter()
                    .all(|error| error.abs() < 1e-2)
            );
        }
        assert!(
            penalties[0] < 1e-6 && penalties[1] > 1e-3 && penalties[2] > 10.0,
            "{penalties:?}"
        );
    }

    #[test]
    fn no_or_one_sample_and_no_inputs_or_outputs() {
        assert!(Ridge::new(normal(0, 3, 0).view(), normal(0, 2, 0).view(), &[], none(3).view()).is_err());
        for (samples, inputs, outputs) in [(1, 3, 2), (2, 3, 2), (5, 0, 2), (5, 3, 0)] {
            let (map, _) = fit(&normal(samples, inputs, 1), &normal(samples, outputs, 2));
            assert_eq!(map.dim(), (inputs + 1, outputs));
            assert!(map.iter().all(|value| value.is_finite()));
        }
    }
}
