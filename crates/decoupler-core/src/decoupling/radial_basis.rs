//! Radial-basis networks and kernel ridge regression, fitted and compiled for fast decoding.

use std::{borrow::Cow, ops::Range};

use faer::{Mat, Side, linalg::solvers::Solve};
use ndarray::{Array1, Array2, ArrayView1, Axis};
use rand::Rng;

use super::{
    Precision,
    program::{Builder, Function, Program},
    ridge::Choice,
    standardised::folds,
};
use crate::{
    dataset::{Dataset, Folds},
    network::{InputChoice, Inputs, MinMax, NetworkError, ScalingChoice},
    scene::NoiseSource,
};

/// Maximum number of samples from which the kernel of a radial-basis network is chosen.
const MAX_SEARCHED: usize = 800;

/// Number of samples from which a kernel is chosen on given folds.
const SHAPED: usize = 500;

/// Number of centres of radial-basis networks in sets of more than four times as many samples.
const SUBSET: usize = 1000;

impl Program {
    /// Fits a radial-basis network (Broomhead and Lowe 1988) to a training set: Gaussians around centres in the scaled
    /// inputs, and a linear output layer with a constant, by kernel ridge regression. `unseen` is as in [`Inputs::fit`];
    /// `rng` draws the noise.
    ///
    /// Up to 4000 training samples are all centres, of more there are 1000 centres. The width of the Gaussians and the
    /// penalty of each target are chosen by cross-validation on folds of the training samples. Inputs that are
    /// scaled to [−1, 1] are divided by their standard deviation.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn radial_basis(
        training: &Dataset,
        choice: InputChoice,
        unseen: NoiseSource,
        rng: &mut impl Rng,
    ) -> Result<Self, NetworkError> {
        let training = with_noise(training, unseen, rng);
        let searched = thinned(training.samples(), MAX_SEARCHED);
        let folds = folds(&training.select(&searched));
        let scaled = Scaled::of(&training, choice)?;
        let (kernel, penalties) = scaled.choose(&searched, folds.as_ref(), 0.0);
        Ok(scaled.program(kernel, &penalties, SUBSET))
    }

    /// As [`Self::radial_basis`], with a kernel whose shape is given: up to four times `subset` samples are all centres, of
    /// more there are `subset`.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub(crate) fn kernel(training: &Dataset, shape: &KernelShape, subset: usize) -> Result<Self, NetworkError> {
        let scaled = Scaled::of(training, shape.inputs)?;
        let penalty = |&target: &usize| shape.penalties[target];
        let penalties = Vec::from_iter(scaled.outputs.varying().iter().map(penalty));
        Ok(scaled.program(shape.kernel, &penalties, subset))
    }
}

/// Samples in the units of a kernel.
struct Scaled {
    inputs: Inputs,
    /// Factors of the inputs.
    scales: Array1<f64>,
    outputs: MinMax,
    x: Array2<f64>,
    y: Array2<f64>,
}

impl Scaled {
    fn of(training: &Dataset, choice: InputChoice) -> Result<Self, NetworkError> {
        let inputs = Inputs::fit(choice, training.readings(), NoiseSource::default())?;
        let outputs = MinMax::fit(training.targets())?;
        let x = inputs.of(training.readings());
        let scales = match choice.scaling {
            ScalingChoice::MinMax => x.std_axis(Axis(0), 0.0).mapv(|deviation| 1.0 / deviation),
            // Components below the noise have less than unit variance on purpose.
            ScalingChoice::Whitening => Array1::ones(x.ncols()),
        };
        Ok(Self {
            x: x * &scales,
            y: outputs.scale(training.targets()),
            inputs,
            scales,
            outputs,
        })
    }

    /// Chooses a kernel, and the penalty of each output, on `folds` of some of the samples.
    fn choose(&self, searched: &[usize], folds: Option<&Folds>, linear: f64) -> (Kernel, Vec<f64>) {
        let [x, y] = [&self.x, &self.y].map(|of| of.select(Axis(0), searched));
        Kernel::choose(&x, &y, folds, linear)
    }

