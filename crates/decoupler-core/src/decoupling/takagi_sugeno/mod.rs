//! Fuzzy rules with affine consequents.

mod consequents;
mod selection;

use ndarray::{Array2, Axis};
use rand::Rng;

use super::{
    Precision,
    affine_map::LinearFit,
    program::{Builder, Program},
    units::{Units, with_noise},
};
use crate::{
    dataset::Dataset,
    network::{InputChoice, Inputs, MinMax, Quantity, ScalingChoice, ScalingError},
    scene::NoiseSource,
};
use selection::Antecedents;

impl Program {
    /// Fits a fuzzy system of Takagi and Sugeno (1985): rules "if the readings x are near centre i, then the coordinates are
    /// Cᵢ·x + dᵢ", blended by their normalised firing strengths. On this quantity of the readings, whitened; `unseen` is as
    /// in [`Inputs::fit`]; `rng` draws the noise, the folds of the cross-validation and the initial cluster centres.
    ///
    /// The antecedents are Gaussian memberships on whitened readings, centred on clusters of the training samples; the
    /// consequents of all rules are fitted together by least squares with a small ridge penalty. Cross-validation chooses
    /// the number of rules, the number of inputs of their memberships, and the penalty of each target.
    ///
    /// In 30 dimensions distances hardly differ, so memberships use only the leading 3 or 10 principal components, with a
    /// width four times the distance between centres. Measured on the simulated 10×10_5×30 array with 12 rules, the
    /// held-out error of a known row-wire is 0.011 % with 10 components, 0.026 % with 15, and 0.040 % with 30 or 3, and
    /// that of one map for all row-wires 0.45 % with 3 components and 0.71 % with 11; narrower memberships were never
    /// clearly better.
    ///
    /// # Errors
    /// If values cannot be scaled.
    pub fn fuzzy(
        training: &Dataset,
        quantity: Quantity,
        unseen: NoiseSource,
        rng: &mut impl Rng,
    ) -> Result<Self, ScalingError> {
        let scaling = ScalingChoice::Whitening;
        let training = with_noise(training, unseen, rng);
        let inputs = Inputs::fit_all(InputChoice { quantity, scaling }, training.readings())?;
        let outputs = MinMax::fit(training.targets())?;
        let y = outputs.scale(training.targets());
        let units = Units::of(&training, inputs.of(training.readings()), y);
        let none = Array2::zeros((0, inputs.count()));
        let noise = LinearFit::new(&inputs, units.clone(), none.view())?.variances();
        let choice = selection::choose(&units, &noise, rng);
        let scaled = consequents::fit_consequents(&choice.antecedents, &units, &choice.penalties, &noise)?;
        Ok(Self::of_rules(&inputs, &choice.antecedents, &scaled, &outputs))
    }

    /// The rules with the whitening folded in.
    fn of_rules(inputs: &Inputs, antecedents: &Antecedents, scaled: &Array2<f64>, outputs: &MinMax) -> Self {
        let double = Precision::Double;
        let (centre, to_inputs) = inputs.affine();
        let n = inputs.count();
        let (slopes, offsets) = antecedents.logarithms(n);
        let mut weights = Array2::zeros((centre.len(), 0));
        let mut biases = Vec::new();
        for of_rule in scaled.axis_chunks_iter(Axis(0), n + 1) {
            let (gains, constants) = of_rule.split_at(Axis(0), n);
            let gains = to_inputs.t().dot(&gains);
            weights.append(Axis(1), gains.view()).expect("one row for each channel");
            biases.extend(constants.row(0));
        }
        let mut builder = Builder::new(centre.len());
        let changes = builder.changes(inputs.quantity(), &centre, double);
        let to_logits = slopes.dot(&to_inputs).reversed_axes();
        // A row-wire with fewer rules than another one has copies that never fire.
        let logits = builder.affine_padded(&changes, to_logits, &offsets.to_vec(), f64::MIN);
        let vectors = builder.affine_of(&changes, weights, &biases);
        let blended = builder.blend(logits, vectors);
        let targets = builder.restored(blended, outputs);
        builder.finish(targets)
    }
}

