use rand::{Rng, RngExt};

use super::evidence::slow_cosines;
use crate::dataset::{Dataset, SplitBy};

/// Samples in the units that a bootstrap draws: groups (Davison and Hinkley 1997, section 3.8) or consecutive blocks
/// (Carlstein 1986), so that what neighbouring samples have in common is not taken for independent evidence.
#[derive(Clone, Debug)]
pub(super) struct Resampling {
    units: Vec<Vec<usize>>,
}

impl Resampling {
    /// Number of replicates.
    const REPLICATES: usize = 1000;
    /// Most units: more would take long to draw and change no interval. Neighbours are joined to fewer.
    const MAX_UNITS: usize = 2000;

    /// Units of `set`: its groups where it is split by group, otherwise blocks as long as the independent stretches of
    /// `series`, values of the samples in the order of the recording.
    pub(super) fn of(set: &Dataset, by: SplitBy, series: &[f64]) -> Self {
        let units = match by {
            SplitBy::Group => {
                let groups = set.snapshots();
                let joined = groups.len().div_ceil(Self::MAX_UNITS);
                groups.chunks(joined.max(1)).map(<[Vec<usize>]>::concat).collect()
            }
            SplitBy::Time | SplitBy::Random => {
                let length = slow_cosines(series).map_or(1, |cosines| series.len().div_ceil(cosines + 1));
                let length = length.max(set.samples().div_ceil(Self::MAX_UNITS));
                let samples: Vec<usize> = (0..set.samples()).collect();
                samples.chunks(length).map(<[usize]>::to_vec).collect()
            }
        };
        Self { units }
    }

    /// Number of units.
    pub(super) fn count(&self) -> usize {
        self.units.len()
    }

    /// Returns the sums over each unit of K values of every sample.
    pub(super) fn sums<const K: usize>(&self, values: impl Fn(usize) -> [f64; K]) -> Vec<[f64; K]> {
        let sum = |unit: &Vec<usize>| {
            let mut sums = [0.0; K];
            for &sample in unit {
                sums.iter_mut()
                    .zip(values(sample))
                    .for_each(|(sum, value)| *sum += value);
            }
            sums
        };
        self.units.iter().map(sum).collect()
    }

    /// Draws as many units as there are, with replacement, and calls `replicate` with how often each was drawn, again and
    /// again.
    pub(super) fn draw(&self, rng: &mut impl Rng, mut replicate: impl FnMut(&[f64])) {
        let mut times = vec![0.0; self.count()];
        for _ in 0..Self::REPLICATES {
            times.fill(0.0);
            for _ in 0..self.count() {
                times[rng.random_range(0..self.count())] += 1.0;
            }
            replicate(&times);
        }
    }
}

/// Sum of the units' sums, each as often as it was drawn.
pub(super) fn weighted<const K: usize>(sums: &[[f64; K]], times: &[f64]) -> [f64; K] {
    let mut total = [0.0; K];
    for (sums, &times) in sums.iter().zip(times) {
        total
            .iter_mut()
            .zip(sums)
            .for_each(|(total, sum)| *total += times * sum);
    }
    total
}