    /// The network of a kernel fitted to the samples.
    fn program(&self, kernel: Kernel, penalties: &[f64], subset: usize) -> Program {
        let double = Precision::Double;
        let (centres, mut weights, constants) = kernel.fit(&self.x, &self.y, penalties, subset);
        // Distances in units of the width: exp(−sharpness · |x − c|²).
        let root = kernel.sharpness.sqrt();
        let (channel_centres, to_inputs) = self.inputs.affine();
        let to_inputs = &to_inputs.t() * &(&self.scales * root);
        let mut builder = Builder::new(channel_centres.len());
        let zeros = vec![0.0; self.inputs.count()];
        let changes = builder.changes(self.inputs.quantity(), &channel_centres, double);
        let scaled = builder.affine_of(&changes, to_inputs, &zeros);
        let distances = builder.squared_distances(scaled, &centres.t() * root, double);
        let mut basis = builder.map(Function::Gaussian, distances, double);
        if kernel.linear > 0.0 && kernel.sharpness > 0.0 {
            let slopes = centres.t().dot(&weights) * (kernel.linear / root);
            weights.append(Axis(0), slopes.view()).expect("the same outputs");
            basis = builder.concatenate(&[basis, scaled]);
        }
        let changes = builder.affine(basis, weights, &constants.to_vec(), double);
        let targets = builder.restored(changes, &self.outputs);
        builder.finish(targets)
    }
}

/// Kernel and penalties chosen by cross-validation.
#[derive(Clone, Debug)]
pub(crate) struct KernelShape {
    /// Quantity and scaling of the inputs.
    inputs: InputChoice,
    kernel: Kernel,
    /// Penalty of each target.
    penalties: Vec<f64>,
}

impl KernelShape {
    /// Chooses width and penalties by the held-out errors in `folds` of `training`; with `is_linear`, a linear kernel is added
    /// that has ten times the variance of the Gaussian, for relations with a linear part.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub(crate) fn choose(
        training: &Dataset,
        inputs: InputChoice,
        is_linear: bool,
        folds: &Folds,
    ) -> Result<Self, NetworkError> {
        let scaled = Scaled::of(training, inputs)?;
        let searched = thinned(training.samples(), SHAPED);
        let linear = if is_linear {
            10.0 / scaled.x.ncols().max(1) as f64
        } else {
            0.0
        };
        let (kernel, chosen) = scaled.choose(&searched, folds.among(&searched).as_ref(), linear);
        let mut penalties = vec![f64::INFINITY; training.outputs()];
        for (&target, penalty) in scaled.outputs.varying().iter().zip(chosen) {
            penalties[target] = penalty;
        }
        Ok(Self {
            inputs,
            kernel,
            penalties,
        })
    }

    /// Approximate number of multiplications of a choice and of a fit to `samples` samples with `subset` centres of many.
    pub(crate) fn multiplications(samples: usize, folds: usize, subset: usize) -> [f64; 2] {
        /// Usual number of widths and penalties that are compared.
        const COMPARED: usize = 50;
        let cube = |size: usize| (size as f64).powi(3) / 3.0;
        let searched = SHAPED.min(samples);
        let fit = if samples <= 4 * subset {
            cube(samples)
        } else {
            (20 * subset).min(samples) as f64 * (subset as f64).powi(2) + cube(subset)
        };
        [(COMPARED * folds) as f64 * cube(searched - searched / folds), fit]
    }
}

/// Returns `training` with the noise that its readings lack: a nonlinear map learns the effect of noise from samples.
pub(super) fn with_noise<'a>(training: &'a Dataset, unseen: NoiseSource, rng: &mut impl Rng) -> Cow<'a, Dataset> {
    let mut training = Cow::Borrowed(training);
    if !unseen.is_none() {
        training.to_mut().disturb_by(unseen, rng);
    }
    training
}

/// At most `count` evenly spaced indices of `samples` samples.
pub(super) fn thinned(samples: usize, count: usize) -> Vec<usize> {
    let kept = count.min(samples);
    (0..kept).map(|place| place * samples / kept).collect()
}

/// Products of sharpness and total variance of the inputs that are compared, as powers of 2.
const SHARPNESS_EXPONENTS: Range<f64> = -9.0..7.0;

