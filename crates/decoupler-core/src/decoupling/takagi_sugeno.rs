//! Fuzzy rules with affine consequents.

use ndarray::{Array1, Array2, ArrayView2, Axis, Slice};
use rand::{Rng, seq::index};

use super::{
    Precision,
    program::{Builder, Program},
    radial_basis::{distance2, thinned, with_noise},
    ridge::Regression,
    standardised::{Standard, folds},
};
use crate::{
    dataset::Dataset,
    network::{InputChoice, Inputs, MinMax, NetworkError, Quantity, ScalingChoice},
    scene::NoiseSource,
};

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

impl Program {
    /// Fits a fuzzy system of Takagi and Sugeno (1985): rules "if the readings x are near centre i, then the coordinates are
    /// Cᵢ·x + dᵢ", blended by their normalised firing strengths. On this quantity of the readings; `unseen` is as in
    /// [`Inputs::fit`]; `rng` draws the noise and the initial cluster centres.
    ///
    /// The antecedents are Gaussian memberships on the leading principal components of the readings, centred on clusters of
    /// the training samples, with a width four times the distance between centres. The consequents of all rules are one
    /// ridge regression on the standardised readings times the firing strengths. Cross-validation chooses the number of
    /// rules, the number of components, and the penalty of each target.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn fuzzy(
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
        let error =
            |antecedents: &Array2<f64>| with_rules(&searched, &inputs, &outputs, antecedents).map(|fitted| fitted.1);
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
        Ok(with_rules(&training, &inputs, &outputs, &best.1)?.0)
    }
}

/// Fits the consequents of given rules; returns also the sum of the squared held-out errors of the scaled targets.
fn with_rules(
    set: &Dataset,
    inputs: &Inputs,
    outputs: &MinMax,
    antecedents: &Array2<f64>,
) -> Result<(Program, f64), NetworkError> {
    let (ranges, varying) = (outputs.middles_and_half_widths(), outputs.varying());
    let (channels, rules) = (set.channels(), antecedents.ncols());
    let (quantity, centre) = (inputs.quantity(), inputs.affine().0);
    let mut scale = Standard::fit(set.readings(), |reading| quantity.of(reading))?.scale;
    scale.push(1.0);
    let features = rules * (channels + 1);
    let regression = Regression {
        samples: set.samples(),
        features,
        outputs: varying.len(),
        write: &|sample, regressors, targets| {
            let values = set.sample_readings(sample).iter().zip(&centre);
            let values = values.map(|(&reading, centre)| quantity.of(reading) - centre);
            let values = Array1::from_iter(values.chain([1.0]));
            let strengths = normalised(values.dot(antecedents));
            for (place, regressor) in regressors.iter_mut().enumerate() {
                let (rule, channel) = (place / (channels + 1), place % (channels + 1));
                *regressor = strengths[rule] * values[channel] * scale[channel];
            }
            for (scaled, &target) in targets.iter_mut().zip(&varying) {
                *scaled = (set.sample_targets(sample)[target] - ranges[target].0) / ranges[target].1;
            }
        },
        noise: Array2::zeros((0, features)),
    };
    let fit = regression.ridge(folds(set).as_ref())?;
    let mut builder = Builder::new(channels);
    let changes = builder.changes(quantity, &centre, Precision::Double);
    let (to_logits, logits) = antecedents.view().split_at(Axis(0), channels);
    // A row-wire with fewer rules than another one has copies that never fire.
    let logits = builder.affine_padded(&changes, to_logits.to_owned(), &logits.row(0).to_vec(), f64::MIN);
    let place = |rule: usize, channel: usize| rule * (channels + 1) + channel;
    let weight = |(channel, column): (usize, usize)| {
        let (rule, output) = (column / varying.len(), column % varying.len());
        fit.map[[place(rule, channel), output]] * scale[channel]
    };
    // Firing strengths add up to 1, so that a constant of all rules is one constant.
    let constant = |column: usize| {
        let (rule, output) = (column / varying.len(), column % varying.len());
        fit.map[[place(rule, channels), output]] + fit.map[[features, output]]
    };
    let columns = rules * varying.len();
    let weights = Array2::from_shape_fn((channels, columns), weight);
    let vectors = builder.affine_of(&changes, weights, &Vec::from_iter((0..columns).map(constant)));
    let blended = builder.blend(logits, vectors);
    let targets = builder.restored(blended, outputs);
    Ok((builder.finish(targets), fit.squares.iter().flatten().sum()))
}

/// Normalised firing strengths. The largest logarithm is subtracted first to avoid 0/0: far from all centres, the nearest
/// rule fires.
fn normalised(logarithms: Array1<f64>) -> Array1<f64> {
    let largest = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let strengths = logarithms.mapv(|logarithm| (logarithm - largest).exp());
    let total = strengths.sum();
    strengths / total
}

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
        decoupling::{Decoder, Operation, ProgramDecoder, decode_set},
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

    fn fit(set: &Dataset, quantity: Quantity) -> ProgramDecoder {
        let mut rng = Seed(0).rng(Stream::Expectation);
        ProgramDecoder::new(Program::fuzzy(set, quantity, NoiseSource::default(), &mut rng).unwrap())
    }

    fn rules(system: &ProgramDecoder) -> usize {
        let program = system.program();
        let logits = program.nodes().iter().find_map(|node| match node.operation {
            Operation::Blend { logits, .. } => Some(logits),
            _ => None,
        });
        program.node(logits.unwrap()).size
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
            let ridge = Program::ridge(&training, quantity, NoiseSource::default()).unwrap();
            let mut ridge = ProgramDecoder::new(ridge);
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
        let (system, error) = with_rules(&set, &inputs, &outputs, &antecedents).unwrap();
        let mut system = ProgramDecoder::new(system);
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
        let rule = with_rules(&set, &inputs, &outputs, &Array2::zeros((5, 1))).unwrap().0;
        let mut rule = ProgramDecoder::new(rule);
        let ridge = Program::ridge(&set, Quantity::Raw, NoiseSource::default()).unwrap();
        let mut ridge = ProgramDecoder::new(ridge);
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
                let rules = rules(&fit(&set_of(x, y), Quantity::Raw));
                assert!(
                    if curved { rules > 2 } else { rules == 1 },
                    "{curved}, seed {seed}: {rules}"
                );
            }
        }
    }

    #[test]
    fn far_from_all_centres_the_nearest_rule_fires() {
        // Both memberships are 0 in double precision.
        for (logarithms, expected) in [([-1e5, -9e4], [0.0, 1.0]), ([-1e300, -2e300], [1.0, 0.0])] {
            assert_eq!(normalised(Array1::from_iter(logarithms)).to_vec(), expected);
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
        let error = Program::fuzzy(&set, Quantity::Conductance, NoiseSource::default(), &mut rng).unwrap_err();
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
        let error = Program::fuzzy(&none, Quantity::Conductance, NoiseSource::default(), &mut rng).unwrap_err();
        assert_eq!(error, NetworkError::Empty);
    }

    #[test]
    fn a_seed_gives_the_same_rules() {
        let (training, test) = sets("10x6_3x18", 600, Rows::All);
        let (mut first, mut second) = (
            fit(&training, Quantity::Resistance),
            fit(&training, Quantity::Resistance),
        );
        assert!(rules(&first) > 1);
        assert_eq!(squared_error(&mut first, &test), squared_error(&mut second, &test));
    }
}
