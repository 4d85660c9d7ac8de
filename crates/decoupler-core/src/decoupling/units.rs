use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
};

use ndarray::{Array2, ArrayView1, ArrayView2, Axis};
use rand::Rng;

use crate::{dataset::Dataset, scene::NoiseSource};

/// Training samples grouped into units, each of which is left out as a whole when a fit is validated.
///
/// A unit is a sample with its copies, which all have the same readings and targets. It counts as often as it occurs,
/// but a copy that is trained on while another is held out would make the validation optimistic. Equal samples are
/// copies
///
/// - if they follow each other, as in a recording that holds its values between two conversions;
/// - anywhere, if a channel identifies the samples, as a measurement with many digits does.
///
/// Other equal samples of coarse channels are not copies: that two of a thousand readings of a switch agree is
/// expected by chance, and each is independent evidence.
#[derive(Clone)]
pub(super) struct Units {
    /// Inputs: units × inputs.
    pub x: Array2<f64>,
    /// Outputs: units × outputs.
    pub y: Array2<f64>,
    /// Number of samples in each unit.
    pub weights: Vec<f64>,
}

impl Units {
    /// Minimum number of units that are left out in turn: with fewer, the rest represents the set badly, and samples
    /// are left out one by one.
    const MIN_UNITS: usize = 10;
    /// Minimum ratio of distinct values of an identifying channel to distinct samples.
    const IDENTIFYING: f64 = 0.9;

    /// Gathers the samples of `training`, whose inputs are `x` (samples × inputs) and outputs `y` (samples × outputs).
    pub fn of(training: &Dataset, x: Array2<f64>, y: Array2<f64>) -> Self {
        let Some(members) = Self::members(training.readings(), training.targets()) else {
            return Self {
                weights: vec![1.0; x.nrows()],
                x,
                y,
            };
        };
        let first: Vec<usize> = members.iter().map(|samples| samples[0]).collect();
        Self {
            x: x.select(Axis(0), &first),
            y: y.select(Axis(0), &first),
            weights: members.iter().map(|samples| samples.len() as f64).collect(),
        }
    }

    /// Samples of each unit, in order of first occurrence; `None` if each sample is a unit.
    fn members(readings: ArrayView2<'_, f64>, targets: ArrayView2<'_, f64>) -> Option<Vec<Vec<usize>>> {
        let samples = readings.nrows();
        let key = |sample: usize| bits(readings.row(sample)).chain(bits(targets.row(sample)));
        // Sorted rather than hashed: the keys would take more memory than the samples.
        let mut order: Vec<usize> = (0..samples).collect();
        order.sort_by(|&one, &other| key(one).cmp(key(other)));
        // For each sample, the index of the first equal one.
        let (mut first, mut distinct) = (vec![0; samples], 0);
        for equal in order.chunk_by(|&one, &other| key(one).eq(key(other))) {
            equal.iter().for_each(|&sample| first[sample] = equal[0]);
            distinct += 1;
        }
        if distinct == samples {
            return None;
        }
        let mut units: Vec<Vec<usize>> = Vec::new();
        if distinct >= Self::MIN_UNITS && Self::is_identified(readings, distinct) {
            let mut unit_of = HashMap::new();
            for (sample, first) in first.into_iter().enumerate() {
                let unit = *unit_of.entry(first).or_insert(units.len());
                if unit == units.len() {
                    units.push(Vec::new());
                }
                units[unit].push(sample);
            }
        } else {
            let order: Vec<usize> = (0..samples).collect();
            let runs = order.chunk_by(|&one, &next| first[one] == first[next]);
            units.extend(runs.map(<[usize]>::to_vec));
        }
        (units.len() >= Self::MIN_UNITS && units.len() < samples).then_some(units)
    }

    /// Returns `true` if a channel has nearly as many distinct values as there are `distinct` samples.
    fn is_identified(readings: ArrayView2<'_, f64>, distinct: usize) -> bool {
        let enough = Self::IDENTIFYING * distinct as f64;
        let values = |channel: ArrayView1<'_, f64>| bits(channel).collect::<HashSet<_>>().len();
        let mut channels = readings.columns().into_iter();
        channels.any(|channel| values(channel) as f64 >= enough)
    }
}