/// Exponent at which the search begins.
const FIRST_EXPONENT: f64 = -1.0;

/// Penalties that are compared, in descending order; the first leaves only the mean.
fn penalties() -> impl Iterator<Item = f64> {
    std::iter::once(f64::INFINITY).chain((0..=9).map(|place| 0.1_f64.powi(place)))
}

/// Kernel of ridge regression: Gaussians of one width (Saunders, Gammerman and Vovk 1998), whose fit is the mean of a
/// Gaussian process (Rasmussen and Williams 2006, eq. 2.23), to which a linear kernel may be added.
///
/// With K the kernel between all pairs of samples, the coefficients are (K + penalty · 1)⁻¹ (y − ȳ). The width is common to
/// all outputs, and each has its own penalty, both chosen by cross-validation.
#[derive(Clone, Copy, Debug)]
struct Kernel {
    /// 1 / (2 · width²).
    sharpness: f64,
    /// Factor of the linear kernel x · x′ that is added to the Gaussian; 0 for none.
    linear: f64,
}

impl Kernel {
    /// Chooses the sharpness, and the penalty of each output, by the error on held-out folds. The inputs `x` (samples ×
    /// inputs) should have comparable scales.
    fn choose(x: &Array2<f64>, y: &Array2<f64>, folds: Option<&Folds>, linear: f64) -> (Self, Vec<f64>) {
        let variance = x.var_axis(Axis(0), 0.0).sum();
        // Without variance, all Gaussians are 1.
        let Some(folds) = folds.filter(|_| variance > 0.0) else {
            let sharpness = 0.0;
            return (Self { sharpness, linear }, vec![f64::INFINITY; y.ncols()]);
        };
        let judge = |exponent: f64| {
            let sharpness = exponent.exp2() / variance;
            let kernel = Self { sharpness, linear };
            let between = kernel.between(x, x);
            let choice = Choice::new(penalties(), y.ncols(), Choice::PATIENCE, |penalty| {
                let of_fold = |fold| held_out(&between, y, &folds.without(&[fold]), folds.test(fold), penalty);
                (0..folds.count()).map(of_fold).collect()
            });
            let total = |output: usize| choice.squares.iter().map(|fold| fold[output]).sum::<f64>();
            // The geometric mean over the outputs, whose errors have different sizes.
            let score: f64 = (0..y.ncols())
                .map(|output| total(output).max(f64::MIN_POSITIVE).ln())
                .sum();
            (score, (kernel, choice.levels))
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

    /// Fits outputs `y` (samples × outputs) on inputs `x` (samples × inputs); there is at least one sample. Returns the
    /// centres (centres × inputs), the coefficients (centres × outputs) and the constants.
    ///
    /// Up to `4 · subset` samples are all centres. Of more, `subset` are centres, and the coefficients minimise the penalised
    /// error on up to `20 · subset` samples (subset of regressors, Rasmussen and Williams 2006, section 8.3.1).
    fn fit(
        self,
        x: &Array2<f64>,
        y: &Array2<f64>,
        penalties: &[f64],
        subset: usize,
    ) -> (Array2<f64>, Array2<f64>, Array1<f64>) {
        let samples = x.nrows();
        let means = y.mean_axis(Axis(0)).expect("there are samples");
        let (centres, gains) = if samples <= 4 * subset {
            let off = Mat::from_fn(samples, y.ncols(), |s, t| y[[s, t]] - means[t]);
            let kernel = self.between(x, x);
            let gains = solve(penalties, &off, |penalty| {
                let mut matrix = kernel.clone();
                (0..samples).for_each(|sample| matrix[(sample, sample)] += penalty);
                matrix
            });
            (x.clone(), gains)
        } else {
            let centres = x.select(Axis(0), &thinned(samples, subset));
            let rows = thinned(samples, 20 * subset);
            let (mut gram, mut right) = (Mat::zeros(subset, subset), Mat::zeros(subset, y.ncols()));
            for chunk in rows.chunks(subset) {
                let basis = self.between(&x.select(Axis(0), chunk), &centres);
                gram += basis.transpose() * &basis;
                right += basis.transpose() * Mat::from_fn(chunk.len(), y.ncols(), |s, t| y[[chunk[s], t]] - means[t]);
            }
            // Gram matrix and kernel both lose half of the digits.
            let largest = (0..subset)
                .map(|centre| gram[(centre, centre)])
                .fold(rows.len() as f64, f64::max);
            let rounding = f64::EPSILON * subset as f64 * largest;
            let kernel = self.between(&centres, &centres);
            let gains = solve(penalties, &right, |penalty| {
                let mut matrix = &gram + faer::Scale(penalty) * &kernel;
                (0..subset).for_each(|centre| matrix[(centre, centre)] += rounding);
                matrix
            });
            (centres, gains)
        };
        let gains = Array2::from_shape_fn((centres.nrows(), y.ncols()), |(row, output)| gains[(row, output)]);
        (centres, gains, means)
    }

    /// Gaussians between the rows of `x` and `centres`, plus their scalar products times the linear factor.
    fn between(self, x: &Array2<f64>, centres: &Array2<f64>) -> Mat<f64> {
        Mat::from_fn(x.nrows(), centres.nrows(), |i, j| {
            let gaussian = (-self.sharpness * distance2(x.row(i), centres.row(j))).exp();
            match self.linear {
                0.0 => gaussian,
                linear => gaussian + linear * x.row(i).dot(&centres.row(j)),
            }
        })
    }
}

/// Sum of squared errors of each output on the samples `test` of a fit to the samples `training`; infinite if the kernel
/// is numerically singular.
fn held_out(kernel: &Mat<f64>, y: &Array2<f64>, training: &[usize], test: &[usize], penalty: f64) -> Vec<f64> {
    let part = |rows: &[usize]| Mat::from_fn(rows.len(), training.len(), |i, j| kernel[(rows[i], training[j])]);
    let means = y
        .select(Axis(0), training)
        .mean_axis(Axis(0))
        .expect("a fold leaves samples");
    let off = |rows: &[usize]| Mat::from_fn(rows.len(), y.ncols(), |s, t| y[[rows[s], t]] - means[t]);
    let (mut own, targets) = (part(training), off(test));
    let squares = |errors: Mat<f64>| errors.col_iter().map(|column| column.squared_norm_l2()).collect();
    if penalty.is_infinite() {
        return squares(targets);
    }
    (0..training.len()).for_each(|sample| own[(sample, sample)] += penalty);
    match own.llt(Side::Lower) {
        Ok(factor) => squares(part(test) * factor.solve(&off(training)) - targets),
        Err(_) => vec![f64::INFINITY; y.ncols()],
    }
}

/// Solves for the outputs of each penalty together; a penalty at which the matrix is numerically singular is raised. The
/// gains of an output with an infinite penalty are 0.
fn solve(penalties: &[f64], right: &Mat<f64>, mut matrix: impl FnMut(f64) -> Mat<f64>) -> Mat<f64> {
    let mut gains = Mat::zeros(right.nrows(), penalties.len());
    let mut left: Vec<usize> = (0..penalties.len()).filter(|&t| penalties[t].is_finite()).collect();
    while let Some(&first) = left.first() {
        let penalty = penalties[first];
        let (same, others): (Vec<usize>, _) = left.into_iter().partition(|&output| penalties[output] == penalty);
        left = others;
        let of_same = Mat::from_fn(right.nrows(), same.len(), |row, place| right[(row, same[place])]);
        let mut raised = std::iter::successors(Some(penalty), |penalty| Some(10.0 * penalty)).take_while(|&p| p < 1e3);
        // If none is large enough, values are not finite: the mean is all that is left.
        let Some(solved) = raised.find_map(|penalty| Some(matrix(penalty).llt(Side::Lower).ok()?.solve(&of_same)))
        else {
            continue;
        };
        for (place, &output) in same.iter().enumerate() {
            gains.col_mut(output).copy_from(solved.col(place));
        }
    }
    gains
}

/// Squared Euclidean distance.
#[inline]
pub(super) fn distance2(a: ArrayView1<'_, f64>, b: ArrayView1<'_, f64>) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

#[cfg(test)]
mod tests {
    use dashu_float::{FBig, round::mode::HalfEven};

    use serde::Deserialize;

    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        decoupling::{Decoder, ProgramDecoder, decode_set},
        network::Quantity,
        scene::{Rows, Scene, standard_normal},
        sensor::SensorModel,
    };

    /// Whitening divides by deviations that are hardly above the rounding of the readings, which is amplified: no
    /// evaluation in double precision can be closer to the network evaluated in 150 bits than the effect of one unit
    /// in the last place of the readings.
    #[test]
    fn rounding_is_that_of_the_readings() {
        type Exact = FBig<HalfEven>;
        let exact = |value: f64| Exact::try_from(value).unwrap().with_precision(150).value();
        let model = SensorModel::new("10x10_5x30".parse().unwrap());
        let scene = Scene {
            rows: Rows::One(3),
            ..Scene::default()
        };
        let mut rng = Seed(0).rng(Stream::Training);
        let set = Dataset::simulate(&model, &scene, 300, &mut rng).unwrap();
        let scaled = Scaled::of(&set, InputChoice::BEST).unwrap();
        let (kernel, penalties) = scaled.choose(&Vec::from_iter(0..set.samples()), folds(&set).as_ref(), 0.0);
        let mut network = ProgramDecoder::new(scaled.program(kernel, &penalties, SUBSET));
        let (centres, coefficients, constants) = kernel.fit(&scaled.x, &scaled.y, &penalties, SUBSET);
        let (inputs, outputs, x, sharpness) = (&scaled.inputs, &scaled.outputs, &scaled.x, kernel.sharpness);
        let (channel_centres, to_inputs) = inputs.affine();
        let ranges = outputs.middles_and_half_widths();
        let (mut ours_mm, mut plain_mm, mut moved_mm) = (0.0_f64, 0.0_f64, 0.0_f64);
        for sample in 0..5 {
            let readings = set.sample_readings(sample);
            let mut answer = vec![0.0; network.outputs()];
            network.decode_row(0, readings, &mut answer).unwrap();
            let mut moved = answer.clone();
            let next = |(place, ohm): (usize, &f64)| if place % 2 == 0 { ohm.next_up() } else { ohm.next_down() };
            let nearby = Vec::from_iter(readings.iter().enumerate().map(next));
            network.decode_row(0, &nearby, &mut moved).unwrap();
            let values = readings.iter().zip(&channel_centres);
            let values = Vec::from_iter(values.map(|(&ohm, &centre)| exact(1.0) / exact(ohm) - exact(centre)));
            let dot = |row: ArrayView1<'_, f64>| {
                let terms = row.iter().zip(&values).map(|(&weight, value)| exact(weight) * value);
                terms.fold(exact(0.0), |sum, term| sum + term)
            };
            let exact_inputs = Vec::from_iter(to_inputs.rows().into_iter().map(dot));
            let gaussians = Vec::from_iter(centres.rows().into_iter().map(|centre| {
                let apart = centre.iter().zip(&exact_inputs).map(|(&centre, x)| x - exact(centre));
                let squares = apart.fold(exact(0.0), |sum, apart| sum + &apart * &apart);
                (-exact(sharpness) * squares).exp()
            }));
            let plain = Vec::from_iter(
                centres
                    .rows()
                    .into_iter()
                    .map(|c| gaussian(x.row(sample), c, sharpness)),
            );
            for (output, &target) in outputs.varying().iter().enumerate() {
                let (middle, half_width) = ranges[target];
                let gains = coefficients.column(output);
                let terms = gaussians.iter().zip(gains).map(|(value, &gain)| value * exact(gain));
                let sum = terms.fold(exact(constants[output]), |sum, term| sum + term);
                let truth = (sum * exact(half_width) + exact(middle)).to_f64().value();
                let sum: f64 = plain.iter().zip(gains).map(|(value, gain)| value * gain).sum();
                let one_by_one = (sum + constants[output]) * half_width + middle;
                ours_mm = ours_mm.max((answer[target] - truth).abs());
                plain_mm = plain_mm.max((one_by_one - truth).abs());
                moved_mm = moved_mm.max((answer[target] - moved[target]).abs());
            }
        }
        let message = format!("{ours_mm:e} {plain_mm:e}, a unit in the last place {moved_mm:e}");
        assert!(ours_mm < 2.0 * plain_mm && ours_mm < 4.0 * moved_mm, "{message}");
        assert!(moved_mm > 1e-9 && ours_mm < 1e-5, "{message}");
    }