#[cfg(test)]
mod tests {
    use super::{consequents::Penalty, *};
    use crate::{
        dataset::{Seed, Stream},
        decoupling::{Decoder, ProgramDecoder, decode_set},
        scene::{Noise, Rows, Scene},
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
    fn it_is_better_than_ridge_on_new_samples() {
        // Conductance is nearly affine in the depth, which leaves little to gain.
        for (rows, quantity, most) in [
            (Rows::Known, Quantity::Conductance, 1.0),
            (Rows::All, Quantity::Resistance, 0.5),
        ] {
            let (training, test) = sets("10x6_3x18", 1500, rows);
            let (training, test) = if rows == Rows::Known {
                (training.of_row(0), test.of_row(0))
            } else {
                (training, test)
            };
            let choice = InputChoice {
                quantity,
                ..InputChoice::BEST
            };
            let ridge = Program::ridge(&training, choice, NoiseSource::default()).unwrap();
            let mut ridge = ProgramDecoder::new(ridge);
            let mut fuzzy = fit(&training, quantity);
            let (ours, theirs) = (squared_error(&mut fuzzy, &test), squared_error(&mut ridge, &test));
            assert!(ours < most * theirs, "{quantity:?}: {ours} {theirs}");
        }
    }

    #[test]
    fn folded_rules_match_scaled_ones() {
        let (training, test) = sets("10x6_3x18", 600, Rows::All);
        let scaling = ScalingChoice::Whitening;
        let choice = InputChoice {
            quantity: Quantity::LogResistance,
            scaling,
        };
        let model = SensorModel::new("10x6_3x18".parse().unwrap());
        // Without noise, components of 1e-12 of the first would multiply rounding.
        let noise = Noise::relative(1e-4).source(&model).unwrap();
        let inputs = Inputs::fit(choice, training.readings(), noise).unwrap();
        let outputs = MinMax::fit(training.targets()).unwrap();
        let x = inputs.of(training.readings());
        let y = outputs.scale(training.targets());
        let mut rng = Seed(0).rng(Stream::Expectation);
        let (centres, distance) = Antecedents::clusters(x.view(), 3, 8, &mut rng);
        let antecedents = Antecedents::new(centres, distance);
        let units = Units {
            weights: vec![1.0; x.nrows()],
            x,
            y,
        };
        let penalty = Penalty {
            ridge: 1e-6,
            is_noisy: false,
        };
        let outputs_count = units.y.ncols();
        let scaled = consequents::fit_consequents(&antecedents, &units, &vec![penalty; outputs_count], &[]).unwrap();
        let mut folded = ProgramDecoder::new(Program::of_rules(&inputs, &antecedents, &scaled, &outputs));
        // Rule by rule in the scaled inputs and targets.
        let x = inputs.of(test.readings());
        let strengths = antecedents.firing_strengths(x.view());
        let expected = Array2::from_shape_fn((test.samples(), outputs_count), |(s, t)| {
            let affine = |rule: usize| {
                let of_input = |k: usize| if k < x.ncols() { x[[s, k]] } else { 1.0 };
                let term = |k: usize| scaled[[rule * (x.ncols() + 1) + k, t]] * of_input(k);
                (0..=x.ncols()).map(term).sum::<f64>()
            };
            (0..8).map(|rule| strengths[[s, rule]] * affine(rule)).sum()
        });
        let expected = outputs.restore(expected.view());
        let mut answer = [0.0; 18];
        for (sample, expected) in expected.rows().into_iter().enumerate() {
            folded.decode_row(0, test.sample_readings(sample), &mut answer).unwrap();
            for (ours, expected) in answer.iter().zip(expected) {
                assert!((ours - expected).abs() < 1e-9, "{ours} {expected}");
            }
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
    fn the_number_of_rules_is_limited_by_the_samples() {
        let (set, _) = sets("1x4_2x12", 5, Rows::All);
        let x = set.readings();
        let mut rng = Seed(0).rng(Stream::Expectation);
        let (centres, distance) = Antecedents::clusters(x.view(), 10, 16, &mut rng);
        assert_eq!(centres.dim(), (5, 10));
        let antecedents = Antecedents::new(centres, distance);
        let units = Units {
            x: x.to_owned(),
            y: x.to_owned(),
            weights: vec![1.0; 5],
        };
        let penalty = Penalty {
            ridge: 0.0,
            is_noisy: false,
        };
        let consequents = consequents::fit_consequents(&antecedents, &units, &[penalty; 12], &[]).unwrap();
        assert!(consequents.iter().all(|value| value.is_finite()));
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
                ScalingError::NotFinite {
                    sample: 3,
                    channel: 2,
                    ..
                }
            ),
            "{error}"
        );
        let none = set.select(&[]);
        let error = Program::fuzzy(&none, Quantity::Conductance, NoiseSource::default(), &mut rng).unwrap_err();
        assert_eq!(error, ScalingError::Empty);
    }

    #[test]
    fn a_seed_gives_the_same_rules() {
        let (training, test) = sets("10x6_3x18", 600, Rows::All);
        let (mut first, mut second) = (
            fit(&training, Quantity::Resistance),
            fit(&training, Quantity::Resistance),
        );
        assert_eq!(squared_error(&mut first, &test), squared_error(&mut second, &test));
    }
}
