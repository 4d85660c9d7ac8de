//! Fuzzy rules with affine consequents.

use std::mem::take;

use ndarray::{Array2, ArrayView2, Axis, Slice};
use rand::{Rng, seq::index};
use serde::{Deserialize, Serialize};

use super::{
    DecodeError, Decoder, Description, NotDescribed,
    radial_basis::{distance2, thinned, with_noise},
    ridge::{Regression, Standard, folds},
};
use crate::{
    dataset::Dataset,
    network::{InputChoice, Inputs, MinMax, NetworkError, Quantity, ScalingChoice},
    scene::NoiseSource,
};

/// A fuzzy system of Takagi and Sugeno (1985): rules "if the readings x are near centre i, then the coordinates are
/// Cᵢ·x + dᵢ", blended by their normalised firing strengths.
///
/// The antecedents are Gaussian memberships on the leading principal components of the readings, centred on clusters of
/// the training samples, with a width four times the distance between centres. The consequents of all rules are one
/// ridge regression on the standardised readings times the firing strengths. Cross-validation chooses the number of rules,
/// the number of components, and the penalty of each target.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TakagiSugeno {
    quantity: Quantity,
    /// Value subtracted from each channel.
    centre: Vec<f64>,
    /// Logarithms of the memberships from centred channels: (M4 + 1) × rules, the constant last.
    antecedents: Array2<f64>,
    /// Coordinates in millimetres from centred channels: for each rule (M4 + 1) × varying coordinates, the constant last.
    consequents: Array2<f64>,
    /// Middle of the range of every target; constant targets keep it.
    middles: Vec<f64>,
    /// Indices of the varying targets.
    varying: Vec<usize>,
    /// Centred channels and a 1.
    values: Vec<f64>,
    strengths: Vec<f64>,
    changes: Vec<f64>,
}

/// Candidate numbers of rules.
const RULES: [usize; 8] = [1, 2, 4, 8, 12, 16, 24, 32];
/// Number of rules (or the next smaller possible one) with which the components of the memberships are chosen.
const PILOT_RULES: usize = 8;
/// Candidate numbers of leading components for the memberships: in 30 dimensions distances hardly differ.
const COMPONENTS: [usize; 2] = [3, 10];
/// Width of the memberships, relative to the root mean square distance between centres.
const RELATIVE_WIDTH: f64 = 4.0;
/// Maximum number of regressors of a candidate.
const MAX_REGRESSORS: usize = 256;
/// Maximum ratio of regressors to samples: a fold must leave enough samples for its fit.
const REGRESSORS_PER_SAMPLE: f64 = 0.75;
/// Maximum number of samples by which rules are chosen.
const MAX_VALIDATED: usize = 1000;
/// A system with more rules must reduce the mean squared error to this fraction, to avoid choosing it by chance.
const WORTHWHILE: f64 = 0.97;

