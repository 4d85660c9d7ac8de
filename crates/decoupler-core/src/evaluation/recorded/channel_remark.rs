use ndarray::{ArrayView1, ArrayView2, Axis};

use super::{FittedModel, Interval, evidence::Evidence};
use crate::{
    dataset::{Dataset, Folds, SplitBy},
    evaluation::{RunError, RunSettings, errors::mean},
    job::Job,
    sensor::short,
};

/// Remark on a channel that carries less information than it should, or more, or on a target whose changes cannot be held
/// out. Channels and targets are counted from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ChannelRemark {
    /// All readings are the same.
    Constant {
        /// Channel.
        channel: usize,
        /// Its only reading.
        value: f64,
    },
    /// All readings equal those of an earlier channel, or a linear function of them.
    Duplicate {
        /// Channel.
        channel: usize,
        /// Earlier channel that it repeats.
        of: usize,
    },
    /// Readings accumulate at their smallest or largest value.
    Saturated {
        /// Channel.
        channel: usize,
        /// Value at which they accumulate.
        value: f64,
        /// `true` if it is the largest value, `false` if it is the smallest.
        is_largest: bool,
        /// Share of the samples at that value.
        share: f64,
    },
    /// All readings equal a target, or a linear function of it: the target may have leaked into the readings.
    Leak {
        /// Channel.
        channel: usize,
        /// Target that it repeats.
        target: usize,
    },
    /// A target is constant except for a single stretch of samples.
    SingleChange {
        /// Target.
        target: usize,
        /// First and last sample of the stretch.
        stretch: [usize; 2],
        /// Number of samples.
        samples: usize,
    },
}

impl ChannelRemark {
    /// Returns a sentence with the names of the channels and targets.
    pub fn sentence(&self, name: impl Fn(usize) -> String, target_name: impl Fn(usize) -> String) -> String {
        match *self {
            Self::Leak { channel, target } => format!(
                "{} equals the target {} up to scale and offset, more closely than a sensor could: if it was not read from \
                 the sensor, leave it out of the inputs",
                name(channel),
                target_name(target)
            ),
            Self::SingleChange {
                target,
                stretch: [first, last],
                samples,
            } => format!(
                "{} changes only once, in samples {} to {} of {samples}: without that stretch there is nothing to learn, so \
                 cross-validation does not show how well its changes are decoded; record more of them",
                target_name(target),
                first + 1,
                last + 1
            ),
            Self::Constant { channel, value } => format!(
                "{} is {} in every sample: it carries no information; check its wire",
                name(channel),
                short(value)
            ),
            Self::Duplicate { channel, of } => format!(
                "{} repeats {}: it adds no information; check that it is the right channel",
                name(channel),
                name(of)
            ),
            Self::Saturated {
                channel,
                value,
                is_largest,
                share,
            } => format!(
                "{} is at its {} value {} in {:.1} % of the samples: it is saturated there, or its range ends; give it \
                 a wider range",
                name(channel),
                if is_largest { "largest" } else { "smallest" },
                short(value),
                100.0 * share
            ),
        }
    }
}

/// Finds the constant, duplicated and saturated channels of `set`, channel by channel, and adds its [`target_remarks`].
///
/// A channel is saturated if at least 1 % of its samples, and no fewer than 5, have its smallest (or largest) value,
/// and more than three times as many as any of the next three values. The tail of a distribution thins out towards its
/// end, whereas samples accumulate at a limit. Channels with fewer than six different values, such as switches, are not
/// judged.
pub fn channel_remarks(set: &Dataset, by: SplitBy) -> Vec<ChannelRemark> {
    /// Maximum distance of unit vectors due to rounding of the readings.
    const ROUNDING: f64 = 1e-9;
    let readings = set.readings();
    let units: Vec<Option<Vec<f64>>> = readings.axis_iter(Axis(1)).map(unit_vector).collect();
    let mut remarks = Vec::new();
    for (channel, unit) in units.iter().enumerate() {
        let Some(unit) = unit else {
            let value = readings[[0, channel]];
            remarks.push(ChannelRemark::Constant { channel, value });
            continue;
        };
        let repeats = |of: &usize| {
            units[*of]
                .as_ref()
                .is_some_and(|other| is_parallel(unit, other, ROUNDING))
        };
        if let Some(of) = (0..channel).find(repeats) {
            remarks.push(ChannelRemark::Duplicate { channel, of });
            continue;
        }
        remarks.extend(saturation(channel, readings.column(channel)));
    }
    remarks.extend(target_remarks(set, set.channels(), by));
    remarks
}

