use faer::{Mat, Side};
use ndarray::{ArrayView2, Axis};
use serde::{Deserialize, Serialize};

/// Description of the training readings against which [`DriftMonitor`] compares later readings.
///
/// The distance of a reading is its squared Mahalanobis distance from the training readings, divided by the number of
/// channels. Distances are averaged over blocks that are five times as long as their integrated autocorrelation time,
/// so that blocks are nearly independent also where neighbouring readings are nearly the same.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriftReference {
    metric: Metric,
    /// Number of readings in a block.
    block: usize,
    /// Mean distance of each training block, measured with a metric that was fitted to other blocks; ascending.
    distances: Vec<f64>,
}

/// Mean, scale and correlation of the channels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Metric {
    means: Vec<f64>,
    /// Reciprocal of the standard deviation of each channel; 0 if it is constant.
    inverse_deviations: Vec<f64>,
    /// Lower Cholesky factor of the correlation matrix plus [`RIDGE`] times the identity, row by row.
    factor: Vec<f64>,
}

/// Regularisation of the correlation matrix.
const RIDGE: f64 = 0.01;

impl Metric {
    /// Fits the metric to `readings` (samples × channels) without the samples `left_out`.
    fn fit(readings: ArrayView2<'_, f64>, left_out: std::ops::Range<usize>) -> Option<Self> {
        let kept: Vec<usize> = (0..readings.nrows())
            .filter(|sample| !left_out.contains(sample))
            .collect();
        let (count, channels) = (kept.len() as f64, readings.ncols());
        let kept = readings.select(Axis(0), &kept);
        let means = kept.mean_axis(Axis(0))?.to_vec();
        let spread = kept.std_axis(Axis(0), 0.0);
        let is_constant = |channel: usize| spread[channel] <= 1e-9 * means[channel].abs() || spread[channel] == 0.0;
        let inverse_deviations: Vec<f64> = (0..channels)
            .map(|channel| {
                if is_constant(channel) {
                    0.0
                } else {
                    spread[channel].recip()
                }
            })
            .collect();
        let scaled = Mat::from_fn(kept.nrows(), channels, |sample, channel| {
            (kept[[sample, channel]] - means[channel]) * inverse_deviations[channel]
        });
        let mut correlation = scaled.transpose() * &scaled;
        for column in 0..channels {
            for row in 0..channels {
                correlation[(row, column)] /= count;
            }
            correlation[(column, column)] += RIDGE;
        }
        let factor = correlation.llt(Side::Lower).ok()?;
        let lower = factor.L();
        let packed = (0..channels).flat_map(|row| (0..=row).map(move |column| lower[(row, column)]));
        let metric = Self {
            means,
            inverse_deviations,
            factor: packed.collect(),
        };
        metric.factor.iter().all(|value| value.is_finite()).then_some(metric)
    }

    /// Squared Mahalanobis distance of `readings` per channel; `scratch` has one entry for each channel.
    fn distance(&self, readings: impl Iterator<Item = f64>, scratch: &mut [f64]) -> f64 {
        let scaled = readings.zip(self.means.iter().zip(&self.inverse_deviations));
        let mut row_of_factor = 0;
        let mut sum = 0.0;
        for (row, (reading, (mean, inverse))) in scaled.enumerate() {
            let factor = &self.factor[row_of_factor..=row_of_factor + row];
            let above: f64 = factor.iter().zip(&scratch[..row]).map(|(a, b)| a * b).sum();
            scratch[row] = ((reading - mean) * inverse - above) / factor[row];
            sum += scratch[row] * scratch[row];
            row_of_factor += row + 1;
        }
        sum / self.means.len() as f64
    }
}

impl DriftReference {
    /// Minimum number of training blocks.
    const MIN_BLOCKS: usize = 30;
    /// Length of a block in integrated autocorrelation times.
    const TIMES: f64 = 5.0;
    /// Number of parts of the training set; the distances in each are measured with a metric fitted to the others.
    const PARTS: usize = 5;
    const MAX_CHANNELS: usize = 512;