    fn gaussian(x: ArrayView1<'_, f64>, centre: ArrayView1<'_, f64>, sharpness: f64) -> f64 {
        (-sharpness * distance2(x, centre)).exp()
    }

    /// Samples of a smooth function of three inputs that wander slowly, with noise of this standard deviation, and of
    /// noise alone.
    fn wandering(count: usize, noise: f64, seed: u64) -> (Array2<f64>, Array2<f64>) {
        let mut rng = Seed(seed).rng(Stream::Training);
        let mut state = [0.0; 3];
        let (mut x, mut y) = (Array2::zeros((count, 3)), Array2::zeros((count, 2)));
        for sample in 0..count {
            for (input, value) in state.iter_mut().enumerate() {
                *value = 0.8 * *value + 0.6 * standard_normal(&mut rng);
                x[[sample, input]] = *value;
            }
            let truth = (1.5 * state[0]).sin() + 0.5 * state[1] * state[2];
            y[[sample, 0]] = truth + noise * standard_normal(&mut rng);
            y[[sample, 1]] = standard_normal(&mut rng);
        }
        (x, y)
    }

    /// A kernel fitted to samples.
    struct Fit {
        sharpness: f64,
        centres: Array2<f64>,
        gains: Array2<f64>,
        constants: Array1<f64>,
    }

