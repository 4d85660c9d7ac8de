use ndarray::{ArrayView1, ArrayView2, Axis};
use serde::Serialize;

use crate::{
    dataset::{Dataset, SplitBy},
    evaluation::{
        TargetErrors,
        errors::{extremes, mean},
    },
    numerics::means_differ,
    text::format_number,
};

/// Errors of decoded values while a target rises (loading) and while it falls (unloading), and the hysteresis that is
/// left in them.
///
/// Loading and unloading are the rising and falling excursions of the target between turning points. A turning point
/// counts if the target then reverses by at least 10 % of its range, so that noise and jitter do not; this needs no
/// clock. Samples within 2 % of the range of a turning point are at rest there and are left out.
///
/// Excursions of fewer than 5 samples off rest do not count: if most are that short, as with presses in random order, there
/// is no loading and unloading to compare.
///
/// Each excursion is divided into levels of the target. The branches are the mean decoded values at each level while
/// loading and while unloading, and the hysteresis is the largest difference of the branches in percent of the target's
/// range. Noise of the decoded values with standard deviation s adds up to about 2·s/√n with n samples on a level, so there
/// is no loop unless the mean errors of the loading and unloading excursions differ significantly (Student's t, 95 %).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HysteresisLoop {
    /// Errors while loading.
    pub loading: TargetErrors,
    /// Errors while unloading.
    pub unloading: TargetErrors,
    /// Number of samples in [`Self::loading`] and [`Self::unloading`].
    pub samples: [usize; 2],
    /// Largest difference of the branches, in percent of the range of the target.
    pub percent_of_range: f64,
    /// Branches at increasing levels, where both have enough samples: the middle of the level, and the mean decoded values
    /// while loading and while unloading, at the middle.
    pub levels: Vec<[f64; 3]>,
}

/// Samples of each loading and of each unloading excursion, off its turning points.
type Passages = [Vec<Vec<usize>>; 2];

impl HysteresisLoop {
    /// Reversal that makes a turning point, relative to the range.
    const REVERSAL: f64 = 0.1;
    /// Distance to a turning point that counts as rest, relative to the range.
    const REST: f64 = 0.02;
    /// Number of levels.
    const LEVELS: usize = 20;
    /// Minimum number of samples of each branch on a level, and minimum number of such levels.
    const MIN_SAMPLES: usize = 3;
    const MIN_LEVELS: usize = 5;
    /// Minimum number of samples of an excursion, off rest.
    const MIN_PASSAGE: usize = 5;
    /// Minimum hysteresis in percent of the range, above which it is more than rounding.
    const MIN_PERCENT: f64 = 0.05;

    /// Measures `answers` (samples × outputs) to a test set that was divided by `by`, target by target: its groups are the
    /// stretches in order of time, or all of it by time. `None` for a target that does not rise and fall through enough
    /// levels, or whose branches do not differ significantly, and for all targets if samples were drawn at random, which
    /// loses their order in time.
    ///
    /// # Panics
    /// If the shapes differ.
    pub fn of_test(test: &Dataset, answers: ArrayView2<'_, f64>, by: SplitBy) -> Vec<Option<Self>> {
        let targets = test.targets();
        assert_eq!(targets.dim(), answers.dim());
        let stretches = match by {
            SplitBy::Time => vec![0; test.samples()],
            SplitBy::Group => test.groups().to_vec(),
            SplitBy::Random => return vec![None; test.outputs()],
        };
        let pairs = targets.columns().into_iter().zip(answers.columns());
        pairs
            .map(|(targets, answers)| Self::of_one(targets, answers, &stretches))
            .collect()
    }