/// Finds those of the first `channels` channels of `set` that equal a target, and the targets that change only once in a
/// set that is divided by `by`.
///
/// A channel equals a target if it explains all but 1e-10 of its variance by a straight line. Rounding to 16 bits alone
/// leaves 2e-10, and the noise and curvature of sensors are far larger.
pub fn target_remarks(set: &Dataset, channels: usize, by: SplitBy) -> Vec<ChannelRemark> {
    /// Square root of the share of the variance that a leak leaves.
    const LEAK: f64 = 1e-5;
    let (readings, all_targets) = (set.readings(), set.targets());
    let targets: Vec<Option<Vec<f64>>> = all_targets.axis_iter(Axis(1)).map(unit_vector).collect();
    let leak = |channel: usize| {
        let unit = unit_vector(readings.column(channel))?;
        let is_leak = |target: &Option<Vec<f64>>| target.as_ref().is_some_and(|other| is_parallel(&unit, other, LEAK));
        let target = targets.iter().position(is_leak)?;
        Some(ChannelRemark::Leak { channel, target })
    };
    // A line goes through any two samples.
    let channels = if set.samples() > 2 { channels } else { 0 };
    let changes = |target| single_change(target, set, by);
    let changes = (0..set.outputs()).filter_map(changes);
    (0..channels).filter_map(leak).chain(changes).collect()
}

/// Returns a remark on a target that is constant outside one stretch, at most as long as a fold, or one group.
fn single_change(target: usize, set: &Dataset, by: SplitBy) -> Option<ChannelRemark> {
    /// Largest share of the samples of a stretch that folds cannot divide.
    const FOLD: f64 = 0.2;
    let targets = set.targets();
    let (column, samples) = (targets.column(target), set.samples());
    let outside = |constant: f64| {
        let differs = |value: &f64| *value != constant;
        let first = column.iter().position(differs)?;
        Some([first, column.iter().rposition(differs)?])
    };
    let stretches = [outside(column[0])?, outside(column[samples - 1])?];
    let [first, last] = stretches.into_iter().min_by_key(|[first, last]| last - first)?;
    let groups = set.groups();
    let is_held_out_at_once = match by {
        SplitBy::Time => ((last - first) as f64) < FOLD * samples as f64,
        SplitBy::Group => groups[first..=last].iter().all(|group| *group == groups[first]),
        SplitBy::Random => false,
    };
    is_held_out_at_once.then_some(ChannelRemark::SingleChange {
        target,
        stretch: [first, last],
        samples,
    })
}

/// Returns the deviations of the readings from their mean as a vector of length 1; `None` for a constant channel.
fn unit_vector(channel: ArrayView1<'_, f64>) -> Option<Vec<f64>> {
    if channel.iter().all(|value| *value == channel[0]) {
        return None;
    }
    let mean = mean(channel);
    let largest = channel.iter().map(|value| (value - mean).abs()).fold(0.0, f64::max);
    let off: Vec<f64> = channel.iter().map(|value| (value - mean) / largest).collect();
    let length = off.iter().map(|value| value * value).sum::<f64>().sqrt();
    Some(off.into_iter().map(|value| value / length).collect())
}

/// Returns `true` if two unit vectors are equal up to sign and a `distance`.
fn is_parallel(one: &[f64], other: &[f64], distance: f64) -> bool {
    let along: f64 = one.iter().zip(other).map(|(a, b)| a * b).sum();
    let apart = |(a, b): (&f64, &f64)| (a - along.signum() * b).powi(2);
    along.abs() > 0.999_999 && one.iter().zip(other).map(apart).sum::<f64>().sqrt() < distance
}