    fn fitted_on((x, y): &(Array2<f64>, Array2<f64>), folds: usize) -> Fit {
        let searched = thinned(x.nrows(), MAX_SEARCHED);
        let [of_x, of_y] = [x, y].map(|of| of.select(Axis(0), &searched));
        let folds = (searched.len() > 1).then(|| Folds::consecutive(searched.len(), folds));
        let (kernel, penalties) = Kernel::choose(&of_x, &of_y, folds.as_ref(), 0.0);
        let (centres, gains, constants) = kernel.fit(x, y, &penalties, SUBSET);
        Fit {
            sharpness: kernel.sharpness,
            centres,
            gains,
            constants,
        }
    }

    fn fitted(samples: &(Array2<f64>, Array2<f64>)) -> Fit {
        fitted_on(samples, 5)
    }

    fn rmse(fit: &Fit, (x, y): &(Array2<f64>, Array2<f64>)) -> Vec<f64> {
        let basis = Array2::from_shape_fn((x.nrows(), fit.centres.nrows()), |(sample, centre)| {
            gaussian(x.row(sample), fit.centres.row(centre), fit.sharpness)
        });
        let squares = (basis.dot(&fit.gains) + &fit.constants - y).mapv(|error| error * error);
        squares.mean_axis(Axis(0)).unwrap().mapv(f64::sqrt).to_vec()
    }

