use std::cmp::Reverse;

use crate::{dataset::Dataset, evaluation::errors::extremes, problem::Channel};

/// Fraction of the range by which a value may be outside it: the extremes of few training samples are exceeded slightly by
/// others of the same kind.
const MARGIN: f64 = 0.1;
/// Minimum share of the test samples that is worth a warning.
const MIN_SHARE: f64 = 0.01;
/// Number of columns that a warning names.
const NAMED: usize = 3;

/// Returns the share of the test samples outside the range of the training samples: those with a reading or a target outside it
/// by more than a tenth of its width; with a warning that names the columns if that is more than one in a hundred. Such readings
/// are limited to the range, extended by a tenth. Both sets have these channels and targets.
pub fn extrapolation(
    training: &Dataset,
    test: &Dataset,
    inputs: &[Channel],
    targets: &[Channel],
) -> (f64, Option<String>) {
    let (mut is_outside, mut counts) = (vec![false; test.samples()], Vec::new());
    let sets = [training, test].map(|set| [set.readings(), set.targets()]);
    for (place, channels) in [inputs, targets].into_iter().enumerate() {
        let columns = sets[0][place].columns().into_iter().zip(sets[1][place].columns());
        for (channel, (training, test)) in channels.iter().zip(columns) {
            let (low, high) = extremes(training);
            let margin = MARGIN * (high - low);
            let range = low - margin..=high + margin;
            let outside = test
                .iter()
                .zip(&mut is_outside)
                .filter(|(value, _)| !range.contains(value));
            counts.push((outside.map(|(_, is_outside)| *is_outside = true).count(), &channel.name));
        }
    }
    counts.retain(|(count, _)| *count > 0);
    counts.sort_by_key(|(count, _)| Reverse(*count));
    let mut named = Vec::from_iter(
        counts
            .iter()
            .take(NAMED)
            .map(|(count, name)| format!("{name} in {count}")),
    );
    named.extend((counts.len() > NAMED).then(|| format!("{} others", counts.len() - NAMED)));
    let samples = test.samples();
    let outside = is_outside.into_iter().filter(|outside| *outside).count();
    let share = outside as f64 / samples.max(1) as f64;
    let warning = format!(
        "{:.0} % of the test samples ({outside} of {samples}) are outside the range of the training samples by more than \
             a tenth of it ({}); readings are limited to that range, and the error within it may be smaller",
        100.0 * share,
        named.join(", ")
    );
    (share, (share >= MIN_SHARE).then_some(warning))
}

#[cfg(test)]
mod tests {
    use ndarray::{Array2, array};

    use super::*;

    fn channels(names: &[&str]) -> Vec<Channel> {
        let channel = |name: &&str| Channel::new(*name, None);
        names.iter().map(channel).collect()
    }

    fn set(readings: Array2<f64>, targets: Array2<f64>) -> Dataset {
        let groups = (0..readings.nrows()).collect();
        Dataset::new(readings, targets, None, groups).unwrap()
    }

    #[test]
    fn samples_beyond_a_tenth_of_the_training_range_are_counted_once() {
        let training = set(array![[0.0, 5.0], [10.0, 5.0]], array![[0.0], [1.0]]);
        let test = set(
            array![[10.9, 5.0], [11.1, 5.0], [-2.0, 5.1], [5.0, 5.0]],
            array![[0.5], [0.5], [2.0], [-0.11]],
        );
        let (inputs, targets) = (channels(&["a", "b"]), channels(&["force"]));
        let (share, warning) = extrapolation(&training, &test, &inputs, &targets);
        assert_eq!(share, 0.75);
        let warning = warning.unwrap();
        assert!(
            warning.contains("75 % of the test samples (3 of 4)") && warning.contains("(a in 2, force in 2, b in 1)"),
            "{warning}"
        );
        let inside = extrapolation(&training, &training, &inputs, &targets);
        assert_eq!(inside, (0.0, None));
    }
}