fn saturation(channel: usize, readings: ArrayView1<'_, f64>) -> Vec<ChannelRemark> {
    const MIN_SAMPLES: usize = 5;
    const MIN_SHARE: f64 = 0.01;
    /// Minimum ratio to the number of samples at any of the neighbouring values.
    const MIN_RATIO: usize = 3;
    let mut sorted = readings.to_vec();
    sorted.sort_by(f64::total_cmp);
    let runs: Vec<&[f64]> = sorted.chunk_by(|one, other| one == other).collect();
    if runs.len() < 6 {
        return Vec::new();
    }
    let judge = |end: &[f64], next: &[&[f64]], is_largest: bool| {
        let share = end.len() as f64 / sorted.len() as f64;
        let neighbours = next.iter().map(|run| run.len()).max().unwrap_or(0);
        let is_saturated = end.len() >= MIN_SAMPLES && share >= MIN_SHARE && end.len() > MIN_RATIO * neighbours;
        is_saturated.then_some(ChannelRemark::Saturated {
            channel,
            value: end[0],
            is_largest,
            share,
        })
    };
    let last = runs.len() - 1;
    let ends = [
        judge(runs[0], &runs[1..4], false),
        judge(runs[last], &runs[last - 3..last], true),
    ];
    ends.into_iter().flatten().collect()
}

/// Growth of the error of each target when a channel is left out.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelImportance {
    /// Channel, from 0.
    pub channel: usize,
    /// Ratio of the RMSE without the channel to that with all channels, target by target; `None` if either is 0, or the
    /// target is constant.
    pub growth: Vec<Option<Interval>>,
}

/// Measures the growth of the held-out error without each channel, in the order of the channels; `None` if cancelled.
///
/// The model is fitted again without the channel, instead of permuting the channel: with correlated channels, the
/// sensor never gives permuted readings, and the model's answers to them contain little information about the channel
/// (Hooker, Mentch and Zhou 2021, doi:10.1007/s11222-021-10057-z). A channel that others can replace is therefore
/// unimportant, even if a network relies on it; of two copies, neither is important.
///
/// Takes (channels + 1) × folds fits of `model`.
///
/// # Errors
/// If the settings are invalid, or the job is cancelled.
pub fn channel_importance(
    settings: &RunSettings,
    set: &Dataset,
    (folds, by): (&Folds, SplitBy),
    model: FittedModel,
    job: &Job<'_>,
) -> Result<Vec<ChannelImportance>, RunError> {
    let channels = set.channels();
    let with_all = model.held_out(settings, set, folds, job)?;
    let mut found = Vec::with_capacity(channels);
    // With a single channel, there would be nothing left to fit.
    for channel in (0..channels).filter(|_| channels > 1) {
        let others: Vec<usize> = (0..channels).filter(|&other| other != channel).collect();
        let without = model.held_out(settings, &set.of_channels(&others), folds, job)?;
        let growth = |target| rmse_ratio(set, [without.view(), with_all.view()], target, by);
        found.push(ChannelImportance {
            channel,
            growth: (0..set.outputs()).map(growth).collect(),
        });
    }
    Ok(found)
}

/// Returns the ratio of the RMSE of the first answers to that of the second, both for the same samples; `None` if it is
/// not determined.
pub(super) fn rmse_ratio(
    set: &Dataset,
    [ours, theirs]: [ArrayView2<'_, f64>; 2],
    target: usize,
    by: SplitBy,
) -> Option<Interval> {
    let truth = set.targets();
    let squared = |answers: &ArrayView2<'_, f64>| -> Vec<f64> {
        let pairs = answers.column(target).into_iter().zip(truth.column(target));
        pairs.map(|(answer, truth)| (answer - truth).powi(2)).collect()
    };
    let (ours, theirs) = (squared(&ours), squared(&theirs));
    let total: f64 = theirs.iter().sum();
    let ratio = ours.iter().sum::<f64>() / total;
    let influences = ours
        .iter()
        .zip(&theirs)
        .map(|(ours, theirs)| (ours - ratio * theirs) / total);
    let spread = Evidence::of(set, by).variance(&influences.collect::<Vec<_>>());
    Some(Interval::of_ratio(ratio, spread)?.map(f64::sqrt))
}

impl ChannelImportance {
    /// Returns the largest growth over all targets; `None` if there is none.
    pub fn largest(&self) -> Option<Interval> {
        let growth = self.growth.iter().flatten().copied();
        growth.max_by(|one, other| one.value.total_cmp(&other.value))
    }

