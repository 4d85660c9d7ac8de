use std::ops::Range;

use faer::{Mat, MatRef, Side, linalg::solvers::Solve};
use ndarray::{Array2, Axis};

use super::{clusters::distance2, units::Units};
use crate::network::ScalingError;

/// Kernel ridge regression with Gaussians of one width (Saunders, Gammerman and Vovk 1998), which is the mean of a
/// Gaussian process (Rasmussen and Williams 2006, eq. 2.23).
///
/// With K the Gaussians of all pairs of samples and W the numbers of copies, the coefficients are
/// (K + penalty · W⁻¹)⁻¹ (y − ȳ). The width is common to all outputs, and each has its own penalty. Both are chosen by
/// the error on contiguous blocks of samples that are left out in turn: neighbouring samples of a recording are alike,
/// so that the error on single samples would favour narrow Gaussians and low penalties.
///
/// Up to [`Self::MAX_SAMPLES`] samples are all centres. Of more, [`Self::SUBSET`] are centres, and the coefficients
/// minimise the penalised error on up to [`Self::MAX_ROWS`] samples (subset of regressors, ibid., section 8.3.1).
#[derive(Clone, Debug)]
pub(super) struct KernelRidge {
    /// Centres × inputs.
    pub centres: Array2<f64>,
    /// 1 / (2 · width²).
    pub sharpness: f64,
    /// Centres + 1 × outputs, the constant last.
    pub coefficients: Array2<f64>,
}

/// Penalties that are compared, from the largest to the smallest.
const PENALTIES: [f64; 10] = [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9];
/// Number of blocks that are left out in turn.
const BLOCKS: usize = 4;
/// Maximum number of samples from which width and penalties are chosen.
const MAX_SEARCHED: usize = 900;
/// Products of sharpness and total variance of the inputs that are compared, as powers of 2.
const SHARPNESS_EXPONENTS: Range<f64> = -9.0..7.0;
/// Exponent at which the search begins.
const FIRST_EXPONENT: f64 = -1.0;

impl KernelRidge {
    /// Maximum number of samples that are all centres.
    pub const MAX_SAMPLES: usize = 4000;
    /// Number of centres in larger sets.
    pub const SUBSET: usize = 1000;
    /// Maximum number of samples to which the coefficients of a larger set are fitted.
    const MAX_ROWS: usize = 20_000;

    /// Fits to `units`, whose inputs should have comparable scales.
    ///
    /// # Errors
    /// If there are no samples.
    pub fn fit(units: &Units) -> Result<Self, ScalingError> {
        if units.x.nrows() == 0 {
            return Err(ScalingError::Empty);
        }
        let choice = Choice::by_blocks(&thinned(units, MAX_SEARCHED));
        let (y, means) = centred(units);
        let (centres, gains) = if units.x.nrows() <= Self::MAX_SAMPLES {
            (units.x.clone(), choice.at_all(units, &y))
        } else {
            let fitted = thinned(units, Self::MAX_ROWS);
            let centres = thinned(units, Self::SUBSET).x;
            let gains = choice.at_subset(&fitted, &means, &centres);
            (centres, gains)
        };
        let count = centres.nrows();
        let coefficient = |(row, output): (usize, usize)| {
            if row < count {
                gains[(row, output)]
            } else {
                means[output]
            }
        };
        Ok(Self {
            coefficients: Array2::from_shape_fn((count + 1, means.len()), coefficient),
            centres,
            sharpness: choice.sharpness,
        })
    }
}

/// Returns at most `count` evenly spaced units.
fn thinned(units: &Units, count: usize) -> Units {
    let all = units.x.nrows();
    let kept = count.min(all);
    let indices: Vec<usize> = (0..kept).map(|place| place * all / kept).collect();
    Units {
        x: units.x.select(Axis(0), &indices),
        y: units.y.select(Axis(0), &indices),
        weights: indices.iter().map(|&index| units.weights[index]).collect(),
    }
}

/// Returns the outputs (units × outputs) minus their weighted means, and these means.
fn centred(units: &Units) -> (Mat<f64>, Vec<f64>) {
    let all: Vec<usize> = (0..units.x.nrows()).collect();
    let means = means(units, &all);
    (offsets(units, &all, &means), means)
}