    /// Measures the answers for one target; the samples of each stretch have the same number in `stretches`.
    fn of_one(actual: ArrayView1<'_, f64>, decoded: ArrayView1<'_, f64>, stretches: &[usize]) -> Option<Self> {
        let (lowest, highest) = extremes(actual);
        let range = highest - lowest;
        if !(range > 0.0 && range.is_finite()) {
            return None;
        }
        let samples = Vec::from_iter(0..actual.len());
        let mut passages = Passages::default();
        for stretch in samples.chunk_by(|&one, &next| stretches[one] == stretches[next]) {
            add_passages(&mut passages, actual, stretch, range);
        }
        let excursions = passages.iter().flatten().count();
        for branch in &mut passages {
            branch.retain(|samples| samples.len() >= Self::MIN_PASSAGE);
        }
        if 2 * passages.iter().flatten().count() < excursions {
            return None;
        }
        let error = &decoded - &actual;
        let level_of = |sample: usize| {
            let level = ((actual[sample] - lowest) / range * Self::LEVELS as f64) as usize;
            level.min(Self::LEVELS - 1)
        };
        // Mean error of each branch at each level, which does not depend on where the samples are within the level.
        let means_of = |branch: &Vec<Vec<usize>>| {
            let mut errors = vec![Vec::new(); Self::LEVELS];
            for &sample in branch.iter().flatten() {
                errors[level_of(sample)].push(error[sample]);
            }
            let of_level = |errors: Vec<f64>| (errors.len() >= Self::MIN_SAMPLES).then(|| mean((&errors).into()));
            Vec::from_iter(errors.into_iter().map(of_level))
        };
        let [loading, unloading] = passages.each_ref().map(means_of);
        let both = loading.into_iter().zip(unloading);
        let means = Vec::from_iter(both.map(|(loading, unloading)| Some([loading?, unloading?])));
        let level = |(level, means): (usize, &Option<[f64; 2]>)| {
            let actual = lowest + range * (level as f64 + 0.5) / Self::LEVELS as f64;
            means.map(|[loading, unloading]| [actual, actual + loading, actual + unloading])
        };
        let levels = Vec::from_iter(means.iter().enumerate().filter_map(level));
        let apart = levels.iter().map(|[_, loading, unloading]| (loading - unloading).abs());
        let percent_of_range = 100.0 * apart.fold(0.0, f64::max) / range;
        // Mean distance of each excursion from the middle of the branches.
        let distance_of = |samples: &Vec<usize>| {
            let distance = |&sample: &usize| {
                let [loading, unloading] = means[level_of(sample)]?;
                Some(error[sample] - 0.5 * (loading + unloading))
            };
            let distances = Vec::from_iter(samples.iter().filter_map(distance));
            (!distances.is_empty()).then(|| mean((&distances).into()))
        };
        let distances = passages
            .each_ref()
            .map(|branch| Vec::from_iter(branch.iter().filter_map(distance_of)));
        if !means_differ(distances) || levels.len() < Self::MIN_LEVELS || percent_of_range < Self::MIN_PERCENT {
            return None;
        }
        let branches = passages.map(|branch| branch.concat());
        let [loading, unloading] = branches.each_ref().map(|samples| {
            let [actual, decoded] = [actual, decoded].map(|of| of.select(Axis(0), samples).insert_axis(Axis(1)));
            TargetErrors::measure(actual.view(), decoded.view()).remove(0)
        });
        Some(Self {
            loading,
            unloading,
            samples: branches.map(|samples| samples.len()),
            percent_of_range,
            levels,
        })
    }

    /// Returns a sentence on the hysteresis of the target of this name.
    pub fn sentence(&self, name: &str) -> String {
        format!(
            "{name}: RMSE {} while it rises and {} while it falls; hysteresis of the decoded values {:.1} % of the range",
            format_number(self.loading.rmse),
            format_number(self.unloading.rmse),
            self.percent_of_range
        )
    }
}

