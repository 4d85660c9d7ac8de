use ndarray::ArrayView2;

use crate::{dataset::Dataset, problem::Channel};

/// Fraction of the range by which a value may be outside it: the extremes of few training samples are exceeded slightly by
/// others of the same kind.
const MARGIN: f64 = 0.1;
/// Number of columns that a sentence names.
const NAMED: usize = 3;

/// Test samples outside the range of the training samples, where a network extrapolates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Extrapolation {
    /// Number of test samples.
    pub samples: usize,
    /// Number of test samples with a reading or a target outside the training range by more than a tenth of its width.
    pub outside: usize,
    /// Channels with such readings and the number of samples, most first.
    pub readings: Vec<(usize, usize)>,
    /// Targets with such values and the number of samples, most first.
    pub targets: Vec<(usize, usize)>,
}

impl Extrapolation {
    /// Minimum share of the test samples that is worth a warning.
    const MIN_SHARE: f64 = 0.01;

    /// Compares the samples of `test` with the ranges of the samples of `training`, which have the same channels and outputs.
    pub fn measure(training: &Dataset, test: &Dataset) -> Self {
        let mut is_outside = vec![false; test.samples()];
        let mut count = |training: ArrayView2<'_, f64>, test: ArrayView2<'_, f64>| {
            let columns = training.columns().into_iter().zip(test.columns()).enumerate();
            let mut counts = Vec::from_iter(columns.map(|(column, (training, test))| {
                let low = training.fold(f64::INFINITY, |low, &value| low.min(value));
                let high = training.fold(f64::NEG_INFINITY, |high, &value| high.max(value));
                let margin = MARGIN * (high - low);
                let mut outside = 0;
                for (is_outside, value) in is_outside.iter_mut().zip(test) {
                    if !(low - margin..=high + margin).contains(value) {
                        outside += 1;
                        *is_outside = true;
                    }
                }
                (column, outside)
            }));
            counts.retain(|(_, outside)| *outside > 0);
            counts.sort_by_key(|(_, outside)| usize::MAX - outside);
            counts
        };
        let readings = count(training.readings(), test.readings());
        let targets = count(training.targets(), test.targets());
        Self {
            samples: test.samples(),
            outside: is_outside.iter().filter(|is_outside| **is_outside).count(),
            readings,
            targets,
        }
    }

    /// Share of the test samples that are outside.
    pub fn share(&self) -> f64 {
        self.outside as f64 / self.samples.max(1) as f64
    }

    /// Returns a warning with the names of the columns, if more than one in a hundred test samples is outside.
    pub fn warning(&self, inputs: &[Channel], targets: &[Channel]) -> Option<String> {
        if self.share() < Self::MIN_SHARE {
            return None;
        }
        let of = |counts: &[(usize, usize)], channels: &[Channel], kind: &str| {
            let named = counts.iter().take(NAMED);
            let mut parts =
                Vec::from_iter(named.map(|(column, count)| format!("{} in {count}", channels[*column].name)));
            if counts.len() > NAMED {
                parts.push(format!("{} others", counts.len() - NAMED));
            }
            (!parts.is_empty()).then(|| format!("{kind} {}", parts.join(", ")))
        };
        let columns = [
            of(&self.readings, inputs, "readings"),
            of(&self.targets, targets, "targets"),
        ];
        Some(format!(
            "{:.0} % of the test samples ({} of {}) are outside the range of the training samples by more than a tenth of \
             it ({}); the network extrapolates there, so that its error within the range may be smaller",
            100.0 * self.share(),
            self.outside,
            self.samples,
            Vec::from_iter(columns.into_iter().flatten()).join("; ")
        ))
    }
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
        let found = Extrapolation::measure(&training, &test);
        assert_eq!((found.samples, found.outside), (4, 3));
        assert_eq!(found.readings, [(0, 2), (1, 1)]);
        assert_eq!(found.targets, [(0, 2)]);
        let warning = found.warning(&channels(&["a", "b"]), &channels(&["force"])).unwrap();
        assert!(
            warning.contains("75 %") && warning.contains("readings a in 2, b in 1; targets force in 2"),
            "{warning}"
        );
        let inside = Extrapolation::measure(&training, &training);
        assert_eq!((inside.share(), inside.warning(&[], &[])), (0.0, None));
    }
}
