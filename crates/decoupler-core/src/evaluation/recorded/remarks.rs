use ndarray::{Array1, ArrayView1};

use super::scaled_deviations;
use crate::{
    dataset::{Dataset, SplitBy},
    problem::Channel,
    sensor::short,
};

/// Returns remarks on the constant, duplicated and saturated channels of `set`, channel by channel, and its
/// [`target_remarks`]. `inputs` and `targets` are the names of its channels and targets.
///
/// A channel is saturated if at least 1 % of its samples, and no fewer than 5, have its smallest (or largest) value,
/// and more than three times as many as any of the next three values. The tail of a distribution thins out towards its
/// end, whereas samples accumulate at a limit. Channels with fewer than six different values, such as switches, are not
/// judged.
pub fn channel_remarks(set: &Dataset, by: SplitBy, inputs: &[Channel], targets: &[Channel]) -> Vec<String> {
    /// Maximum distance of unit vectors due to rounding of the readings.
    const ROUNDING: f64 = 1e-9;
    let readings = set.readings();
    let units = Vec::from_iter(readings.columns().into_iter().map(unit_vector));
    let mut remarks = Vec::new();
    for (channel, readings) in readings.columns().into_iter().enumerate() {
        let name = &inputs[channel].name;
        let unit = units[channel].as_ref();
        let original = unit.and_then(|unit| position_of_parallel(unit, &units[..channel], ROUNDING));
        match (unit, original) {
            (None, _) => remarks.push(format!(
                "{name} is {} in every sample: it carries no information; check its wire",
                short(readings[0])
            )),
            (_, Some(of)) => remarks.push(format!(
                "{name} repeats {}: it adds no information; check that it is the right channel",
                inputs[of].name
            )),
            _ => remarks.extend(saturation(name, readings)),
        }
    }
    remarks.extend(target_remarks(set, by, inputs, targets));
    remarks
}

/// Returns remarks on the channels of `set` that equal a target, which may have leaked into the readings, and on the targets
/// that change only once, so that their changes cannot be held out, in a set that is divided by `by`.
///
/// A channel equals a target if it explains all but 1e-10 of its variance by a straight line. Rounding to 16 bits alone
/// leaves 2e-10, and the noise and curvature of sensors are far larger.
pub fn target_remarks(set: &Dataset, by: SplitBy, inputs: &[Channel], targets: &[Channel]) -> Vec<String> {
    /// Square root of the share of the variance that a leak leaves.
    const LEAK: f64 = 1e-5;
    let (readings, values) = (set.readings(), set.targets());
    let units = Vec::from_iter(values.columns().into_iter().map(unit_vector));
    let mut remarks = Vec::new();
    // A line goes through any two samples.
    for (name, channel) in inputs.iter().zip(readings.columns()).filter(|_| set.samples() > 2) {
        let leak = unit_vector(channel).and_then(|unit| position_of_parallel(&unit, &units, LEAK));
        if let Some(target) = leak {
            remarks.push(format!(
                "{} equals the target {} up to scale and offset, more closely than a sensor could: if it was not read from \
                 the sensor, leave it out of the inputs",
                name.name, targets[target].name
            ));
        }
    }
    for (name, values) in targets.iter().zip(values.columns()) {
        if let Some([first, last]) = single_change(values, set.groups(), by) {
            remarks.push(format!(
                "{} changes only once, in samples {} to {} of {}: without that stretch there is nothing to learn, so \
                 cross-validation does not show how well its changes are decoded; record more of them",
                name.name,
                first + 1,
                last + 1,
                set.samples()
            ));
        }
    }
    remarks
}

/// Returns the first and the last sample of the only stretch in which a target changes, if it is at most as long as a fold,
/// or in one group.
fn single_change(values: ArrayView1<'_, f64>, groups: &[usize], by: SplitBy) -> Option<[usize; 2]> {
    /// Largest share of the samples of a stretch that folds cannot divide.
    const FOLD: f64 = 0.2;
    let outside = |constant: f64| {
        let differs = |value: &f64| *value != constant;
        Some([values.iter().position(differs)?, values.iter().rposition(differs)?])
    };
    let stretches = [outside(*values.first()?)?, outside(*values.last()?)?];
    let [first, last] = stretches.into_iter().min_by_key(|[first, last]| last - first)?;
    let is_held_out_at_once = match by {
        SplitBy::Time => ((last - first) as f64) < FOLD * values.len() as f64,
        // The folds of a single group are in time.
        SplitBy::Group if groups.iter().any(|group| *group != groups[0]) => {
            groups[first..=last].iter().all(|group| *group == groups[first])
        }
        SplitBy::Group | SplitBy::Random => false,
    };
    is_held_out_at_once.then_some([first, last])
}