/// Returns the weighted mean of each output over `samples`.
fn means(units: &Units, samples: &[usize]) -> Vec<f64> {
    let total: f64 = samples.iter().map(|&sample| units.weights[sample]).sum();
    let of = |output: usize| {
        samples
            .iter()
            .map(|&s| units.weights[s] * units.y[[s, output]])
            .sum::<f64>()
    };
    (0..units.y.ncols()).map(|output| of(output) / total).collect()
}

fn offsets(units: &Units, samples: &[usize], means: &[f64]) -> Mat<f64> {
    Mat::from_fn(samples.len(), means.len(), |row, output| {
        units.y[[samples[row], output]] - means[output]
    })
}

/// Width, and penalty of each output.
#[derive(Debug)]
struct Choice {
    sharpness: f64,
    /// Infinite if the mean is better than any map.
    penalties: Vec<f64>,
}

impl Choice {
    /// Chooses by the error on blocks of samples that are left out in turn.
    fn by_blocks(units: &Units) -> Self {
        let variance = units.x.var_axis(Axis(0), 0.0).sum();
        let count = units.x.nrows();
        let outputs = units.y.ncols();
        // Without variance, all Gaussians are 1; with fewer samples than blocks, nothing can be left out.
        if variance.is_nan() || variance <= 0.0 || count < 2 * BLOCKS {
            return Self {
                sharpness: if variance > 0.0 { 0.5 / variance } else { 0.0 },
                penalties: vec![PENALTIES[2]; outputs],
            };
        }
        let distances = distances2(&units.x);
        let judge = |exponent: f64| {
            let sharpness = exponent.exp2() / variance;
            let (penalties, errors) = held_out(units, distances.as_ref(), sharpness);
            // The geometric mean over the outputs, whose errors have different sizes.
            let score: f64 = errors.iter().map(|error| error.max(f64::MIN_POSITIVE).ln()).sum();
            (score, Self { sharpness, penalties })
        };
        let mut at = FIRST_EXPONENT;
        let mut best = judge(at);
        for step in [1.0, -1.0] {
            while SHARPNESS_EXPONENTS.contains(&(at + step)) {
                let next = judge(at + step);
                if next.0 >= best.0 {
                    break;
                }
                (best, at) = (next, at + step);
            }
        }
        best.1
    }

    /// Returns the coefficients (units × outputs) of Gaussians around all units for the centred outputs `y`.
    fn at_all(&self, units: &Units, y: &Mat<f64>) -> Mat<f64> {
        let mut kernel = gaussians(distances2(&units.x).as_ref(), self.sharpness);
        self.solve(
            y.ncols(),
            |penalty, outputs| {
                for (sample, weight) in units.weights.iter().enumerate() {
                    kernel[(sample, sample)] = 1.0 + penalty / weight;
                }
                let right = Mat::from_fn(y.nrows(), outputs.len(), |row, place| y[(row, outputs[place])]);
                Some(kernel.llt(Side::Lower).ok()?.solve(&right))
            },
            units.x.nrows(),
        )
    }

    /// Returns the coefficients (centres × outputs) of Gaussians around `centres`, fitted to `units`.
    fn at_subset(&self, units: &Units, means: &[f64], centres: &Array2<f64>) -> Mat<f64> {
        /// Number of samples whose Gaussians are in memory at the same time.
        const CHUNK: usize = 1000;
        let count = centres.nrows();
        let mut gram = Mat::<f64>::zeros(count, count);
        let mut right = Mat::<f64>::zeros(count, means.len());
        let samples: Vec<usize> = (0..units.x.nrows()).collect();
        for chunk in samples.chunks(CHUNK) {
            let roots: Vec<f64> = chunk.iter().map(|&sample| units.weights[sample].sqrt()).collect();
            let basis = Mat::from_fn(chunk.len(), count, |row, centre| {
                let apart2 = distance2(units.x.row(chunk[row]), centres.row(centre));
                roots[row] * (-self.sharpness * apart2).exp()
            });
            let y = offsets(units, chunk, means);
            let y = Mat::from_fn(chunk.len(), means.len(), |row, output| roots[row] * y[(row, output)]);
            gram += basis.transpose() * &basis;
            right += basis.transpose() * &y;
        }
        let kernel = gaussians(distances2(centres).as_ref(), self.sharpness);
        // Gram matrix and kernel both lose half of the digits.
        let rounding = f64::EPSILON * units.weights.iter().sum::<f64>() * count as f64;
        self.solve(
            means.len(),
            |penalty, outputs| {
                let mut matrix = &gram + faer::Scale(penalty) * &kernel;
                for centre in 0..count {
                    matrix[(centre, centre)] += rounding;
                }
                let right = Mat::from_fn(count, outputs.len(), |row, place| right[(row, outputs[place])]);
                Some(matrix.llt(Side::Lower).ok()?.solve(&right))
            },
            count,
        )
    }