    /// Describes the training `readings` (samples × channels, in the order of time). Returns `None` if they contain fewer
    /// than 30 independent blocks, more than 512 channels, or values that are not finite.
    pub fn of(readings: ArrayView2<'_, f64>) -> Option<Self> {
        let (samples, channels) = readings.dim();
        if samples < Self::MIN_BLOCKS || channels > Self::MAX_CHANNELS {
            return None;
        }
        if !readings.iter().all(|reading| reading.is_finite()) {
            return None;
        }
        let mut scratch = vec![0.0; channels];
        let mut distances = Vec::with_capacity(samples);
        for part in 0..Self::PARTS {
            let range = part * samples / Self::PARTS..(part + 1) * samples / Self::PARTS;
            let metric = Metric::fit(readings, range.clone())?;
            distances.extend(range.map(|sample| metric.distance(readings.row(sample).iter().copied(), &mut scratch)));
        }
        let longest = samples as f64 / (Self::MIN_BLOCKS as f64 * Self::TIMES);
        let block = (Self::TIMES * autocorrelation_time(&distances, longest)).ceil() as usize;
        let blocks = distances.chunks_exact(block);
        if blocks.len() < Self::MIN_BLOCKS {
            return None;
        }
        let mut distances: Vec<f64> = blocks
            .map(|block| block.iter().sum::<f64>() / block.len() as f64)
            .collect();
        distances.sort_by(f64::total_cmp);
        Some(Self {
            metric: Metric::fit(readings, 0..0)?,
            block,
            distances,
        })
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.metric.means.len()
    }

    /// Number of readings in a block: the monitor decides once per block.
    pub fn readings_per_block(&self) -> usize {
        self.block
    }

    /// Returns `true` if the parts, which may come from a file, fit together.
    pub fn is_valid(&self) -> bool {
        let Metric {
            means,
            inverse_deviations,
            factor,
        } = &self.metric;
        let channels = means.len();
        let numbers = means
            .iter()
            .chain(inverse_deviations)
            .chain(factor)
            .chain(&self.distances);
        let diagonal = (0..channels).map(|row| row * (row + 3) / 2);
        (inverse_deviations.len(), factor.len()) == (channels, channels * (channels + 1) / 2)
            && numbers.clone().all(|number| number.is_finite())
            && diagonal.clone().all(|place| factor[place] > 0.0)
            && self.block > 0
            && self.distances.len() >= Self::MIN_BLOCKS
            && self.distances.is_sorted()
    }
}

/// Integrated autocorrelation time of `series` in samples, at least 1: the sum of the autocorrelations up to the first
/// below 0.05, or until it exceeds `limit`.
fn autocorrelation_time(series: &[f64], limit: f64) -> f64 {
    const NEGLIGIBLE: f64 = 0.05;
    let count = series.len() as f64;
    let mean = series.iter().sum::<f64>() / count;
    let off: Vec<f64> = series.iter().map(|value| value - mean).collect();
    let variance = off.iter().map(|off| off * off).sum::<f64>() / count;
    let correlation = |lag: usize| {
        let products = off[lag..].iter().zip(&off).map(|(one, other)| one * other);
        products.sum::<f64>() / (count - lag as f64) / variance
    };
    let mut time = 1.0;
    for found in (1..series.len()).map(correlation) {
        if found < NEGLIGIBLE || time > limit {
            break;
        }
        time += 2.0 * found;
    }
    time
}

/// Monitor that reports when readings no longer look like the training readings, so that the intervals of the network no
/// longer hold.
///
/// The conformal p-value of each block is its rank among the training blocks. Bets against p-values that are too small
/// accumulate in a Shiryaev-Roberts e-detector (Shin, Ramdas and Rinaldo 2022, arXiv:2203.03532; Vovk et al. 2021,
/// arXiv:2102.10439): R ← (R + 1) κ p^(κ − 1), averaged over several κ. It alarms when R reaches
/// [`Self::BLOCKS_BETWEEN_FALSE_ALARMS`], so that with exchangeable blocks the mean time to a false alarm is at least that
/// number of blocks, and the probability of a false alarm within n blocks at most n divided by it. The bound neglects that
/// the training blocks are a finite sample: in simulations with 60 training blocks and an autocorrelation of 0.9, 1.3 % of
/// the sequences of 124 blocks raised a false alarm (bound: 1.2 %).
#[derive(Clone, Debug)]
pub struct DriftMonitor {
    reference: DriftReference,
    scratch: Vec<f64>,
    /// Sum of the distances in the current block, and number of readings.
    sum: f64,
    count: usize,
    /// R for each κ.
    evidence: [f64; BETS.len()],
    is_drifted: bool,
}

/// Exponents κ of the bets.
const BETS: [f64; 3] = [0.1, 0.25, 0.5];

impl DriftMonitor {
    /// Lower bound on the mean number of blocks to a false alarm.
    pub const BLOCKS_BETWEEN_FALSE_ALARMS: f64 = 10_000.0;

    /// Begins to compare readings with `reference`.
    pub fn new(reference: DriftReference) -> Self {
        Self {
            scratch: vec![0.0; reference.channels()],
            reference,
            sum: 0.0,
            count: 0,
            evidence: [0.0; BETS.len()],
            is_drifted: false,
        }
    }

