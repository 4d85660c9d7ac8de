use faer::Mat;
use ndarray::{Array2, ArrayView2, Axis};

use super::line_search::least;
use crate::network::ScalingError;

/// Ridge regressions of outputs on inputs with every penalty, from one singular value decomposition, and their
/// leave-one-out errors.
///
/// With A = U S Vᵀ the centred inputs and t = penalty / (s² + penalty) the part of a singular direction that the penalty
/// takes away, the answers to the training samples are ȳ + U (1 − t) Uᵀ(y − ȳ). Without sample i, its answer would be
/// wrong by residual_i / (1 − leverage_i) (Golub, Heath and Wahba 1979). Residual and 1 − leverage are here what they are
/// without penalty, plus U t Uᵀ(y − ȳ) and Σ t u²: where the map goes through every sample and both vanish, they do so
/// with all their digits.
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

/// Samples that are left out, and the noise that is added.
struct LeftOut {
    /// Left singular vectors U of the samples: samples × singular values.
    samples: Mat<f64>,
    /// The same of the noise: its sources × singular values.
    noise: Mat<f64>,
    /// Residuals without penalty: samples × outputs.
    residual: Mat<f64>,
    /// 1 − leverage of each sample without penalty.
    free: Vec<f64>,
    /// Sum of the squared errors of the mean of all other samples.
    of_mean: f64,
}

/// Samples that are left out in turn: of more, evenly spaced ones, which are as good an estimate.
const MOST_LEFT_OUT: usize = 4000;