    /// Solves for the outputs of each penalty together; a penalty at which the matrix is numerically singular is raised.
    fn solve(
        &self,
        outputs: usize,
        mut solution: impl FnMut(f64, &[usize]) -> Option<Mat<f64>>,
        rows: usize,
    ) -> Mat<f64> {
        let mut gains = Mat::zeros(rows, outputs);
        let mut left: Vec<usize> = (0..outputs)
            .filter(|&output| self.penalties[output].is_finite())
            .collect();
        while let Some(&first) = left.first() {
            let penalty = self.penalties[first];
            let (same, others) = left.into_iter().partition(|&output| self.penalties[output] == penalty);
            left = others;
            let mut raised = penalty;
            let solved = loop {
                match solution(raised, &same) {
                    Some(solved) => break solved,
                    None if raised < PENALTIES[0] => raised *= 10.0,
                    // Not finite: the mean is all that is left.
                    None => break Mat::zeros(rows, same.len()),
                }
            };
            for (place, &output) in same.iter().enumerate() {
                gains.col_mut(output).copy_from(solved.col(place));
            }
        }
        gains
    }
}

/// Returns the penalty with the lowest error on held-out blocks for each output, infinite for the mean, and this error
/// (a sum of squares).
fn held_out(units: &Units, distances2: MatRef<'_, f64>, sharpness: f64) -> (Vec<f64>, Vec<f64>) {
    /// Penalties below the best that are tried before the search ends.
    const PATIENCE: usize = 2;
    let (count, outputs) = (units.x.nrows(), units.y.ncols());
    let kernel = gaussians(distances2, sharpness);
    let blocks: Vec<Block> = (0..BLOCKS)
        .map(|block| Block::new(units, block * count / BLOCKS..(block + 1) * count / BLOCKS, &kernel))
        .collect();
    let mut errors = vec![0.0; outputs];
    for block in &blocks {
        block.add_errors(&Mat::zeros(block.test.nrows(), outputs), &mut errors);
    }
    let mut penalties = vec![f64::INFINITY; outputs];
    let mut best_place = 0;
    for (place, &penalty) in PENALTIES.iter().enumerate() {
        let mut of_penalty = vec![0.0; outputs];
        for block in &blocks {
            match block.answers(penalty) {
                Some(answers) => block.add_errors(&answers, &mut of_penalty),
                None => of_penalty.fill(f64::INFINITY),
            }
        }
        for output in 0..outputs {
            if of_penalty[output] < errors[output] {
                (errors[output], penalties[output], best_place) = (of_penalty[output], penalty, place);
            }
        }
        if place >= best_place + PATIENCE && place >= 4 {
            break;
        }
    }
    (penalties, errors)
}

/// A block of samples that is left out, and the others.
struct Block {
    /// Kernel of the others.
    kernel: Mat<f64>,
    /// Kernel of left-out samples × others.
    across: Mat<f64>,
    /// Numbers of copies of the others.
    weights: Vec<f64>,
    /// Outputs of the others minus their means.
    training: Mat<f64>,
    /// Outputs of the left-out samples minus the means of the others.
    test: Mat<f64>,
    /// Numbers of copies of the left-out samples.
    test_weights: Vec<f64>,
}

