use faer::Mat;
use ndarray::Array2;

use crate::{dataset::Folds, network::NetworkError};

/// Writes the features and the outputs of a sample.
type WriteSample<'a> = &'a dyn Fn(usize, &mut [f64], &mut [f64]);

/// Ridge regression of outputs on features, with the penalty of each output chosen by cross-validation.
///
/// Minimises `‖y − ȳ − (X − x̄) B‖² + α ‖B‖²` (Hoerl and Kennard 1970, doi:10.1080/00401706.1970.10488634), with α the
/// number of samples times one of [`levels`]. Features should have comparable sizes; [`Standard`](super::standardised::Standard) makes them so.
///
/// Each fold is reduced to R of a QR decomposition of [1, X, Y], block by block of its samples, so that memory does not
/// grow with their number (Golub and Van Loan, Matrix Computations, section 6.5.2). The R of several folds below each
/// other are the R of their union, whose singular value decomposition gives the maps of all penalties; and the squared
/// errors of a map on a fold are those on its R. Products XᵀX would lose components below 1e-8 of the largest, which
/// determine much of a deformation if there is no noise.
pub(crate) struct Regression<'a> {
    /// Number of samples.
    pub samples: usize,
    /// Number of features.
    pub features: usize,
    /// Number of outputs.
    pub outputs: usize,
    /// Writes the features and the outputs of a sample.
    pub write: WriteSample<'a>,
    /// Changes of the features by one standard deviation of each source of noise that the samples lack (sources ×
    /// features). The map then minimises the expected error with this noise.
    pub noise: Array2<f64>,
}

/// A cross-validated ridge regression.
#[derive(Debug)]
pub(crate) struct Ridge {
    /// Map fitted to all samples: features + 1 × outputs, the constant last.
    pub map: Array2<f64>,
    /// Sums of squared held-out errors: fold × output.
    pub squares: Vec<Vec<f64>>,
    /// Maps fitted without each fold, with the same penalties.
    pub held_out: Vec<Array2<f64>>,
}

/// Minimum number of samples in a block of a QR decomposition.
const BLOCK: usize = 512;