/// Bits of the values, which are the same for both zeros.
fn bits(values: ArrayView1<'_, f64>) -> impl Iterator<Item = u64> {
    values.into_iter().map(|value| (value + 0.0).to_bits())
}

/// Returns `training` with the noise that its readings lack: a nonlinear map learns the effect of noise from samples.
pub(super) fn with_noise<'a>(training: &'a Dataset, unseen: NoiseSource, rng: &mut impl Rng) -> Cow<'a, Dataset> {
    let mut training = Cow::Borrowed(training);
    if !unseen.is_none() {
        training.to_mut().disturb_by(unseen, rng);
    }
    training
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Slice, array, concatenate};
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use serde::Deserialize;

    use crate::{
        dataset::{Seed, Stream},
        decoupling::{Decoder, Program, ProgramDecoder, decode_set},
        network::{InputChoice, Quantity},
        scene::standard_normal,
    };

    /// A case of `tests/fixtures/repeated_samples.py`.
    #[derive(Deserialize)]
    struct Case {
        name: String,
        x: Vec<Vec<f64>>,
        y: Vec<f64>,
        r2_ridge: f64,
        r2_kernel_ridge: f64,
    }

    fn set_of(readings: Array2<f64>, targets: Array2<f64>) -> Dataset {
        let samples = readings.nrows();
        Dataset::new(readings, targets, None, (0..samples).collect()).unwrap()
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
            let set = set_of(readings, Array2::from_shape_fn((y.len(), 1), |(s, _)| y[s]));
            let fitted = 4 * y.len() / 5;
            let part = |samples: std::ops::Range<usize>| set.select(&samples.collect::<Vec<_>>());
            let (training, test) = (part(0..fitted), part(fitted..y.len()));
            let (choice, none) = (InputChoice::MEASURED, NoiseSource::default());
            let ridge = r2(
                &mut ProgramDecoder::new(Program::ridge(&training, choice, none).unwrap()),
                &test,
            );
            assert!((ridge - r2_ridge).abs() < 2e-3, "{name}: ridge {ridge}, {r2_ridge}");
            let mut rng = Seed(0).rng(Stream::Expectation);
            let basis = Program::radial_basis(&training, choice, none, &mut rng).unwrap();
            let mut basis = ProgramDecoder::new(basis);
            let fuzzy = Program::fuzzy(&training, Quantity::Raw, none, &mut rng).unwrap();
            let mut fuzzy = ProgramDecoder::new(fuzzy);
            for (decoder, ours) in [("basis", r2(&mut basis, &test)), ("fuzzy", r2(&mut fuzzy, &test))] {
                assert!(
                    (ours - r2_kernel_ridge).abs() < 0.02,
                    "{name}: {decoder} {ours}, {r2_kernel_ridge}"
                );
            }
        }
    }

    /// Copies of all samples add no information, wherever they are: the map is that of the samples themselves.
    #[test]
    fn copies_of_exact_samples_do_not_leak_into_the_choice_of_the_penalty() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let readings = Array2::from_shape_simple_fn((25, 18), || standard_normal(&mut rng));
        let targets = Array2::from_shape_fn((25, 1), |(s, _)| readings[[s, 0]] + standard_normal(&mut rng));
        let map = |order: Vec<usize>| {
            let set = set_of(readings.select(Axis(0), &order), targets.select(Axis(0), &order));
            ProgramDecoder::new(Program::ridge(&set, InputChoice::MEASURED, NoiseSource::default()).unwrap())
        };
        let new = Array2::from_shape_simple_fn((40, 18), || standard_normal(&mut rng));
        let test = set_of(new, Array2::zeros((40, 1)));
        let once = decode_set(&mut map((0..25).collect()), &test).unwrap();
        assert!(once.iter().all(|answer| answer.abs() < 3.0), "no overfitting");
        for order in [(0..250).map(|s| s / 10).collect(), (0..250).map(|s| s % 25).collect()] {
            let often = decode_set(&mut map(order), &test).unwrap();
            assert!(
                (&often - &once).iter().all(|error| error.abs() < 1e-6),
                "{often} {once}"
            );
        }
    }

    /// The second target is pure noise: the penalty that suits the first would overfit it.
    #[test]
    fn each_target_is_decoded_as_well_as_alone() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let mut draw = |samples| {
            let readings = Array2::from_shape_simple_fn((samples, 20), || standard_normal(&mut rng));
            let exact = readings.select(Axis(1), &[0]);
            let noise = Array2::from_shape_simple_fn((samples, 1), || standard_normal(&mut rng));
            set_of(readings, concatenate![Axis(1), exact, noise])
        };
        let (training, test) = (draw(40), draw(500));
        let map = Program::ridge(&training, InputChoice::MEASURED, NoiseSource::default()).unwrap();
        let mut map = ProgramDecoder::new(map);
        let squares = (decode_set(&mut map, &test).unwrap() - test.targets()).mapv(|error| error * error);
        let mse = squares.mean_axis(Axis(0)).unwrap();
        let first = test.targets().slice_axis(Axis(1), Slice::from(..1)).var(0.0);
        assert!(mse[0] < 1e-6 * first, "{mse}");
        assert!(mse[1] < 1.3, "{mse}");
    }

    /// Sizes of the units of samples with these readings and targets.
    fn sizes(samples: usize, reading: impl Fn(usize) -> [f64; 2], target: impl Fn(usize) -> f64) -> Vec<f64> {
        let readings = Array2::from_shape_fn((samples, 2), |(sample, channel)| reading(sample)[channel]);
        let targets = Array2::from_shape_fn((samples, 1), |(sample, _)| target(sample));
        Units::of(&set_of(readings.clone(), targets.clone()), readings, targets).weights
    }

    fn irrational(sample: usize) -> f64 {
        (0.7 * sample as f64).sin()
    }

    #[test]
    fn held_readings_and_copies_of_exact_ones_are_units_and_equal_coarse_ones_are_not() {
        // Held for five frames, also with few distinct values.
        assert_eq!(
            sizes(100, |s| [irrational(s / 5), 1.0], |s| irrational(s / 5)),
            vec![5.0; 20]
        );
        assert_eq!(sizes(100, |s| [(s / 5 % 2) as f64, 1.0], |_| 3.0), vec![5.0; 20]);
        // A target that keeps changing is independent evidence.
        assert_eq!(sizes(100, |s| [irrational(s / 5), 1.0], |s| s as f64), vec![1.0; 100]);
        // The same 20 samples, repeated 5 times.
        assert_eq!(
            sizes(100, |s| [irrational(s % 20), 1.0], |s| (s % 20) as f64),
            vec![5.0; 20]
        );
        // Two switches that alternate.
        let coarse = |s: usize| [(s % 2) as f64, (s / 3 % 2) as f64];
        assert!(sizes(100, coarse, |s| (s % 2) as f64).len() > 80);
        // Samples of a table in order, with few distinct values.
        assert_eq!(sizes(60, |s| [(s / 30) as f64, 0.0], |s| (s % 7) as f64), vec![1.0; 60]);
        // No equal samples.
        assert_eq!(sizes(30, |s| [irrational(s), 1.0], |_| 2.0), vec![1.0; 30]);
    }

    #[test]
    fn a_unit_has_the_readings_and_targets_of_its_samples() {
        let readings = Array2::from_shape_fn((24, 1), |(s, _)| if s / 2 % 2 == 0 { 0.0 } else { 1.0 + s as f64 });
        let targets = Array2::from_shape_fn((24, 1), |(s, _)| (s / 2) as f64);
        let units = Units::of(&set_of(readings.clone(), targets.clone()), readings, targets);
        assert_eq!(units.weights[..3], [2.0, 1.0, 1.0]);
        assert_eq!(
            units.y.column(0).iter().take(3).copied().collect::<Vec<_>>(),
            [0.0, 1.0, 1.0]
        );
        assert_eq!(
            units.x.column(0).iter().take(3).copied().collect::<Vec<_>>(),
            [0.0, 3.0, 4.0]
        );
    }

    #[test]
    fn both_zeros_are_equal() {
        assert!(bits(array![0.0, -0.0].view()).eq([0, 0]));
    }
}