impl Block {
    fn new(units: &Units, test: Range<usize>, kernel: &Mat<f64>) -> Self {
        let others: Vec<usize> = (0..units.x.nrows()).filter(|sample| !test.contains(sample)).collect();
        let means = means(units, &others);
        let left_out: Vec<usize> = test.collect();
        Self {
            kernel: Mat::from_fn(others.len(), others.len(), |i, j| kernel[(others[i], others[j])]),
            across: Mat::from_fn(left_out.len(), others.len(), |i, j| kernel[(left_out[i], others[j])]),
            weights: others.iter().map(|&sample| units.weights[sample]).collect(),
            training: offsets(units, &others, &means),
            test: offsets(units, &left_out, &means),
            test_weights: left_out.iter().map(|&sample| units.weights[sample]).collect(),
        }
    }

    /// Returns the answers to the left-out samples; `None` if the kernel is numerically singular.
    fn answers(&self, penalty: f64) -> Option<Mat<f64>> {
        let mut matrix = self.kernel.clone();
        for (sample, weight) in self.weights.iter().enumerate() {
            matrix[(sample, sample)] += penalty / weight;
        }
        let gains = matrix.llt(Side::Lower).ok()?.solve(&self.training);
        Some(&self.across * gains)
    }

    fn add_errors(&self, answers: &Mat<f64>, errors: &mut [f64]) {
        for (output, error) in errors.iter_mut().enumerate() {
            let squares = self.test_weights.iter().enumerate().map(|(row, weight)| {
                let off = answers[(row, output)] - self.test[(row, output)];
                weight * off * off
            });
            *error += squares.sum::<f64>();
        }
    }
}

/// Returns the squared distances of all pairs of rows of `x`.
fn distances2(x: &Array2<f64>) -> Mat<f64> {
    Mat::from_fn(x.nrows(), x.nrows(), |i, j| distance2(x.row(i), x.row(j)))
}