impl TakagiSugeno {
    /// Fits to a training set, on this quantity of the readings; `unseen` is as in [`Inputs::fit`]; `rng` draws the noise
    /// and the initial cluster centres.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn fit(
        training: &Dataset,
        quantity: Quantity,
        unseen: NoiseSource,
        rng: &mut impl Rng,
    ) -> Result<Self, NetworkError> {
        let scaling = ScalingChoice::Whitening;
        let training = with_noise(training, unseen, rng);
        let inputs = Inputs::fit(
            InputChoice { quantity, scaling },
            training.readings(),
            NoiseSource::default(),
        )?;
        let outputs = MinMax::fit(training.targets())?;
        let searched = training.select(&thinned(training.samples(), MAX_VALIDATED));
        let components = inputs.of(searched.readings());
        let mut antecedents = |rules, leading| antecedents(&inputs, components.view(), rules, leading, rng);
        let error = |antecedents: &Array2<f64>| Ok(Self::with_rules(&searched, &inputs, &outputs, antecedents)?.1);
        let most = MAX_REGRESSORS.min((REGRESSORS_PER_SAMPLE * searched.samples() as f64) as usize);
        let is_affordable = |rules: &usize| rules * (training.channels() + 1) <= most;
        let candidates: Vec<usize> = RULES.into_iter().filter(is_affordable).collect();
        let mut best = (f64::INFINITY, antecedents(1, 0));
        if let Some(pilot) = candidates
            .iter()
            .copied()
            .rfind(|&rules| (2..=PILOT_RULES).contains(&rules))
        {
            let [few, many] = COMPONENTS.map(|leading| antecedents(pilot, leading));
            let leading = COMPONENTS[usize::from(error(&many)? < error(&few)?)];
            for rules in candidates {
                let candidate = antecedents(rules, leading);
                let error = error(&candidate)?;
                if error < WORTHWHILE * best.0 {
                    best = (error, candidate);
                }
            }
        }
        Ok(Self::with_rules(&training, &inputs, &outputs, &best.1)?.0)
    }

    /// Fits the consequents of given rules; returns also the sum of the squared held-out errors of the scaled targets.
    fn with_rules(
        set: &Dataset,
        inputs: &Inputs,
        outputs: &MinMax,
        antecedents: &Array2<f64>,
    ) -> Result<(Self, f64), NetworkError> {
        let (ranges, varying) = (outputs.middles_and_half_widths(), outputs.varying());
        let (channels, rules) = (set.channels(), antecedents.ncols());
        let mut system = Self {
            quantity: inputs.quantity(),
            centre: inputs.affine().0,
            antecedents: antecedents.clone(),
            consequents: Array2::zeros((rules * (channels + 1), varying.len())),
            middles: ranges.iter().map(|range| range.0).collect(),
            values: vec![0.0; channels + 1],
            strengths: vec![0.0; rules],
            changes: vec![0.0; varying.len()],
            varying,
        };
        let mut scale = Standard::fit(set.readings(), |reading| system.quantity.of(reading))?.scale;
        scale.push(1.0);
        let regression = Regression {
            samples: set.samples(),
            features: system.consequents.nrows(),
            outputs: system.varying.len(),
            write: &|sample, regressors, targets| {
                let (mut values, mut strengths) = (vec![0.0; channels + 1], vec![0.0; rules]);
                system.fire(set.sample_readings(sample), &mut values, &mut strengths);
                for (place, regressor) in regressors.iter_mut().enumerate() {
                    let (rule, channel) = (place / (channels + 1), place % (channels + 1));
                    *regressor = strengths[rule] * values[channel] * scale[channel];
                }
                for (scaled, &target) in targets.iter_mut().zip(&system.varying) {
                    *scaled = (set.sample_targets(sample)[target] - ranges[target].0) / ranges[target].1;
                }
            },
            noise: Array2::zeros((0, system.consequents.nrows())),
        };
        let fit = regression.ridge(folds(set).as_ref())?;
        for ((place, output), consequent) in system.consequents.indexed_iter_mut() {
            let channel = place % (channels + 1);
            // Firing strengths add up to 1, so that a constant of all rules is one constant.
            let constant = if channel == channels {
                fit.map[[rules * (channels + 1), output]]
            } else {
                0.0
            };
            *consequent = (fit.map[[place, output]] * scale[channel] + constant) * ranges[system.varying[output]].1;
        }
        Ok((system, fit.squares.iter().flatten().sum()))
    }

    /// Number of rules.
    pub fn rules(&self) -> usize {
        self.strengths.len()
    }

    /// Writes the centred channels with a 1, and the normalised firing strengths. The largest logarithm is subtracted first
    /// to avoid 0/0: far from all centres, the nearest rule fires.
    fn fire(&self, readings: &[f64], values: &mut [f64], strengths: &mut [f64]) {
        for ((value, &reading), centre) in values.iter_mut().zip(readings).zip(&self.centre) {
            *value = self.quantity.of(reading) - centre;
        }
        values[readings.len()] = 1.0;
        strengths.fill(0.0);
        add_products(strengths, values, 1.0, self.antecedents.as_slice().expect(IN_ORDER));
        let largest = strengths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        strengths
            .iter_mut()
            .for_each(|strength| *strength = (*strength - largest).exp());
        let total: f64 = strengths.iter().sum();
        strengths.iter_mut().for_each(|strength| *strength /= total);
    }
}