impl Regression<'_> {
    /// Fits the map. Without folds, or if no map has a smaller held-out error, an output is answered with its mean.
    ///
    /// # Errors
    /// If there are no samples, or the equations have no finite solution.
    pub fn ridge(&self, folds: Option<&Folds>) -> Result<Ridge, NetworkError> {
        let all: Vec<usize> = (0..self.samples).collect();
        let parts: Vec<&[usize]> = match folds {
            Some(folds) => (0..folds.count()).map(|fold| folds.test(fold)).collect(),
            None => vec![&all],
        };
        let factors: Vec<Mat<f64>> = parts.iter().map(|samples| self.factor(samples)).collect();
        let mut held_out = Vec::new();
        for (fold, factor) in factors.iter().enumerate().take(folds.map_or(0, Folds::count)) {
            let others = factors.iter().enumerate().filter(|(other, _)| *other != fold);
            let training = self.samples - parts[fold].len();
            let fit = self.spectrum(others.map(|(_, factor)| factor), training)?;
            let (basis, targets) = fit.seen_from(factor, &self.noise, parts[fold].len());
            held_out.push((fit, basis, targets, training as f64));
        }
        let choice = Choice::new(levels(), self.outputs, usize::MAX, |level| {
            let squares = |(fit, basis, targets, training): &(Spectrum, Mat<f64>, Mat<f64>, f64)| {
                let errors = basis * fit.gains(&vec![level * training; self.outputs]) - targets;
                errors.col_iter().map(|column| column.squared_norm_l2()).collect()
            };
            held_out.iter().map(squares).collect()
        });
        let fit = self.spectrum(factors.iter(), self.samples)?;
        let penalties = |samples: f64| Vec::from_iter(choice.levels.iter().map(|level| level * samples));
        let without = |(fit, _, _, training): &(Spectrum, Mat<f64>, Mat<f64>, f64)| fit.map(&penalties(*training));
        Ok(Ridge {
            map: fit.map(&penalties(self.samples as f64)),
            held_out: held_out.iter().map(without).collect(),
            squares: choice.squares,
        })
    }

    /// Returns the least-squares map of minimum norm: features + 1 × outputs, the constant last.
    ///
    /// # Errors
    /// If there are no samples, or the equations have no finite solution.
    pub fn least_squares(&self) -> Result<Array2<f64>, NetworkError> {
        let all: Vec<usize> = (0..self.samples).collect();
        let fit = self.spectrum([&self.factor(&all)].into_iter(), self.samples)?;
        Ok(fit.map(&vec![0.0; self.outputs]))
    }

    /// Approximate number of multiplications of [`Self::ridge`].
    pub fn multiplications(samples: usize, features: usize, folds: usize) -> f64 {
        let [samples, features, folds] = [samples, features + 1, folds].map(|size| size as f64);
        let order = features.min(samples);
        // QR decompositions of the samples and of the folds below each other, and singular value decompositions.
        samples * features * order + folds * (folds + 10.0) * features * order * order
    }

    /// R of [1, X, Y] of some samples; these rows themselves if they are fewer than the columns.
    fn factor(&self, samples: &[usize]) -> Mat<f64> {
        let columns = 1 + self.features + self.outputs;
        let (mut x, mut y) = (vec![0.0; self.features], vec![0.0; self.outputs]);
        let mut factor = Mat::<f64>::zeros(0, columns);
        for block in samples.chunks(BLOCK.max(4 * columns)) {
            let before = factor.nrows();
            let mut joined = Mat::zeros(before + block.len(), columns);
            joined.subrows_mut(0, before).copy_from(&factor);
            for (row, &sample) in block.iter().enumerate() {
                (self.write)(sample, &mut x, &mut y);
                joined[(before + row, 0)] = 1.0;
                for (column, &value) in x.iter().chain(&y).enumerate() {
                    joined[(before + row, column + 1)] = value;
                }
            }
            factor = if joined.nrows() > columns {
                joined.qr().thin_R().to_owned()
            } else {
                joined
            };
        }
        factor
    }

    /// Decomposes the union of samples with these factors.
    fn spectrum<'f>(
        &self,
        factors: impl Iterator<Item = &'f Mat<f64>>,
        samples: usize,
    ) -> Result<Spectrum, NetworkError> {
        if samples == 0 {
            return Err(NetworkError::Empty);
        }
        let (n, m) = (self.features, self.outputs);
        // The squared error that noise adds, summed over the samples, is that of these additional rows.
        let root = (samples as f64).sqrt();
        let noise = Mat::from_fn(self.noise.nrows(), 1 + n + m, |source, column| {
            match column.checked_sub(1) {
                Some(feature) if feature < n => root * self.noise[[source, feature]],
                _ => 0.0,
            }
        });
        let factors: Vec<&Mat<f64>> = factors.collect();
        let factors = || factors.iter().copied().chain([&noise]);
        let mut joined = Mat::zeros(factors().map(Mat::nrows).sum(), 1 + n + m);
        let mut first = 0;
        for factor in factors() {
            joined.subrows_mut(first, factor.nrows()).copy_from(factor);
            first += factor.nrows();
        }
        if !joined.is_all_finite() {
            return Err(NetworkError::NotConverged);
        }
        let r = joined.qr().thin_R().to_owned();
        let means: Vec<f64> = (1..1 + n + m).map(|column| r[(0, column)] / r[(0, 0)]).collect();
        let rows = (r.nrows() - 1).min(n);
        let svd = r.submatrix(1, 1, rows, n).thin_svd();
        let svd = svd.map_err(|_| NetworkError::NotConverged)?;
        let mut singular: Vec<f64> = svd.S().column_vector().iter().copied().collect();
        let smallest = f64::EPSILON * (n + 1) as f64 * singular.first().copied().unwrap_or(0.0);
        singular.retain(|&value| value > smallest);
        let kept = singular.len();
        let projected = svd.U().subcols(0, kept).transpose() * r.submatrix(1, 1 + n, rows, m);
        Ok(Spectrum {
            directions: svd.V().subcols(0, kept).to_owned(),
            projected: Mat::from_fn(kept, m, |k, t| singular[k] * projected[(k, t)]),
            eigenvalues: singular.iter().map(|value| value * value).collect(),
            means,
        })
    }
}