/// Adds the excursions of one stretch between the first and the last turning point that are certain.
fn add_passages(passages: &mut Passages, actual: ArrayView1<'_, f64>, stretch: &[usize], range: f64) {
    let (reversal, rest) = (HysteresisLoop::REVERSAL * range, HysteresisLoop::REST * range);
    let mut turning_points = Vec::new();
    let (mut lowest, mut highest) = (stretch[0], stretch[0]);
    let mut is_loading = None;
    for &sample in stretch {
        let value = actual[sample];
        if value < actual[lowest] {
            lowest = sample;
        }
        if value > actual[highest] {
            highest = sample;
        }
        let has_risen = value - actual[lowest] >= reversal && is_loading != Some(true);
        let has_fallen = actual[highest] - value >= reversal && is_loading != Some(false);
        if has_risen || has_fallen {
            turning_points.push(if has_risen { lowest } else { highest });
            is_loading = Some(has_risen);
            (lowest, highest) = (sample, sample);
        }
    }
    // The last excursion ends at its extreme.
    turning_points.extend(is_loading.map(|is_loading| if is_loading { highest } else { lowest }));
    for pair in turning_points.windows(2) {
        let (from, to) = (actual[pair[0]], actual[pair[1]]);
        let is_moving = |sample: &usize| (actual[*sample] - from).abs() >= rest && (actual[*sample] - to).abs() >= rest;
        passages[usize::from(to <= from)].push((pair[0]..=pair[1]).filter(is_moving).collect());
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::standard_normal;

    fn column(values: &[f64]) -> Array2<f64> {
        Array2::from_shape_vec((values.len(), 1), values.to_vec()).unwrap()
    }

    fn in_stretches(actual: &[f64], decoded: &[f64], stretches: Vec<usize>) -> Option<HysteresisLoop> {
        let test = Dataset::new(column(actual), column(actual), None, stretches).unwrap();
        HysteresisLoop::of_test(&test, column(decoded).view(), SplitBy::Group).remove(0)
    }

    fn measure(actual: &[f64], decoded: &[f64]) -> Option<HysteresisLoop> {
        in_stretches(actual, decoded, vec![0; actual.len()])
    }

    /// Cycles of a sine between 0 and 10 that begin and end in the middle of an excursion.
    fn cycles(per_cycle: usize) -> Vec<f64> {
        let phase = |sample: usize| std::f64::consts::TAU * sample as f64 / per_cycle as f64;
        (0..5 * per_cycle + per_cycle / 3)
            .map(|sample| 5.0 + 5.0 * phase(sample).sin())
            .collect()
    }

    /// The play operator: the output follows the input at a distance of at most `radius`.
    fn play(input: &[f64], radius: f64) -> Vec<f64> {
        let mut state = input[0];
        let follow = |&value: &f64| {
            state = state.clamp(value - radius, value + radius);
            state
        };
        input.iter().map(follow).collect()
    }

    #[test]
    fn the_play_operator_has_the_hysteresis_of_its_width() {
        for (per_cycle, radius) in [(60, 0.5), (1000, 0.25)] {
            let actual = cycles(per_cycle);
            let found = measure(&actual, &play(&actual, radius)).unwrap();
            // 2 · radius of a range of 10.
            let expected = 20.0 * radius;
            assert!((found.percent_of_range - expected).abs() < 1e-9, "{found:?}");
            // In the middle of each excursion the play is used up: the error is the radius on either side.
            let mut levels = found.levels.iter();
            let [actual, loading, unloading] = levels.find(|[actual, ..]| (actual - 7.25).abs() < 1e-9).unwrap();
            assert!((actual - loading - radius).abs() < 1e-9, "{found:?}");
            assert!((unloading - actual - radius).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn the_branches_have_their_own_errors() {
        let actual = cycles(200);
        let rises = |sample: usize| sample > 0 && actual[sample] > actual[sample - 1];
        let decoded = |(sample, value): (usize, &f64)| if rises(sample) { value + 0.3 } else { value - 0.1 };
        let decoded: Vec<f64> = actual.iter().enumerate().map(decoded).collect();
        let found = measure(&actual, &decoded).unwrap();
        assert!(
            (found.loading.rmse - 0.3).abs() < 1e-9 && (found.unloading.rmse - 0.1).abs() < 1e-9,
            "{found:?}"
        );
        assert!((found.percent_of_range - 4.0).abs() < 1e-9, "{found:?}");
        assert!(found.sentence("force").contains("4.0 % of the range"));
    }

    #[test]
    fn noise_without_hysteresis_is_no_loop() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        // The target jitters as well.
        let actual: Vec<f64> = cycles(400)
            .iter()
            .map(|value| value + 0.05 * standard_normal(&mut rng))
            .collect();
        let decoded: Vec<f64> = actual
            .iter()
            .map(|value| value + 0.2 * standard_normal(&mut rng))
            .collect();
        assert_eq!(measure(&actual, &decoded), None);
    }

    #[test]
    fn presses_in_random_order_have_no_loading_and_unloading() {
        let found = (0..40).filter(|&seed| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let actual: Vec<f64> = (0..2000)
                .map(|sample| {
                    let peak: f64 = rng.random_range(0.0..10.0);
                    // Half of the sets are presses between rests.
                    if seed % 2 == 0 || sample % 3 == 0 { peak } else { 0.0 }
                })
                .collect();
            let decoded = actual.iter().map(|value| value + 0.2 * standard_normal(&mut rng));
            measure(&actual, &decoded.collect::<Vec<_>>()).is_some()
        });
        assert_eq!(found.count(), 0);
    }

    #[test]
    fn rest_between_cycles_is_left_out() {
        // A ramp up, a long hold, a ramp down, a long hold; while holding, the decoded value creeps far away.
        let (mut actual, mut decoded) = (Vec::new(), Vec::new());
        for _ in 0..4 {
            for sample in 0..50 {
                actual.push(f64::from(sample) / 50.0);
            }
            actual.extend([1.0; 200]);
            for sample in 0..50 {
                actual.push(1.0 - f64::from(sample) / 50.0);
            }
            actual.extend([0.0; 200]);
        }
        for (sample, &value) in actual.iter().enumerate() {
            decoded.push(if value == 0.0 || value == 1.0 {
                value + 5.0
            } else if actual[sample - 1] < value {
                value + 0.25
            } else {
                value
            });
        }
        let found = measure(&actual, &decoded).unwrap();
        assert!((found.loading.worst - 0.25).abs() < 1e-9, "{found:?}");
        assert_eq!(found.unloading.worst, 0.0, "{found:?}");
    }

    #[test]
    fn a_jump_between_stretches_is_no_excursion() {
        let rising: Vec<f64> = (0..100).map(f64::from).collect();
        let actual = [rising.clone(), rising].concat();
        let stretches: Vec<usize> = (0..200).map(|sample| sample / 100).collect();
        assert_eq!(in_stretches(&actual, &actual, stretches), None, "it never falls");
        assert!(measure(&[1.0; 50], &[1.0; 50]).is_none(), "constant");
        let set = Dataset::new(column(&[1.0]), column(&[1.0]), None, vec![0]).unwrap();
        let found = HysteresisLoop::of_test(&set.select(&[]), column(&[]).view(), SplitBy::Time);
        assert_eq!(found, [None], "no samples");
    }
}