fn gaussians(distances2: MatRef<'_, f64>, sharpness: f64) -> Mat<f64> {
    Mat::from_fn(distances2.nrows(), distances2.ncols(), |i, j| {
        (-sharpness * distances2[(i, j)]).exp()
    })
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::standard_normal;

    /// Samples of a smooth function of three inputs that wander slowly, with noise of this standard deviation, and of
    /// noise alone.
    fn units(count: usize, noise: f64, seed: u64) -> Units {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut state = [0.0; 3];
        let mut x = Array2::zeros((count, 3));
        let mut y = Array2::zeros((count, 2));
        for sample in 0..count {
            for (input, value) in state.iter_mut().enumerate() {
                *value = 0.8 * *value + 0.6 * standard_normal(&mut rng);
                x[[sample, input]] = *value;
            }
            y[[sample, 0]] = truth(&state) + noise * standard_normal(&mut rng);
            y[[sample, 1]] = standard_normal(&mut rng);
        }
        Units {
            x,
            y,
            weights: vec![1.0; count],
        }
    }

    fn truth(x: &[f64]) -> f64 {
        (1.5 * x[0]).sin() + 0.5 * x[1] * x[2]
    }

    fn answers(fit: &KernelRidge, x: &Array2<f64>) -> Array2<f64> {
        let count = fit.centres.nrows();
        let mut basis = Array2::ones((x.nrows(), count + 1));
        for ((sample, centre), value) in basis.indexed_iter_mut().filter(|((_, centre), _)| *centre < count) {
            *value = (-fit.sharpness * distance2(x.row(sample), fit.centres.row(centre))).exp();
        }
        basis.dot(&fit.coefficients)
    }

    fn rmse(fit: &KernelRidge, test: &Units) -> Vec<f64> {
        let squares = (answers(fit, &test.x) - &test.y).mapv(|error| error * error);
        squares.mean_axis(Axis(0)).unwrap().mapv(f64::sqrt).to_vec()
    }

    /// The normal equations say y − ȳ − K a = penalty · a.
    #[test]
    fn coefficients_solve_the_equations_with_the_penalty_of_each_output() {
        let units = units(120, 0.3, 1);
        let choice = Choice {
            sharpness: 0.2,
            penalties: vec![1e-2, f64::INFINITY],
        };
        let (y, _) = centred(&units);
        let gains = choice.at_all(&units, &y);
        let kernel = gaussians(distances2(&units.x).as_ref(), 0.2);
        let rest = &y - kernel * &gains;
        for sample in 0..120 {
            assert!((rest[(sample, 0)] - 1e-2 * gains[(sample, 0)]).abs() < 1e-10);
            assert_eq!(gains[(sample, 1)], 0.0, "the mean");
        }
    }

    #[test]
    fn the_choice_is_close_to_the_best_one_for_new_samples() {
        for noise in [0.0, 0.3] {
            let (training, test) = (units(500, noise, 2), units(500, 0.0, 3));
            let chosen = rmse(&KernelRidge::fit(&training).unwrap(), &test)[0];
            let (y, means) = centred(&training);
            let mut best = f64::INFINITY;
            for sharpness in [0.02, 0.05, 0.1, 0.2, 0.5, 1.0] {
                for penalty in PENALTIES {
                    let choice = Choice {
                        sharpness,
                        penalties: vec![penalty; 2],
                    };
                    let gains = choice.at_all(&training, &y);
                    let coefficients =
                        |(row, output): (usize, usize)| if row < 500 { gains[(row, output)] } else { means[output] };
                    let fit = KernelRidge {
                        centres: training.x.clone(),
                        sharpness,
                        coefficients: Array2::from_shape_fn((501, 2), coefficients),
                    };
                    best = best.min(rmse(&fit, &test)[0]);
                }
            }
            assert!(chosen < 1.5 * best && chosen < 0.2, "noise {noise}: {chosen} {best}");
        }
    }

    #[test]
    fn noise_alone_does_not_ruin_another_output() {
        let (training, test) = (units(400, 0.05, 4), units(400, 0.0, 5));
        let fit = KernelRidge::fit(&training).unwrap();
        let errors = rmse(&fit, &test);
        assert!(errors[0] < 0.15 && errors[1] < 1.1, "{errors:?}");
    }

    #[test]
    fn a_copy_counts_as_often_as_it_occurs() {
        let once = units(60, 0.2, 6);
        let choice = Choice {
            sharpness: 0.2,
            penalties: vec![0.1, 0.1],
        };
        let copies: Vec<usize> = (0..120).map(|sample| sample / 2).collect();
        let twice = Units {
            x: once.x.select(Axis(0), &copies),
            y: once.y.select(Axis(0), &copies),
            weights: vec![1.0; 120],
        };
        let weighted = Units {
            weights: vec![2.0; 60],
            ..units(60, 0.2, 6)
        };
        let (gains, of_copies) = (
            choice.at_all(&weighted, &centred(&weighted).0),
            choice.at_all(&twice, &centred(&twice).0),
        );
        for sample in 0..60 {
            let sum = of_copies[(2 * sample, 0)] + of_copies[(2 * sample + 1, 0)];
            assert!((gains[(sample, 0)] - sum).abs() < 1e-10);
        }
    }

    #[test]
    fn larger_sets_have_fewer_centres_and_are_as_accurate() {
        let (training, test) = (units(KernelRidge::MAX_SAMPLES + 1, 0.1, 7), units(300, 0.0, 8));
        let fit = KernelRidge::fit(&training).unwrap();
        assert_eq!(fit.centres.nrows(), KernelRidge::SUBSET);
        let error = rmse(&fit, &test)[0];
        assert!(error < 0.05, "{error}");
    }

    #[test]
    fn extreme_sets_are_finite() {
        let few = units(3, 0.1, 9);
        let same = Units {
            x: Array2::ones((40, 3)),
            ..units(40, 0.1, 9)
        };
        for units in [few, same] {
            let fit = KernelRidge::fit(&units).unwrap();
            assert!(fit.coefficients.iter().all(|value| value.is_finite()));
        }
        let none = units(0, 0.0, 0);
        assert!(matches!(KernelRidge::fit(&none), Err(ScalingError::Empty)));
    }
}