/// Singular directions of centred features.
struct Spectrum {
    /// Means of the features and of the outputs.
    means: Vec<f64>,
    /// Features × directions.
    directions: Mat<f64>,
    /// Squares of the singular values.
    eigenvalues: Vec<f64>,
    /// Directions × outputs.
    projected: Mat<f64>,
}

impl Spectrum {
    /// Features in the singular directions, and outputs, of held-out samples with this factor, both relative to the
    /// means; and the same for the noise.
    fn seen_from(&self, factor: &Mat<f64>, noise: &Array2<f64>, samples: usize) -> (Mat<f64>, Mat<f64>) {
        let (n, root) = (self.directions.nrows(), (samples as f64).sqrt());
        let (rows, outputs) = (factor.nrows(), self.means.len() - n);
        let centred = |row: usize, column: usize| factor[(row, 1 + column)] - factor[(row, 0)] * self.means[column];
        let features = Mat::from_fn(rows + noise.nrows(), n, |row, i| match row.checked_sub(rows) {
            None => centred(row, i),
            Some(source) => root * noise[[source, i]],
        });
        let targets = Mat::from_fn(rows + noise.nrows(), outputs, |row, t| {
            if row < rows { centred(row, n + t) } else { 0.0 }
        });
        (features * &self.directions, targets)
    }

    /// Map with a penalty for each output: features + 1 × outputs, the constant last.
    fn map(&self, penalties: &[f64]) -> Array2<f64> {
        let gains = &self.directions * self.gains(penalties);
        let n = gains.nrows();
        Array2::from_shape_fn((n + 1, penalties.len()), |(i, t)| {
            if i < n {
                return gains[(i, t)];
            }
            let shift: f64 = (0..n).map(|i| self.means[i] * gains[(i, t)]).sum();
            self.means[n + t] - shift
        })
    }

    /// Gains (directions × outputs) with a penalty for each output, 0 for an infinite one: the projected outputs divided by
    /// eigenvalue + penalty.
    fn gains(&self, penalties: &[f64]) -> Mat<f64> {
        Mat::from_fn(self.eigenvalues.len(), penalties.len(), |k, t| {
            self.projected[(k, t)] / (self.eigenvalues[k] + penalties[t])
        })
    }
}

/// Penalties relative to the number of samples, in descending order. The first leaves only the mean, and the last is
/// without effect in double precision.
fn levels() -> impl Iterator<Item = f64> {
    let powers = (0..=48).map(|place| 10.0_f64.powf(4.0 - 0.5 * f64::from(place)));
    std::iter::once(f64::INFINITY).chain(powers)
}

/// Penalties chosen by the held-out error.
pub(super) struct Choice {
    /// Penalty of each output.
    pub levels: Vec<f64>,
    /// Sums of squared errors with these penalties: fold × output.
    pub squares: Vec<Vec<f64>>,
}

impl Choice {
    /// Number of penalties below the best of all outputs that are tried where each is expensive.
    pub const PATIENCE: usize = 2;