/// Returns the deviations of the readings from their mean as a vector of length 1; `None` for a constant channel.
fn unit_vector(channel: ArrayView1<'_, f64>) -> Option<Array1<f64>> {
    let is_constant = channel.iter().all(|value| *value == channel[0]);
    (!is_constant).then(|| {
        let (off, _) = scaled_deviations(channel);
        let length = off.dot(&off).sqrt();
        off / length
    })
}

/// Returns the index of the first of `others` that equals this vector up to sign and a `distance`; all have length 1.
fn position_of_parallel(one: &Array1<f64>, others: &[Option<Array1<f64>>], distance: f64) -> Option<usize> {
    let is_parallel = |other: &Array1<f64>| {
        let along = one.dot(other);
        let apart = one.iter().zip(other).map(|(a, b)| (a - along.signum() * b).powi(2));
        along.abs() > 0.999_999 && apart.sum::<f64>().sqrt() < distance
    };
    others.iter().position(|other| other.as_ref().is_some_and(is_parallel))
}

/// Returns remarks on the ends of the range of a channel at which its readings accumulate.
fn saturation(name: &str, readings: ArrayView1<'_, f64>) -> Vec<String> {
    const MIN_SAMPLES: usize = 5;
    const MIN_SHARE: f64 = 0.01;
    /// Minimum ratio to the number of samples at any of the three neighbouring values.
    const MIN_RATIO: usize = 3;
    let mut sorted = readings.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut runs = Vec::from_iter(sorted.chunk_by(|one, other| one == other));
    let mut remarks = Vec::new();
    for end in ["smallest", "largest"] {
        let (count, share) = (runs[0].len(), runs[0].len() as f64 / sorted.len() as f64);
        let is_largest = |next: &&[f64]| count > MIN_RATIO * next.len();
        if runs.len() >= 6 && count >= MIN_SAMPLES && share >= MIN_SHARE && runs[1..4].iter().all(is_largest) {
            remarks.push(format!(
                "{name} is at its {end} value {} in {:.1} % of the samples: it is saturated there, or its range ends; give it \
                 a wider range",
                short(runs[0][0]),
                100.0 * share
            ));
        }
        runs.reverse();
    }
    remarks
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::standard_normal;

    /// Remarks on a set whose channels are called c1, c2, … and its targets y1, y2, ….
    fn remarks_on(set: &Dataset, by: SplitBy) -> Vec<String> {
        let names = |prefix: &str, count: usize| {
            let channel = |number: usize| Channel::new(format!("{prefix}{number}"), None);
            Vec::from_iter((1..=count).map(channel))
        };
        channel_remarks(set, by, &names("c", set.channels()), &names("y", set.outputs()))
    }

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
        let sentences = remarks_on(&set, SplitBy::Time);
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
        assert!(remarks_on(&set, SplitBy::Time).is_empty());
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
        let remarks = remarks_on(&set, SplitBy::Time);
        let expected = [
            "c2 repeats c1",
            "c1 equals the target y2 up to scale and offset",
            "c2 equals the target y2 up to scale and offset",
        ];
        // That the second channel repeats the first is within rounding, and may be remarked upon.
        let expected = &expected[usize::from(remarks.len() == 2)..];
        assert_eq!(remarks.len(), expected.len(), "{remarks:?}");
        for (remark, start) in remarks.iter().zip(expected) {
            assert!(remark.starts_with(start), "{remark}");
        }
    }

    #[test]
    fn a_target_that_changes_once_cannot_be_held_out() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let readings = Array2::from_shape_simple_fn((1000, 1), || standard_normal(&mut rng));
        let remarks = |by: SplitBy, pressed: &dyn Fn(usize) -> bool| {
            let targets = Array2::from_shape_fn((1000, 1), |(sample, _)| f64::from(u8::from(pressed(sample))));
            let groups = (0..1000).map(|sample| sample / 50).collect();
            remarks_on(&Dataset::new(readings.clone(), targets, None, groups).unwrap(), by)
        };
        for [first, last] in [[0, 99], [250, 349], [900, 999]] {
            let found = remarks(SplitBy::Time, &|sample| (first..=last).contains(&sample));
            let expected = format!(
                "y1 changes only once, in samples {} to {} of 1000:",
                first + 1,
                last + 1
            );
            assert!(found.len() == 1 && found[0].starts_with(&expected), "{found:?}");
        }
        assert!(remarks(SplitBy::Time, &|sample| sample % 400 > 350).is_empty());
        assert!(remarks(SplitBy::Random, &|sample| (250..350).contains(&sample)).is_empty());
        assert!(remarks(SplitBy::Group, &|sample| (250..350).contains(&sample)).is_empty());
        assert_eq!(remarks(SplitBy::Group, &|sample| (250..300).contains(&sample)).len(), 1);
    }
}