impl Ridge {
    /// Decomposes the inputs `x` (samples × inputs) for the outputs `y` (samples × outputs).
    ///
    /// `unseen` (sources × inputs) are the changes of the inputs by one standard deviation of each source of noise that
    /// `x` lacks. The coefficients then minimise the error expected with this noise.
    pub fn new(
        x: ArrayView2<'_, f64>,
        y: ArrayView2<'_, f64>,
        unseen: ArrayView2<'_, f64>,
    ) -> Result<Self, ScalingError> {
        let (samples, inputs) = x.dim();
        let mean = |values: &ArrayView2<'_, f64>| values.mean_axis(Axis(0)).ok_or(ScalingError::Empty);
        let (x_mean, y_mean) = (mean(&x)?, mean(&y)?);
        // The sum over all samples of the squared error that noise adds is that of these additional rows.
        let root = (samples as f64).sqrt();
        let a = Mat::from_fn(samples + unseen.nrows(), inputs, |row, i| {
            match row.checked_sub(samples) {
                None => x[[row, i]] - x_mean[i],
                Some(source) => root * unseen[[source, i]],
            }
        });
        let b = Mat::from_fn(samples, y.ncols(), |s, t| y[[s, t]] - y_mean[t]);
        let svd = a.thin_svd().map_err(|_| ScalingError::NotConverged)?;
        let mut singular: Vec<f64> = svd.S().column_vector().iter().copied().collect();
        let smallest = f64::EPSILON * inputs as f64 * singular.first().copied().unwrap_or(0.0);
        singular.retain(|&value| value > smallest);
        let kept = singular.len();
        let u = svd.U().subcols(0, kept);
        let (of_samples, of_noise) = u.split_at_row(samples);
        let projected = of_samples.transpose() * &b;
        let rest = &b - of_samples * &projected;
        let stride = samples.div_ceil(MOST_LEFT_OUT);
        let chosen: Vec<usize> = (0..samples).step_by(stride).collect();
        let is_all_spanned = unseen.nrows() == 0 && kept + 1 >= samples;
        let share = 1.0 - 1.0 / samples as f64;
        let free = |&sample: &usize| {
            let free = share - of_samples.row(sample).squared_norm_l2();
            // A sample that alone spans a direction; the rest is rounding.
            let is_rounding = free < f64::EPSILON * samples as f64;
            if is_all_spanned || is_rounding { 0.0 } else { free }
        };
        let free: Vec<f64> = chosen.iter().map(free).collect();
        let rows = chosen.len();
        let residual = |row: usize, t: usize| if free[row] > 0.0 { rest[(chosen[row], t)] } else { 0.0 };
        let squares = chosen.iter().map(|&sample| b.row(sample).squared_norm_l2());
        let part = (rows as f64 / samples as f64).sqrt();
        let left_out = LeftOut {
            samples: Mat::from_fn(rows, kept, |row, k| of_samples[(chosen[row], k)]),
            noise: Mat::from_fn(unseen.nrows(), kept, |row, k| part * of_noise[(row, k)]),
            residual: Mat::from_fn(rows, y.ncols(), residual),
            of_mean: squares.sum::<f64>() / (share * share),
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

    /// Returns the penalty with the least leave-one-out error; infinite if none is better than the mean of the outputs.
    pub fn best_penalty(&self) -> f64 {
        let (Some(largest), Some(smallest)) = (self.singular.first(), self.singular.last()) else {
            return f64::INFINITY;
        };
        // Further out, a penalty takes away nothing in double precision, or nearly everything.
        let decades = (2.0 * smallest.log10() - 16.0, 2.0 * largest.log10() + 4.0);
        let (decade, error) = least(decades, |decade| self.leave_one_out(10.0_f64.powf(decade)));
        if error < self.left_out.of_mean {
            10.0_f64.powf(decade)
        } else {
            f64::INFINITY
        }
    }

    /// Sum of the squared errors of the samples, each left out in turn, with what noise adds.
    fn leave_one_out(&self, penalty: f64) -> f64 {
        let LeftOut {
            samples,
            noise,
            residual,
            free,
            ..
        } = &self.left_out;
        let taken: Vec<f64> = self.singular.iter().map(|s| penalty / (s * s + penalty)).collect();
        let (kept, outputs) = self.projected.shape();
        let residual = residual + samples * Mat::from_fn(kept, outputs, |k, t| taken[k] * self.projected[(k, t)]);
        let answers = noise * Mat::from_fn(kept, outputs, |k, t| (1.0 - taken[k]) * self.projected[(k, t)]);
        let errors = free.iter().enumerate().map(|(row, free)| {
            let leverages = samples.row(row).iter().zip(&taken);
            let free = free + leverages.map(|(u, taken)| u * u * taken).sum::<f64>();
            residual.row(row).squared_norm_l2() / (free * free)
        });
        errors.sum::<f64>() + answers.squared_norm_l2()
    }

    /// Coefficients with this penalty: inputs + 1 × outputs, the constant last. With an infinite one they are 0, and the
    /// constant the mean.
    pub fn coefficients(&self, penalty: f64) -> Array2<f64> {
        let (kept, outputs) = self.projected.shape();
        let shrunk = Mat::from_fn(kept, outputs, |k, t| {
            let s = self.singular[k];
            s / (s * s + penalty) * self.projected[(k, t)]
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
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use crate::scene::normal::standard_normal;

    fn normal(rows: usize, columns: usize, seed: u64) -> Array2<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Array2::from_shape_simple_fn((rows, columns), || standard_normal(&mut rng))
    }

    fn none(inputs: usize) -> Array2<f64> {
        Array2::zeros((0, inputs))
    }

    fn fit(x: &Array2<f64>, y: &Array2<f64>) -> (Array2<f64>, f64) {
        let ridge = Ridge::new(x.view(), y.view(), none(x.ncols()).view()).unwrap();
        let penalty = ridge.best_penalty();
        (ridge.coefficients(penalty), penalty)
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
        let (fitted, penalty) = fit(&x, &normal(60, 1, 2));
        assert!(penalty > 1.0);
        assert!(fitted.iter().take(20).map(|c| c * c).sum::<f64>() < 0.2);
    }

    /// The truth are fits without each sample in turn.
    #[test]
    fn leave_one_out_errors_are_those_of_fits_without_each_sample() {
        for (samples, inputs) in [(25, 6), (9, 8), (9, 20)] {
            let mut x = normal(samples, inputs, 3);
            // Singular values over six decades.
            for (i, mut column) in x.columns_mut().into_iter().enumerate() {
                column *= 10.0_f64.powf(-6.0 * i as f64 / inputs as f64);
            }
            let y = normal(samples, 2, 4);
            let noise = normal(3, inputs, 5) * 0.03;
            for unseen in [none(inputs), noise] {
                let ridge = Ridge::new(x.view(), y.view(), unseen.view()).unwrap();
                for penalty in [1e-9, 1e-4, 1.0] {
                    let mut expected = 0.0;
                    for left_out in 0..samples {
                        let others: Vec<usize> = (0..samples).filter(|&sample| sample != left_out).collect();
                        let (x_others, y_others) = (x.select(Axis(0), &others), y.select(Axis(0), &others));
                        // The noise weighs as it does for all samples.
                        let weight = (samples as f64 / others.len() as f64).sqrt();
                        let fit = Ridge::new(x_others.view(), y_others.view(), (&unseen * weight).view()).unwrap();
                        let map = fit.coefficients(penalty);
                        let answer = x.row(left_out).dot(&gains(&map)) + map.row(inputs);
                        expected += (&answer - &y.row(left_out)).mapv(|error| error * error).sum();
                    }
                    let map = ridge.coefficients(penalty);
                    let added = unseen.dot(&gains(&map));
                    expected += samples as f64 * added.mapv(|change| change * change).sum();
                    let ratio = ridge.leave_one_out(penalty) / expected;
                    assert!((ratio - 1.0).abs() < 1e-6, "{samples}×{inputs}, {penalty}: {ratio}");
                }
            }
        }
    }

    /// Where the map goes through all samples, residuals and 1 − leverage are nothing but rounding unless computed apart.
    #[test]
    fn fits_through_every_sample_are_still_told_apart() {
        let x = normal(12, 30, 6);
        let ridge = Ridge::new(x.view(), normal(12, 1, 7).view(), none(30).view()).unwrap();
        let smooth = [1e-3, 1e-6, 1e-9, 1e-12].map(|penalty| ridge.leave_one_out(penalty));
        for pair in smooth.windows(2) {
            assert!((pair[1] / pair[0] - 1.0).abs() < 1e-3, "{smooth:?}");
        }
    }

    #[test]
    fn unseen_noise_is_answered_with_a_penalty_of_its_size() {
        // One input of variance 1 and noise of variance 1/4: the best gain is 1 / (1 + 1/4).
        let x = normal(20_000, 1, 8);
        let unseen = Array2::from_elem((1, 1), 0.5);
        let ridge = Ridge::new(x.view(), x.view(), unseen.view()).unwrap();
        let gain = ridge.coefficients(ridge.best_penalty())[[0, 0]];
        assert!((gain - 0.8).abs() < 0.01, "{gain}");
    }

    #[test]
    fn no_or_one_sample_and_no_inputs_or_outputs() {
        assert!(Ridge::new(normal(0, 3, 0).view(), normal(0, 2, 0).view(), none(3).view()).is_err());
        for (samples, inputs, outputs) in [(1, 3, 2), (2, 3, 2), (5, 0, 2), (5, 3, 0)] {
            let (map, _) = fit(&normal(samples, inputs, 1), &normal(samples, outputs, 2));
            assert_eq!(map.dim(), (inputs + 1, outputs));
            assert!(map.iter().all(|value| value.is_finite()));
        }
    }
}