    /// Returns `true` if the error of no target grows significantly without the channel.
    pub fn is_dispensable(&self) -> bool {
        self.growth.iter().flatten().all(|growth| growth.low <= 1.0)
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::standard_normal;

    #[test]
    fn only_faulty_channels_are_reported() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut readings = Array2::from_shape_simple_fn((2000, 8), || standard_normal(&mut rng));
        for mut row in readings.rows_mut() {
            row[1] = 4.2;
            row[3] = row[0];
            row[4] = 1e4 - 250.0 * row[2];
            row[5] = row[5].min(1.5); // 6.7 % of the samples.
            row[6] = (row[6] * 10.0).round(); // A coarse converter, with tails.
            row[7] = f64::from(u8::from(row[7] > 1.0)); // A switch.
        }
        let targets = Array2::zeros((2000, 1));
        let set = Dataset::new(readings, targets, None, (0..2000).collect()).unwrap();
        let remarks = channel_remarks(&set, SplitBy::Time);
        let name = |channel: usize| format!("c{}", channel + 1);
        let sentences: Vec<String> = remarks.iter().map(|remark| remark.sentence(name, name)).collect();
        let expected = [
            "c2 is 4.2 in every sample",
            "c4 repeats c1",
            "c5 repeats c3",
            "c6 is at its largest value 1.5 in ",
        ];
        assert_eq!(sentences.len(), expected.len(), "{sentences:?}");
        for (sentence, start) in sentences.iter().zip(expected) {
            assert!(sentence.starts_with(start), "{sentence}");
        }
    }

    #[test]
    fn channels_that_are_nearly_the_same_are_not_duplicates() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut readings = Array2::from_shape_simple_fn((500, 2), || standard_normal(&mut rng));
        for mut row in readings.rows_mut() {
            row[1] = row[0] + 1e-6 * row[1];
        }
        let set = Dataset::new(readings, Array2::zeros((500, 1)), None, (0..500).collect()).unwrap();
        assert_eq!(channel_remarks(&set, SplitBy::Time), []);
    }

    #[test]
    fn a_channel_that_equals_a_target_is_a_leak_and_an_honest_sensor_is_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let targets = Array2::from_shape_simple_fn((500, 2), || standard_normal(&mut rng));
        let reading = |channel: usize, target: f64, noise: f64| match channel {
            0 => target + 1e-6 * noise,
            1 => 1e6 - 300.0 * target,
            // Sensors: 16 bits of a range of ±4, noise of 1e-4, and a curvature of 1e-4.
            2 => (target * 8192.0).round() / 8192.0,
            3 => target + 1e-4 * noise,
            _ => target + 1e-4 * target * target,
        };
        let readings = Array2::from_shape_fn((500, 5), |(sample, channel)| {
            reading(channel, targets[[sample, 1]], standard_normal(&mut rng))
        });
        let set = Dataset::new(readings, targets, None, (0..500).collect()).unwrap();
        let remarks = channel_remarks(&set, SplitBy::Time);
        let leak = |channel| ChannelRemark::Leak { channel, target: 1 };
        assert_eq!(
            remarks,
            [ChannelRemark::Duplicate { channel: 1, of: 0 }, leak(0), leak(1)][usize::from(remarks.len() == 2)..]
        );
        let sentence =
            remarks[remarks.len() - 1].sentence(|channel| format!("c{channel}"), |target| format!("y{target}"));
        assert!(
            sentence.starts_with("c1 equals the target y1 up to scale and offset"),
            "{sentence}"
        );
    }

    #[test]
    fn a_target_that_changes_once_cannot_be_held_out() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let readings = Array2::from_shape_simple_fn((1000, 1), || standard_normal(&mut rng));
        let remarks = |by: SplitBy, pressed: &dyn Fn(usize) -> bool| {
            let targets = Array2::from_shape_fn((1000, 1), |(sample, _)| f64::from(u8::from(pressed(sample))));
            let groups = (0..1000).map(|sample| sample / 50).collect();
            channel_remarks(&Dataset::new(readings.clone(), targets, None, groups).unwrap(), by)
        };
        for [first, last] in [[0, 99], [250, 349], [900, 999]] {
            let found = remarks(SplitBy::Time, &|sample| (first..=last).contains(&sample));
            let stretch = [first, last];
            let samples = 1000;
            let expected = ChannelRemark::SingleChange {
                target: 0,
                stretch,
                samples,
            };
            assert_eq!(found, [expected]);
        }
        assert!(remarks(SplitBy::Time, &|sample| sample % 400 > 350).is_empty());
        assert!(remarks(SplitBy::Random, &|sample| (250..350).contains(&sample)).is_empty());
        assert!(remarks(SplitBy::Group, &|sample| (250..350).contains(&sample)).is_empty());
        assert_eq!(remarks(SplitBy::Group, &|sample| (250..300).contains(&sample)).len(), 1);
    }
}