    /// Chooses the penalty of the smallest held-out error for each output, among `levels` in descending order. `squares`
    /// returns the sums of squared errors with one of them (fold × output). Without folds it is the first.
    pub fn new(
        levels: impl Iterator<Item = f64>,
        outputs: usize,
        patience: usize,
        mut squares: impl FnMut(f64) -> Vec<Vec<f64>>,
    ) -> Self {
        let mut tried: Vec<(f64, Vec<Vec<f64>>)> = Vec::new();
        // Place of the best level of each output by now.
        let mut best = vec![0; outputs];
        for (place, level) in levels.enumerate() {
            tried.push((level, squares(level)));
            for (output, best) in best.iter_mut().enumerate() {
                let total = |place: usize| tried[place].1.iter().map(|fold| fold[output]).sum::<f64>();
                if total(place) < total(*best) {
                    *best = place;
                }
            }
            // Large penalties may be worse than the mean where smaller ones are better.
            if place > patience.saturating_mul(2) && best.iter().all(|best| place - best >= patience) {
                break;
            }
        }
        let of_fold = |fold: usize| Vec::from_iter((0..outputs).map(|output| tried[best[output]].1[fold][output]));
        Self {
            levels: best.iter().map(|&best| tried[best].0).collect(),
            squares: (0..tried[0].1.len()).map(of_fold).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use faer::{Side, linalg::solvers::Solve};
    use ndarray::{Axis, concatenate};
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::standard_normal;

    fn normal(rows: usize, columns: usize, seed: u64) -> Array2<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Array2::from_shape_simple_fn((rows, columns), || standard_normal(&mut rng))
    }

    /// Calls `of` with the regression of `y` on `x`.
    fn with<T>(x: &Array2<f64>, y: &Array2<f64>, noise: &Array2<f64>, of: impl FnOnce(&Regression<'_>) -> T) -> T {
        of(&Regression {
            samples: x.nrows(),
            features: x.ncols(),
            outputs: y.ncols(),
            write: &|sample, features, outputs| {
                features
                    .iter_mut()
                    .zip(x.row(sample))
                    .for_each(|(feature, value)| *feature = *value);
                outputs
                    .iter_mut()
                    .zip(y.row(sample))
                    .for_each(|(output, value)| *output = *value);
            },
            noise: noise.clone(),
        })
    }

    fn none(features: usize) -> Array2<f64> {
        Array2::zeros((0, features))
    }

    /// Map with these penalties.
    fn map(x: &Array2<f64>, y: &Array2<f64>, penalties: &[f64]) -> Array2<f64> {
        let all: Vec<usize> = (0..x.nrows()).collect();
        with(x, y, &none(x.ncols()), |regression| {
            let factor = regression.factor(&all);
            regression
                .spectrum([&factor].into_iter(), x.nrows())
                .unwrap()
                .map(penalties)
        })
    }

    fn ridge_of(x: &Array2<f64>, y: &Array2<f64>) -> Ridge {
        let folds = Folds::consecutive(x.nrows(), 5);
        with(x, y, &none(x.ncols()), |regression| {
            regression.ridge(Some(&folds)).unwrap()
        })
    }

    /// Map by dense normal equations, with noise of the features.
    fn dense(x: &Array2<f64>, y: &Array2<f64>, noise: &Array2<f64>, penalty: f64) -> Array2<f64> {
        let (n, samples) = (x.ncols(), x.nrows() as f64);
        let (x_mean, y_mean) = (x.mean_axis(Axis(0)).unwrap(), y.mean_axis(Axis(0)).unwrap());
        let (a, b) = (x - &x_mean, y - &y_mean);
        let gram = a.t().dot(&a) + samples * noise.t().dot(noise);
        let right = a.t().dot(&b);
        let gram = Mat::from_fn(n, n, |i, j| gram[[i, j]] + if i == j { penalty } else { 0.0 });
        let gains = gram
            .llt(Side::Lower)
            .unwrap()
            .solve(Mat::from_fn(n, y.ncols(), |i, t| right[[i, t]]));
        let gains = Array2::from_shape_fn((n, y.ncols()), |(i, t)| gains[(i, t)]);
        let constant = (&y_mean - &x_mean.dot(&gains)).insert_axis(Axis(0));
        concatenate![Axis(0), gains, constant]
    }

    fn answers(map: &Array2<f64>, x: &Array2<f64>) -> Array2<f64> {
        concatenate![Axis(1), x.view(), Array2::ones((x.nrows(), 1))].dot(map)
    }

    /// `Ridge(alpha).fit(X, Y)` of scikit-learn 1.9.1.
    #[test]
    fn maps_agree_with_scikit_learn() {
        let x = Array2::from_shape_fn((12, 4), |(s, i)| {
            (((s + 1) * (i + 2)) as f64 * 0.37).sin() + 0.1 * i as f64
        });
        let y = Array2::from_shape_fn((12, 2), |(s, t)| {
            if t == 0 {
                (0.5 * s as f64).cos()
            } else {
                s as f64 / 10.0
            }
        });
        let expected = [
            [
                [
                    0.7725829902392267,
                    0.287_527_574_586_232,
                    0.0524090749323276,
                    0.0748474797196868,
                    -0.2930655791031472,
                ],
                [
                    -0.0218899707884899,
                    -0.1287208317818264,
                    -0.1494507891867129,
                    -0.0379494409531939,
                    0.6151677022094031,
                ],
            ],
            [
                [
                    0.8476439326105294,
                    0.3294899345390301,
                    0.0676554929504225,
                    0.0809650436755034,
                    -0.3208247180978437,
                ],
                [
                    -0.0268328423043098,
                    -0.1442218510316254,
                    -0.1658656686125996,
                    -0.0435504509120380,
                    0.6235925836239433,
                ],
            ],
        ];
        for (penalty, expected) in [0.5, 1e-3].into_iter().zip(expected) {
            let ours = map(&x, &y, &[penalty; 2]);
            for (t, expected) in expected.iter().enumerate() {
                for (i, expected) in expected.iter().enumerate() {
                    assert!((ours[[i, t]] - expected).abs() < 1e-12, "{penalty}: {ours}");
                }
            }
        }
    }

    /// Many blocks of samples, fewer samples than features, and scattered folds.
    #[test]
    fn held_out_errors_and_maps_match_refits_by_normal_equations() {
        for (samples, features) in [(3000, 6), (25, 6), (9, 20)] {
            let mut x = normal(samples, features, 3) * 0.3 + 7.0;
            x.column_mut(2).fill(0.0);
            let noisy = normal(samples, 2, 4);
            let y = Array2::from_shape_fn((samples, 2), |(s, t)| x[[s, t]] + 0.5 * noisy[[s, t]] + 100.0);
            for noise in [none(features), normal(3, features, 5) * 0.2] {
                let folds = Folds::consecutive(samples, 3);
                let ridge = with(&x, &y, &noise, |regression| regression.ridge(Some(&folds)).unwrap());
                let mut best = [f64::INFINITY; 2];
                for level in levels().skip(1).filter(|level| (1e-9..10.0).contains(level)) {
                    let mut squares = vec![Vec::new(); 3];
                    for (fold, squares) in squares.iter_mut().enumerate() {
                        let (others, test) = (folds.without(&[fold]), folds.test(fold));
                        let part = |of: &Array2<f64>, rows: &[usize]| of.select(Axis(0), rows);
                        let penalty = level * others.len() as f64;
                        let map = dense(&part(&x, &others), &part(&y, &others), &noise, penalty);
                        let off = answers(&map, &part(&x, test)) - part(&y, test);
                        let gains = map.slice_axis(Axis(0), ndarray::Slice::from(..features));
                        let added = noise.dot(&gains).mapv(|change| change * change).sum_axis(Axis(0));
                        let added = added * test.len() as f64;
                        *squares = (off.mapv(|error| error * error).sum_axis(Axis(0)) + added).to_vec();
                    }
                    for (t, best) in best.iter_mut().enumerate() {
                        let total: f64 = squares.iter().map(|squares| squares[t]).sum();
                        *best = best.min(total);
                        // The chosen penalty is one of these.
                        let ours: f64 = ridge.squares.iter().map(|fold| fold[t]).sum();
                        if (ours / total - 1.0).abs() < 1e-9 {
                            let penalty = level * samples as f64;
                            let map = dense(&x, &y, &noise, penalty);
                            let off = (&ridge.map.column(t) - &map.column(t)).mapv(f64::abs).sum();
                            // Normal equations lose digits with small penalties.
                            assert!(
                                off < f64::max(1e-6, 1e-11 / level),
                                "{samples}×{features}, {level}: {off}"
                            );
                        }
                    }
                }
                for (t, best) in best.iter().enumerate() {
                    let ours: f64 = ridge.squares.iter().map(|fold| fold[t]).sum();
                    assert!(ours < 1.000_001 * best, "{samples}×{features}: {ours} {best}");
                }
            }
        }
    }

    #[test]
    fn an_affine_relation_is_found_exactly_and_noise_is_answered_with_the_mean() {
        let x = normal(60, 20, 1);
        let mut y = normal(60, 3, 2);
        for s in 0..60 {
            y[[s, 0]] = 3.0 * x[[s, 0]] - x[[s, 5]] + 0.5;
            y[[s, 1]] += x[[s, 7]];
        }
        let map = ridge_of(&x, &y).map;
        assert!(
            (map[[0, 0]] - 3.0).abs() < 1e-8 && (map[[5, 0]] + 1.0).abs() < 1e-8 && (map[[20, 0]] - 0.5).abs() < 1e-8
        );
        assert!((0.3..1.1).contains(&map[[7, 1]]), "{}", map[[7, 1]]);
        let of_noise: f64 = map.column(2).iter().take(20).map(|gain| gain * gain).sum();
        assert!(of_noise < 0.05, "{of_noise}");
        // Each output as if it were alone.
        for t in 0..3 {
            let alone = ridge_of(&x, &y.select(Axis(1), &[t])).map;
            assert!((&alone.column(0) - &map.column(t)).iter().all(|off| off.abs() < 1e-9));
        }
    }

    /// The best gain for one feature of variance 1 with noise of variance 1/4 is 1 / (1 + 1/4).
    #[test]
    fn noise_that_the_samples_lack_shrinks_the_gains() {
        let x = normal(20_000, 1, 8);
        let folds = Folds::consecutive(20_000, 5);
        let noise = Array2::from_elem((1, 1), 0.5);
        let ridge = with(&x, &x, &noise, |regression| regression.ridge(Some(&folds)).unwrap());
        assert!((ridge.map[[0, 0]] - 0.8).abs() < 0.02, "{}", ridge.map);
    }

    #[test]
    fn least_squares_has_the_minimum_norm() {
        // Equal columns share their gain.
        let first = normal(10, 1, 9);
        let x = concatenate![Axis(1), first, first];
        let least = with(&x, &(&first * 3.0 + 1.0), &none(2), |regression| {
            regression.least_squares().unwrap()
        });
        for (ours, expected) in least.column(0).iter().zip([1.5, 1.5, 1.0]) {
            assert!((ours - expected).abs() < 1e-12, "{least}");
        }
        // Fewer samples than features: through all samples.
        let (x, y) = (normal(6, 20, 10), normal(6, 2, 11));
        let least = with(&x, &y, &none(20), |regression| regression.least_squares().unwrap());
        assert!((answers(&least, &x) - y).iter().all(|off| off.abs() < 1e-12));
    }

    #[test]
    fn no_or_one_sample_and_no_features_or_outputs() {
        for (samples, features, outputs) in [(1, 3, 2), (2, 3, 2), (5, 0, 2), (5, 3, 0)] {
            let (x, y) = (normal(samples, features, 1), normal(samples, outputs, 2));
            let folds = (samples > 1).then(|| Folds::consecutive(samples, 2));
            let ridge = with(&x, &y, &none(features), |regression| {
                regression.ridge(folds.as_ref()).unwrap()
            });
            assert_eq!(ridge.map.dim(), (features + 1, outputs));
            assert!(ridge.map.iter().all(|value| value.is_finite()));
        }
        let (x, y) = (normal(0, 3, 0), normal(0, 2, 0));
        let empty = with(&x, &y, &none(3), |regression| regression.ridge(None).map(|_| ()));
        assert_eq!(empty, Err(NetworkError::Empty));
    }
}