    /// The normal equations say y − ȳ − K a = penalty · a.
    #[test]
    fn coefficients_solve_the_equations_with_the_penalty_of_each_output() {
        let (x, y) = wandering(120, 0.3, 1);
        let fit = fitted(&(x.clone(), y.clone()));
        for t in 0..2 {
            let gains = fit.gains.column(t);
            let rest: Vec<f64> = (0..120)
                .map(|sample| {
                    let kernel = |other: usize| gaussian(x.row(sample), x.row(other), fit.sharpness);
                    y[[sample, t]] - fit.constants[t] - (0..120).map(|other| kernel(other) * gains[other]).sum::<f64>()
                })
                .collect();
            let square: f64 = gains.iter().take(120).map(|gain| gain * gain).sum();
            let product: f64 = gains.iter().zip(&rest).map(|(gain, rest)| gain * rest).sum();
            let penalty = if square > 0.0 { product / square } else { continue };
            let is_compared = penalties()
                .into_iter()
                .any(|compared| (compared / penalty - 1.0).abs() < 1e-6);
            assert!(is_compared, "{penalty}");
            for (rest, gain) in rest.iter().zip(gains) {
                assert!((rest - penalty * gain).abs() < 1e-8, "{t}");
            }
        }
    }

    #[test]
    fn new_samples_are_answered_well_next_to_an_output_of_noise_alone() {
        for (noise, most) in [(0.0, 0.02), (0.05, 0.1), (0.3, 0.2)] {
            let errors = rmse(&fitted(&wandering(500, noise, 2)), &wandering(500, 0.0, 3));
            assert!(errors[0] < most && errors[1] < 1.1, "noise {noise}: {errors:?}");
        }
    }