const IN_ORDER: &str = "made in standard layout";

/// Logarithms of the memberships of `rules` rules around clusters of the `leading` of the components `x` (samples ×
/// components), at most one per sample, from centred channels: (M4 + 1) × rules, the constant last. They omit
/// −‖x‖² / 2σ², which all rules share and normalisation cancels.
fn antecedents(
    inputs: &Inputs,
    x: ArrayView2<'_, f64>,
    rules: usize,
    leading: usize,
    rng: &mut impl Rng,
) -> Array2<f64> {
    let x = x.slice_axis(Axis(1), Slice::from(..leading.min(x.ncols())));
    let centres = k_means(x, rules.clamp(1, x.nrows()), rng);
    let pairs = centres.rows().into_iter().enumerate();
    let squares = pairs.flat_map(|(i, a)| centres.rows().into_iter().take(i).map(move |b| distance2(a, b)));
    let count = (centres.nrows() * (centres.nrows() - 1) / 2).max(1);
    let width2 = RELATIVE_WIDTH * RELATIVE_WIDTH * squares.sum::<f64>() / count as f64;
    // If all centres are equal, all rules fire equally.
    let sharpness = Some(0.5 / width2)
        .filter(|sharpness| sharpness.is_finite())
        .unwrap_or(0.0);
    let to_components = inputs.affine().1;
    let slopes = to_components
        .slice_axis(Axis(0), Slice::from(..x.ncols()))
        .t()
        .dot(&centres.t());
    Array2::from_shape_fn((inputs.channels() + 1, centres.nrows()), |(channel, rule)| {
        let constant = || -sharpness * centres.row(rule).dot(&centres.row(rule));
        slopes
            .get((channel, rule))
            .map_or_else(constant, |slope| 2.0 * sharpness * slope)
    })
}

impl Decoder for TakagiSugeno {
    fn channels(&self) -> usize {
        self.centre.len()
    }

    fn outputs(&self) -> usize {
        self.middles.len()
    }

    fn decode_row(&mut self, _row_index: usize, readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        DecodeError::check_for(self.quantity, readings)?;
        let (mut values, mut strengths) = (take(&mut self.values), take(&mut self.strengths));
        self.fire(readings, &mut values, &mut strengths);
        (self.values, self.strengths) = (values, strengths);
        let consequents = self.consequents.as_slice().expect(IN_ORDER);
        self.changes.fill(0.0);
        let of_rule = self.values.len() * self.changes.len();
        for (rule, &strength) in self.strengths.iter().enumerate() {
            if strength > 0.0 {
                let consequents = &consequents[rule * of_rule..(rule + 1) * of_rule];
                add_products(&mut self.changes, &self.values, strength, consequents);
            }
        }
        targets.copy_from_slice(&self.middles);
        for (&target, &change) in self.varying.iter().zip(&self.changes) {
            // Readings 1e300 times those of the training set overflow.
            if change.is_finite() {
                targets[target] += change;
            }
        }
        Ok(())
    }

    fn description(&self) -> Result<Description, NotDescribed> {
        Err(NotDescribed::Rules)
    }
}

/// Adds `factor` · values · matrix to `sums`; the matrix is values × sums, row by row.
fn add_products(sums: &mut [f64], values: &[f64], factor: f64, matrix: &[f64]) {
    if sums.is_empty() {
        return;
    }
    for (value, row) in values.iter().zip(matrix.chunks_exact(sums.len())) {
        let value = factor * value;
        for (sum, weight) in sums.iter_mut().zip(row) {
            *sum += value * weight;
        }
    }
}