    /// Takes the next readings; further values, such as those of a memory, are ignored. Returns `true` once, when the
    /// readings have drifted.
    ///
    /// # Panics
    /// If there are fewer readings than channels.
    pub fn take(&mut self, readings: &[f64]) -> bool {
        let readings = &readings[..self.reference.channels()];
        if !readings.iter().all(|reading| reading.is_finite()) {
            return false;
        }
        self.sum += self
            .reference
            .metric
            .distance(readings.iter().copied(), &mut self.scratch);
        self.count += 1;
        if self.count < self.reference.block {
            return false;
        }
        let distance = self.sum / self.count as f64;
        (self.sum, self.count) = (0.0, 0);
        let distances = &self.reference.distances;
        let at_least = distances.len() - distances.partition_point(|other| *other < distance);
        let p = (at_least + 1) as f64 / (distances.len() + 1) as f64;
        for (evidence, bet) in self.evidence.iter_mut().zip(BETS) {
            // Evidence beyond the threshold is not needed.
            *evidence = ((*evidence + 1.0) * bet * p.powf(bet - 1.0)).min(1e9);
        }
        let mean = self.evidence.iter().sum::<f64>() / BETS.len() as f64;
        let is_new = !self.is_drifted && mean >= Self::BLOCKS_BETWEEN_FALSE_ALARMS;
        self.is_drifted |= is_new;
        is_new
    }

    /// Returns `true` once the readings have drifted.
    pub fn is_drifted(&self) -> bool {
        self.is_drifted
    }

    /// Description of the training readings.
    pub fn reference(&self) -> &DriftReference {
        &self.reference
    }
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    use super::*;
    use crate::scene::standard_normal;

    /// Readings of five correlated channels, with the correlation `memory` of neighbouring readings.
    fn readings(samples: usize, memory: f64, rng: &mut ChaCha8Rng) -> Array2<f64> {
        let mut state: Vec<f64> = (0..6).map(|_| standard_normal(rng)).collect();
        let mut readings = Array2::zeros((samples, 5));
        for mut row in readings.rows_mut() {
            for value in &mut state {
                *value = memory * *value + (1.0 - memory * memory).sqrt() * standard_normal(rng);
            }
            for (channel, reading) in row.iter_mut().enumerate() {
                *reading = 100.0 * (channel + 1) as f64 + state[channel] + state[5];
            }
        }
        readings
    }

    /// Number of readings until the alarm, if there is one.
    fn alarm(reference: &DriftReference, readings: &Array2<f64>) -> Option<usize> {
        let mut monitor = DriftMonitor::new(reference.clone());
        let mut rows = readings.rows().into_iter();
        rows.position(|row| monitor.take(&row.to_vec())).map(|row| row + 1)
    }

    #[test]
    fn only_readings_that_differ_from_the_training_raise_an_alarm() {
        // Each sequence of 20 blocks raises a false alarm with a probability of about 0.2 %.
        for (memory, samples) in [(0.0, 400), (0.9, 3000)] {
            let (mut alarms, mut latest) = (0, 0);
            for seed in 0..100 {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let training = readings(samples, memory, &mut rng);
                let reference = DriftReference::of(training.view()).unwrap();
                assert!(reference.is_valid());
                let block = reference.readings_per_block();
                let same = readings(20 * block, memory, &mut rng);
                alarms += usize::from(alarm(&reference, &same).is_some());
                // The standard deviation of a channel is √2.
                let mut shifted = readings(20 * block, memory, &mut rng);
                shifted
                    .column_mut(2)
                    .mapv_inplace(|reading| reading + 3.0 * 2f64.sqrt());
                let found = alarm(&reference, &shifted).unwrap_or(usize::MAX);
                latest = latest.max(found / block);
            }
            assert!(alarms <= 1, "memory {memory}: {alarms} false alarms");
            assert!(latest <= 12, "memory {memory}: found after {latest} blocks");
        }
    }

    #[test]
    fn too_few_or_unusable_readings_have_no_reference() {
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        assert!(DriftReference::of(readings(20, 0.0, &mut rng).view()).is_none());
        assert!(DriftReference::of(readings(300, 0.9, &mut rng).view()).is_none());
        let mut with_nan = readings(400, 0.0, &mut rng);
        with_nan[[7, 1]] = f64::NAN;
        assert!(DriftReference::of(with_nan.view()).is_none());
    }

    #[test]
    fn a_constant_channel_is_ignored() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut training = readings(400, 0.0, &mut rng);
        training.column_mut(0).fill(5.0);
        let reference = DriftReference::of(training.view()).unwrap();
        let mut later = readings(100, 0.0, &mut rng);
        later.column_mut(0).fill(6.0);
        assert_eq!(alarm(&reference, &later), None);
    }
}