    #[test]
    fn larger_sets_have_fewer_centres_and_are_as_accurate() {
        let fit = fitted(&wandering(4 * SUBSET + 1, 0.1, 7));
        assert_eq!(fit.centres.nrows(), SUBSET);
        let error = rmse(&fit, &wandering(300, 0.0, 8))[0];
        assert!(error < 0.05, "{error}");
    }

    #[test]
    fn extreme_sets_are_finite() {
        let same = (Array2::ones((40, 3)), wandering(40, 0.1, 9).1);
        for (x, y) in [wandering(1, 0.1, 9), wandering(3, 0.1, 9), same] {
            let fit = fitted_on(&(x, y), 2);
            assert!(fit.gains.iter().chain(&fit.constants).all(|value| value.is_finite()));
        }
    }

    /// A case of `tests/fixtures/repeated_samples.py`.
    #[derive(Deserialize)]
    struct Case {
        name: String,
        x: Vec<Vec<f64>>,
        y: Vec<f64>,
        r2_ridge: f64,
        r2_kernel_ridge: f64,
    }

    fn r2(decoder: &mut dyn Decoder, test: &Dataset) -> f64 {
        let targets = test.targets();
        let off = decode_set(decoder, test).unwrap() - targets;
        let varied = &targets - targets.mean().unwrap();
        1.0 - off.mapv(|error| error * error).sum() / varied.mapv(|value| value * value).sum()
    }

    #[test]
    fn repeated_coarse_samples_count_as_in_scikit_learn() {
        let cases = include_str!("../../tests/fixtures/repeated_samples.json");
        let cases: Vec<Case> = serde_json::from_str(cases).unwrap();
        assert_eq!(cases.len(), 3);
        for Case {
            name,
            x,
            y,
            r2_ridge,
            r2_kernel_ridge,
        } in cases
        {
            let readings = Array2::from_shape_fn((x.len(), x[0].len()), |(s, c)| x[s][c]);
            let targets = Array2::from_shape_fn((y.len(), 1), |(s, _)| y[s]);
            let set = Dataset::new(readings, targets, None, (0..y.len()).collect()).unwrap();
            let fitted = 4 * y.len() / 5;
            let part = |samples: std::ops::Range<usize>| set.select(&samples.collect::<Vec<_>>());
            let (training, test) = (part(0..fitted), part(fitted..y.len()));
            let (choice, none) = (InputChoice::MEASURED, NoiseSource::default());
            let decoder = |program: Result<Program, NetworkError>| ProgramDecoder::new(program.unwrap());
            let ridge = r2(&mut decoder(Program::ridge(&training, Quantity::Raw, none)), &test);
            assert!((ridge - r2_ridge).abs() < 0.01, "{name}: ridge {ridge}, {r2_ridge}");
            let mut rng = Seed(0).rng(Stream::Expectation);
            let mut basis = decoder(Program::radial_basis(&training, choice, none, &mut rng));
            let mut fuzzy = decoder(Program::fuzzy(&training, Quantity::Raw, none, &mut rng));
            for (decoder, ours, close) in [
                ("basis", r2(&mut basis, &test), 0.02),
                ("fuzzy", r2(&mut fuzzy, &test), 0.05),
            ] {
                assert!(
                    (ours - r2_kernel_ridge).abs() < close,
                    "{name}: {decoder} {ours}, {r2_kernel_ridge}"
                );
            }
        }
    }
}