/// Means of `count` clusters of the rows of `x`, or of [`MAX_VALIDATED`] of them, with initial centres drawn from the
/// rows by `rng`.
fn k_means(x: ArrayView2<'_, f64>, count: usize, rng: &mut impl Rng) -> Array2<f64> {
    let most = MAX_VALIDATED.max(count);
    let drawn = (x.nrows() > most).then(|| x.select(Axis(0), &index::sample(rng, x.nrows(), most).into_vec()));
    let x = drawn.as_ref().map_or(x, |drawn| drawn.view());
    let mut centres = x.select(Axis(0), &index::sample(rng, x.nrows(), count).into_vec());
    for _ in 0..20 {
        let mut sums = Array2::<f64>::zeros(centres.dim());
        let mut members = vec![0.0; count];
        for row in x.rows() {
            let distances = centres.rows().into_iter().map(|centre| distance2(row, centre));
            let nearest = distances
                .enumerate()
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .map_or(0, |(c, _)| c);
            sums.row_mut(nearest).scaled_add(1.0, &row);
            members[nearest] += 1.0;
        }
        let mut moved = false;
        for ((mut centre, sum), &members) in centres.rows_mut().into_iter().zip(sums.rows()).zip(&members) {
            // A cluster without members stays where it is.
            if members > 0.0 {
                let mean = &sum / members;
                moved |= mean != centre;
                centre.assign(&mean);
            }
        }
        if !moved {
            break;
        }
    }
    centres
}

#[cfg(test)]
mod tests {
    use ndarray::array;
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        decoupling::{AffineMap, decode_set},
        scene::{Rows, Scene, standard_normal},
        sensor::SensorModel,
    };

    /// A training set and a test set of the known first row-wire, or of all of them.
    fn sets(array: &str, samples: usize, rows: Rows) -> (Dataset, Dataset) {
        let model = SensorModel::new(array.parse().unwrap());
        let scene = Scene {
            rows,
            ..Scene::default()
        };
        let draw = |samples, stream| Dataset::simulate(&model, &scene, samples, &mut Seed(0).rng(stream)).unwrap();
        (draw(samples, Stream::Training), draw(100, Stream::Test))
    }

    fn fit(set: &Dataset, quantity: Quantity) -> TakagiSugeno {
        TakagiSugeno::fit(
            set,
            quantity,
            NoiseSource::default(),
            &mut Seed(0).rng(Stream::Expectation),
        )
        .unwrap()
    }

    /// `set` with other readings and targets.
    fn with(set: &Dataset, reading: impl Fn(f64) -> f64, target: impl Fn(f64) -> f64) -> Dataset {
        let (readings, targets) = (set.readings().mapv(reading), set.targets().mapv(target));
        Dataset::new(readings, targets, None, set.groups().to_vec()).unwrap()
    }

    fn squared_error(decoder: &mut dyn Decoder, test: &Dataset) -> f64 {
        let answers = decode_set(decoder, test).unwrap();
        (&answers - &test.targets()).mapv(|error| error * error).sum()
    }

    #[test]
    fn curved_relations_are_decoded_better_than_by_ridge() {
        // Conductance is nearly affine in the depth, which leaves little to gain.
        for (rows, quantity, most) in [
            (Rows::Known, Quantity::Conductance, 2.0),
            (Rows::All, Quantity::Resistance, 0.5),
        ] {
            let (training, test) = sets("10x6_3x18", 1500, rows);
            let (training, test) = if rows == Rows::Known {
                (training.of_row(0), test.of_row(0))
            } else {
                (training, test)
            };
            let mut ridge = AffineMap::ridge(&training, quantity, NoiseSource::default()).unwrap();
            let mut fuzzy = fit(&training, quantity);
            let (ours, theirs) = (squared_error(&mut fuzzy, &test), squared_error(&mut ridge, &test));
            assert!(ours < most * theirs, "{quantity:?}: {ours} {theirs}");
        }
    }

    /// Readings and targets, one for each sample.
    fn set_of(readings: Array2<f64>, targets: Array2<f64>) -> Dataset {
        let samples = readings.nrows();
        Dataset::new(readings, targets, None, (0..samples).collect()).unwrap()
    }

    /// Logarithms of memberships of width 1 around these centres, up to a common term, from channels with this centre.
    fn around(centres: &Array2<f64>, middle: &[f64]) -> Array2<f64> {
        Array2::from_shape_fn((middle.len() + 1, centres.nrows()), |(channel, rule)| {
            let off = |channel: usize| centres[[rule, channel]] - middle[channel];
            match middle.get(channel) {
                Some(_) => off(channel),
                None => -0.5 * (0..middle.len()).map(|channel| off(channel).powi(2)).sum::<f64>(),
            }
        })
    }

    /// Whitened inputs and scaled outputs of a set.
    fn scalings(set: &Dataset) -> (Inputs, MinMax) {
        let choice = InputChoice {
            quantity: Quantity::Raw,
            scaling: ScalingChoice::Whitening,
        };
        let inputs = Inputs::fit(choice, set.readings(), NoiseSource::default()).unwrap();
        (inputs, MinMax::fit(set.targets()).unwrap())
    }

    #[test]
    fn a_system_of_two_rules_is_reproduced() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let x = Array2::from_shape_simple_fn((200, 2), || standard_normal(&mut rng));
        let centres = array![[-1.0, 0.5], [1.0, -0.5]];
        let membership = |x: f64, y: f64, rule: usize| {
            (-0.5 * ((x - centres[[rule, 0]]).powi(2) + (y - centres[[rule, 1]]).powi(2))).exp()
        };
        let truth = Array2::from_shape_fn((200, 1), |(s, _)| {
            let (a, b) = (x[[s, 0]], x[[s, 1]]);
            let (first, second) = (membership(a, b, 0), membership(a, b, 1));
            (first * (0.3 * a - 0.7 * b + 0.1) + second * (-0.2 * a + 0.4)) / (first + second)
        });
        let set = set_of(x, truth);
        let (inputs, outputs) = scalings(&set);
        let antecedents = around(&centres, &inputs.affine().0);
        let (mut system, error) = TakagiSugeno::with_rules(&set, &inputs, &outputs, &antecedents).unwrap();
        assert!(error < 1e-12, "{error}");
        assert!(squared_error(&mut system, &set) < 1e-16);
    }

    #[test]
    fn one_rule_is_the_ridge_regression() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let x = Array2::from_shape_simple_fn((500, 4), || standard_normal(&mut rng));
        let y = Array2::from_shape_fn((500, 2), |(s, t)| (x[[s, t]] + 0.3 * x[[s, 3]]).exp());
        let set = set_of(x, y);
        let (inputs, outputs) = scalings(&set);
        let (mut rule, _) = TakagiSugeno::with_rules(&set, &inputs, &outputs, &Array2::zeros((5, 1))).unwrap();
        let mut ridge = AffineMap::ridge(&set, Quantity::Raw, NoiseSource::default()).unwrap();
        let off = decode_set(&mut rule, &set).unwrap() - decode_set(&mut ridge, &set).unwrap();
        assert!(off.iter().all(|off| off.abs() < 1e-9));
    }

    #[test]
    fn an_affine_target_with_noise_has_one_rule_and_a_curved_one_several() {
        for seed in 0..5 {
            for curved in [false, true] {
                let mut rng = Seed(seed).rng(Stream::Training);
                let x = Array2::from_shape_simple_fn((300, 3), || standard_normal(&mut rng));
                let y = Array2::from_shape_fn((300, 1), |(s, _)| {
                    let affine = 0.4 * x[[s, 0]] - 0.2 * x[[s, 2]] + 0.1;
                    let bend = if curved { (2.0 * x[[s, 1]]).sin() } else { 0.0 };
                    affine + bend + 0.05 * standard_normal(&mut rng)
                });
                let rules = fit(&set_of(x, y), Quantity::Raw).rules();
                assert!(
                    if curved { rules > 2 } else { rules == 1 },
                    "{curved}, seed {seed}: {rules}"
                );
            }
        }
    }

    #[test]
    fn far_from_all_centres_the_nearest_rule_fires() {
        let set = set_of(array![[0.0, 1.0], [2.0, -3.0], [1.0, 0.5]], array![[1.0], [2.0], [4.0]]);
        let (inputs, outputs) = scalings(&set);
        let middle = inputs.affine().0;
        let antecedents = around(&array![[0.0, 0.0], [20.0, 0.0]], &middle);
        let system = TakagiSugeno::with_rules(&set, &inputs, &outputs, &antecedents)
            .unwrap()
            .0;
        // Both memberships are 0 in double precision.
        for (at, expected) in [(1e3, [0.0, 1.0]), (1e8, [0.0, 1.0]), (-1e8, [1.0, 0.0])] {
            let (mut values, mut strengths) = ([0.0; 3], [0.0; 2]);
            system.fire(&[at, 7.0], &mut values, &mut strengths);
            assert_eq!(strengths, expected);
        }
    }

    #[test]
    fn clusters_are_found() {
        let x = array![[0.0, 0.1], [0.1, 0.0], [0.0, 0.0], [5.0, 5.1], [5.1, 5.0], [5.0, 5.0]];
        for seed in 0..5 {
            let mut centres = k_means(x.view(), 2, &mut Seed(seed).rng(Stream::Start));
            if centres[[0, 0]] > centres[[1, 0]] {
                centres.invert_axis(Axis(0));
            }
            assert!((centres[[0, 0]] - 0.1 / 3.0).abs() < 1e-12 && (centres[[1, 1]] - 15.1 / 3.0).abs() < 1e-12);
        }
    }

    #[test]
    fn extreme_sets_give_finite_answers() {
        let (usual, _) = sets("1x4_2x12", 40, Rows::All);
        let one = usual.select(&[0]);
        let duplicates = usual.select(&[0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1]);
        let two_hundred: Vec<usize> = (0..200).map(|sample| sample % 3).collect();
        let many_duplicates = usual.select(&two_hundred);
        let constant_targets = with(&usual, |ohm| ohm, |_| 3.0);
        let constant_inputs = with(&usual, |_| 100.0, |mm| mm);
        let scaled = |factor: f64| with(&usual, |ohm| ohm, |mm| factor * mm);
        let cases = [
            ("one sample", one, 1.0),
            ("duplicates", duplicates, 1.0),
            ("three samples many times", many_duplicates, 1.0),
            ("constant targets", constant_targets, 1.0),
            ("constant inputs", constant_inputs, 1.0),
            ("tiny targets", scaled(1e-6), 1e-6),
            ("huge targets", scaled(1e6), 1e6),
        ];
        for (name, set, size) in cases {
            let mut decoder = fit(&set, Quantity::Conductance);
            let mut answer = [f64::NAN; 12];
            for sample in 0..set.samples() {
                decoder.decode_row(0, set.sample_readings(sample), &mut answer).unwrap();
                assert!(
                    answer.iter().all(|value| value.abs() < 100.0 * size),
                    "{name}: {answer:?}"
                );
            }
            for far in [1e-308, 1e-3, 1e9, 1e308] {
                decoder.decode_row(0, &[far; 12], &mut answer).unwrap();
                assert!(
                    answer.iter().all(|value| value.is_finite()),
                    "{name}, {far} ohm: {answer:?}"
                );
            }
        }
    }

    #[test]
    fn unscalable_sets_are_refused() {
        let (set, _) = sets("1x4_2x12", 5, Rows::All);
        let mut targets = set.targets().to_owned();
        targets[[3, 2]] = f64::NAN;
        let set = Dataset::new(set.readings().to_owned(), targets, None, set.groups().to_vec()).unwrap();
        let mut rng = Seed(0).rng(Stream::Expectation);
        let error = TakagiSugeno::fit(&set, Quantity::Conductance, NoiseSource::default(), &mut rng).unwrap_err();
        assert!(
            matches!(
                error,
                NetworkError::NotFinite {
                    sample: 3,
                    channel: 2,
                    ..
                }
            ),
            "{error}"
        );
        let none = set.select(&[]);
        let error = TakagiSugeno::fit(&none, Quantity::Conductance, NoiseSource::default(), &mut rng).unwrap_err();
        assert_eq!(error, NetworkError::Empty);
    }

    #[test]
    fn a_seed_gives_the_same_rules() {
        let (training, test) = sets("10x6_3x18", 600, Rows::All);
        let (mut first, mut second) = (
            fit(&training, Quantity::Resistance),
            fit(&training, Quantity::Resistance),
        );
        assert!(first.rules() > 1);
        assert_eq!(squared_error(&mut first, &test), squared_error(&mut second, &test));
    }
}
