use std::collections::VecDeque;

use faer::{Mat, Side};
use ndarray::{ArrayView1, ArrayView2};
use serde::{Deserialize, Serialize};

use super::LiveError;
use crate::{
    numerics::{correlation_time, mean, root_mean_square},
    problem::Channel,
};

/// Description of the training readings against which [`DriftMonitor`] compares later readings: the range over blocks of
/// training readings of
///
/// - the variance of each input within a block, and their mean over the inputs,
/// - the mean of each input,
/// - the mean square of each input given the inputs before it (squared Mahalanobis distance, term by term), and their
///   mean over the inputs.
///
/// A block is at least five times as long as neighbouring readings are correlated, so that blocks are nearly independent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriftReference {
    means: Vec<f64>,
    /// Reciprocal of the standard deviation of each input; 0 if it is constant.
    inverse_deviations: Vec<f64>,
    /// Lower Cholesky factor of the correlation matrix plus [`RIDGE`] times the identity, row by row.
    factor: Vec<f64>,
    /// Number of readings in a block.
    block: usize,
    /// Number of training blocks.
    blocks: usize,
    /// Smallest and largest value of each [`Statistic`] in the training blocks, widened by [`LEVEL_MARGIN`] or
    /// [`RATIO_MARGIN`].
    ranges: Vec<[f64; 2]>,
}

/// Regularisation of the correlation matrix.
const RIDGE: f64 = 0.01;
/// Margin of the range of a mean in standard deviations of the training readings. Smaller changes are not reported, also
/// not those by the phase in which a block of a periodic signal begins.
const LEVEL_MARGIN: f64 = 0.1;
/// Factor that widens the range of a variance or mean square.
const RATIO_MARGIN: f64 = 1.1;
/// Bound of scaled readings, so that their squares are finite.
const MAX_SCALED: f64 = 1e6;

/// Quantity computed from each block: of one input, or of all together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Statistic {
    Variance(Option<usize>),
    Mean(usize),
    Square(Option<usize>),
}

impl Statistic {
    /// Number of statistics of this number of inputs.
    fn count(channels: usize) -> usize {
        3 * channels + 2
    }

    fn at(index: usize, channels: usize) -> Self {
        match index {
            _ if index <= channels => Self::Variance(index.checked_sub(1)),
            _ if index <= 2 * channels => Self::Mean(index - channels - 1),
            _ => Self::Square((index - 2 * channels - 1).checked_sub(1)),
        }
    }

    /// Returns the range of later blocks that are like the training blocks. Squares have no lower end: those of the readings
    /// to which the correlation was fitted are too small.
    fn widened(self, [low, high]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Mean(_) => [low - LEVEL_MARGIN, high + LEVEL_MARGIN],
            Self::Variance(_) => [low / RATIO_MARGIN, high * RATIO_MARGIN],
            Self::Square(_) => [0.0, high * RATIO_MARGIN],
        }
    }
}

/// Sums over the readings of a block.
#[derive(Clone, Debug)]
struct Block {
    /// Latest reading, scaled.
    scaled: Vec<f64>,
    /// Squares of the latest reading given the inputs before each.
    squares: Vec<f64>,
    /// Scaled reading with which the block begins.
    first: Vec<f64>,
    /// Sums of the differences from the first reading, of their squares, and of the squares given the inputs before.
    sums: Vec<[f64; 3]>,
    count: usize,
}

impl Block {
    fn new(channels: usize) -> Self {
        Self {
            scaled: vec![0.0; channels],
            squares: vec![0.0; channels],
            first: vec![0.0; channels],
            sums: vec![[0.0; 3]; channels],
            count: 0,
        }
    }

    /// Takes the next reading, but does not add it yet.
    fn read<'a>(&mut self, reference: &DriftReference, readings: impl IntoIterator<Item = &'a f64>) {
        for (channel, (scaled, reading)) in self.scaled.iter_mut().zip(readings).enumerate() {
            *scaled = reference.scaled(channel, *reading);
        }
        whiten(self.scaled.iter().copied(), &reference.factor, &mut self.squares);
        self.squares.iter_mut().for_each(|square| *square *= *square);
    }

    /// Adds the latest reading.
    fn add(&mut self) {
        if self.count == 0 {
            self.first.copy_from_slice(&self.scaled);
        }
        self.count += 1;
        let latest = self.first.iter().zip(&self.scaled).zip(&self.squares);
        for (sums, ((first, scaled), square)) in self.sums.iter_mut().zip(latest) {
            // Exactly 0 as long as a reading does not change.
            let difference = scaled - first;
            sums[0] += difference;
            sums[1] += difference * difference;
            sums[2] += square;
        }
    }

    /// Returns the statistics and begins the next block.
    fn finish(&mut self) -> Vec<f64> {
        let (channels, count) = (self.first.len() as f64, self.count as f64);
        let of_channel = |(sums, first): (&mut [f64; 3], &f64)| {
            let [mean, square_of_difference, square] = std::mem::take(sums).map(|sum| sum / count);
            [(square_of_difference - mean * mean).max(0.0), first + mean, square]
        };
        let of_channels = Vec::from_iter(self.sums.iter_mut().zip(&self.first).map(of_channel));
        self.count = 0;
        let of = |kind: usize| of_channels.iter().map(move |statistics| statistics[kind]);
        let of_all = |kind: usize| std::iter::once(of(kind).map(|statistic| statistic / channels).sum());
        let variances = of_all(0).chain(of(0));
        variances.chain(of(1)).chain(of_all(2)).chain(of(2)).collect()
    }
}

impl DriftReference {
    /// Minimum number of training blocks.
    pub(super) const MIN_BLOCKS: usize = 10;
    /// Minimum length of a block in correlation times.
    const MIN_TIMES: f64 = 5.0;
    /// Maximum length: longer blocks detect smaller changes, but later.
    const MAX_TIMES: f64 = 20.0;
    /// Number of training blocks beyond which blocks become longer instead.
    const ENOUGH_BLOCKS: f64 = 60.0;
    /// Number of parts of the training set; the squares of each are measured with the correlation of the others, as
    /// those of later readings are.
    const PARTS: usize = 5;
    pub(super) const MAX_CHANNELS: usize = 512;

    /// Describes the training `readings` (samples × channels, in the order of time).
    ///
    /// # Errors
    /// If there are too few independent readings or too many channels, no channel varies, or a reading is not finite.
    pub fn of(readings: ArrayView2<'_, f64>) -> Result<Self, LiveError> {
        let (samples, channels) = readings.dim();
        if channels > Self::MAX_CHANNELS {
            return Err(LiveError::TooManyInputs { found: channels });
        }
        let scales: Option<Vec<(f64, f64)>> = readings.columns().into_iter().map(scale).collect();
        let (means, inverse_deviations): (Vec<f64>, Vec<f64>) = scales.ok_or(LiveError::NotFinite)?.into_iter().unzip();
        if inverse_deviations.iter().all(|inverse| *inverse == 0.0) {
            return Err(LiveError::Constant);
        }
        let mut reference = Self {
            means,
            inverse_deviations,
            factor: Vec::new(),
            block: 1,
            blocks: samples,
            ranges: vec![[f64::INFINITY, f64::NEG_INFINITY]; Statistic::count(channels)],
        };
        let scaled = |sample: usize, channel: usize| reference.scaled(channel, readings[[sample, channel]]);
        let column = |channel: usize| (0..samples).map(|sample| scaled(sample, channel)).collect();
        let distance = |sample: usize| (0..channels).map(|channel| scaled(sample, channel).powi(2)).sum();
        let times = (0..channels).map(|channel| correlation_time(column(channel)));
        let time = times.fold(correlation_time((0..samples).map(distance).collect()), f64::max);
        let independent = samples as f64 / time;
        let length = (independent / Self::ENOUGH_BLOCKS).clamp(Self::MIN_TIMES, Self::MAX_TIMES);
        let block = (length * time).ceil() as usize;
        let blocks = samples / block;
        if blocks < Self::MIN_BLOCKS {
            return Err(LiveError::TooFewReadings { blocks, block });
        }
        let parts = (0..Self::PARTS).map(|part| part * samples / Self::PARTS..(part + 1) * samples / Self::PARTS);
        let moments = parts.clone().map(|part| {
            let scaled = Mat::from_fn(part.len(), 1 + channels, |sample, column| {
                let channel = column.checked_sub(1);
                channel.map_or(1.0, |channel| scaled(part.start + sample, channel))
            });
            scaled.transpose() * &scaled
        });
        let moments: Vec<Mat<f64>> = moments.collect();
        let (_, factor) = factor_of(moments.iter()).ok_or(LiveError::NotFinite)?;
        (reference.block, reference.blocks, reference.factor) = (block, blocks, factor);
        let (mut block, mut held_out) = (Block::new(channels), vec![0.0; channels]);
        for (part, samples) in parts.enumerate() {
            let others = moments.iter().enumerate().filter(|(other, _)| *other != part);
            let (means, factor) = factor_of(others.map(|(_, moments)| moments)).ok_or(LiveError::NotFinite)?;
            for sample in samples {
                block.read(&reference, readings.row(sample));
                let centred = block.scaled.iter().zip(&means).map(|(scaled, mean)| scaled - mean);
                whiten(centred, &factor, &mut held_out);
                for (square, held_out) in block.squares.iter_mut().zip(&held_out) {
                    *square = square.max(held_out * held_out);
                }
                block.add();
                if block.count == reference.block {
                    for ([low, high], value) in reference.ranges.iter_mut().zip(block.finish()) {
                        (*low, *high) = (low.min(value), high.max(value));
                    }
                }
            }
        }
        for (index, range) in reference.ranges.iter_mut().enumerate() {
            *range = Statistic::at(index, channels).widened(*range);
        }
        Ok(reference)
    }

    fn scaled(&self, channel: usize, reading: f64) -> f64 {
        match self.inverse_deviations[channel] {
            0.0 => 0.0,
            inverse => ((reading - self.means[channel]) * inverse).clamp(-MAX_SCALED, MAX_SCALED),
        }
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.means.len()
    }

    /// Number of readings in a block: the monitor decides once per block.
    pub fn readings_per_block(&self) -> usize {
        self.block
    }

    /// Number m of consecutive blocks that begin or end a drift: the smallest for which the probability of a false alarm in
    /// a block is at most 1 / [`DriftMonitor::BLOCKS_BETWEEN_FALSE_ALARMS`].
    ///
    /// Let B be the number of training blocks. If B + m blocks are exchangeable, a statistic is larger in all of the last m
    /// than in the other B with probability 1 / C(B + m, m), and likewise smaller. The probabilities of all statistics add
    /// up (Bonferroni).
    pub fn blocks_in_a_row(&self) -> usize {
        // Squares are compared with the upper end only.
        let comparisons = (5 * self.channels() + 3) as f64;
        let (mut blocks, mut ways) = (0, 1.0);
        while ways < comparisons * DriftMonitor::BLOCKS_BETWEEN_FALSE_ALARMS {
            blocks += 1;
            ways *= (self.blocks + blocks) as f64 / blocks as f64;
        }
        blocks
    }

    /// Returns `true` if the parts, which may come from a file, fit together.
    pub fn is_valid(&self) -> bool {
        let (channels, factor) = (self.means.len(), &self.factor);
        let numbers = [&self.means, &self.inverse_deviations, factor].into_iter().flatten();
        let mut numbers = numbers.chain(self.ranges.iter().flatten());
        let mut diagonal = (0..channels).map(|row| row * (row + 3) / 2);
        let sizes = (self.inverse_deviations.len(), factor.len(), self.ranges.len());
        sizes == (channels, channels * (channels + 1) / 2, Statistic::count(channels))
            && numbers.all(|number| number.is_finite())
            && diagonal.all(|place| factor[place] > 0.0)
            && self.block > 0
            && self.blocks >= Self::MIN_BLOCKS
    }
}

/// Returns the mean of `readings` and the reciprocal of their standard deviation, which is 0 if they are constant; `None`
/// if they are not finite.
fn scale(readings: ArrayView1<'_, f64>) -> Option<(f64, f64)> {
    let mean = mean(readings);
    // Differences are exact in readings with a large offset, and 0 in constant ones.
    let deviation = root_mean_square(readings.iter().map(|reading| (reading - mean).abs()));
    let is_finite = readings.iter().all(|reading| reading.is_finite()) && mean.is_finite() && deviation.is_finite();
    let inverse = deviation.recip();
    // Infinite if all differences are 0, or too small to divide by.
    let inverse = if inverse.is_finite() { inverse } else { 0.0 };
    is_finite.then_some((mean, inverse))
}

/// Returns the means and the Cholesky factor of the regularised covariance of the readings with these `moments` XᵀX, where
/// the first column of X is 1.
fn factor_of<'a>(moments: impl Iterator<Item = &'a Mat<f64>>) -> Option<(Vec<f64>, Vec<f64>)> {
    let all = moments.cloned().reduce(|all, some| all + some)?;
    let channels = all.nrows() - 1;
    let means: Vec<f64> = (1..=channels).map(|channel| all[(channel, 0)] / all[(0, 0)]).collect();
    let covariance = Mat::from_fn(channels, channels, |row, column| {
        let product = all[(row + 1, column + 1)] / all[(0, 0)];
        product - means[row] * means[column] + if row == column { RIDGE } else { 0.0 }
    });
    let factor = covariance.llt(Side::Lower).ok()?;
    let lower = factor.L();
    let packed = (0..channels).flat_map(|row| (0..=row).map(move |column| lower[(row, column)]));
    Some((means, packed.collect()))
}

/// Solves L y = `scaled` for y, with the packed lower triangular matrix L.
fn whiten(scaled: impl Iterator<Item = f64>, factor: &[f64], whitened: &mut [f64]) {
    let mut row_of_factor = 0;
    for (row, scaled) in scaled.enumerate() {
        let factor = &factor[row_of_factor..=row_of_factor + row];
        let above: f64 = factor.iter().zip(&whitened[..row]).map(|(a, b)| a * b).sum();
        whitened[row] = (scaled - above) / factor[row];
        row_of_factor += row + 1;
    }
}

/// Readings that do not look like the training readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drift {
    /// Position of the first of these readings.
    pub first: u64,
    /// Position of the last of these readings so far.
    pub last: u64,
    /// `true` once the readings look like the training readings again.
    pub has_ended: bool,
    statistic: Statistic,
    is_larger: bool,
}

impl Drift {
    /// Describes the difference that was found first, for a network with these `inputs`.
    pub fn describe(&self, inputs: &[Channel]) -> String {
        let compared = |larger, smaller| if self.is_larger { larger } else { smaller };
        let name = |channel: usize| inputs.get(channel).map_or("an input", |input| &input.name);
        match self.statistic {
            Statistic::Variance(None) => format!("the inputs vary {} than in training", compared("more", "less")),
            Statistic::Variance(Some(channel)) => {
                format!("{} varies {} than in training", name(channel), compared("more", "less"))
            }
            Statistic::Mean(channel) => {
                let compared = compared("higher", "lower");
                format!("{} is {compared} on average than in training", name(channel))
            }
            Statistic::Square(None) => "the inputs are not related to each other as in training".to_owned(),
            Statistic::Square(Some(channel)) => {
                format!("{} is not related to the other inputs as in training", name(channel))
            }
        }
    }
}

/// Monitor that reports when readings no longer look like the training readings, so that the intervals of the network no
/// longer hold, and when they do so again.
///
/// A drift begins when one statistic is beyond all training blocks, on the same side, in
/// [`DriftReference::blocks_in_a_row`] consecutive blocks, and ends after as many blocks in which the statistics that
/// began it are within the training range. With exchangeable blocks, the expected number of false alarms is at most one in
/// [`Self::BLOCKS_BETWEEN_FALSE_ALARMS`] blocks; this takes the finite number of training blocks into account.
#[derive(Clone, Debug)]
pub struct DriftMonitor {
    reference: DriftReference,
    block: Block,
    /// Number of consecutive blocks up to the latest in which each statistic is below and above the training blocks.
    runs: Vec<[usize; 2]>,
    /// True for runs that have become long enough since the drift began.
    is_drifted: Vec<[bool; 2]>,
    /// Positions of the first readings of the latest blocks.
    begins: VecDeque<u64>,
    drift: Option<Drift>,
    /// Number of consecutive blocks without a sign of the drift.
    blocks_without: usize,
}

impl DriftMonitor {
    /// Lower bound on the mean number of blocks between false alarms.
    pub const BLOCKS_BETWEEN_FALSE_ALARMS: f64 = 10_000.0;

    /// Begins to compare readings with `reference`.
    pub fn new(reference: DriftReference) -> Self {
        let statistics = reference.ranges.len();
        Self {
            block: Block::new(reference.channels()),
            runs: vec![[0; 2]; statistics],
            is_drifted: vec![[false; 2]; statistics],
            begins: VecDeque::new(),
            drift: None,
            blocks_without: 0,
            reference,
        }
    }

    /// Takes the next readings, with their position such as the number of their line; further values, such as those of a
    /// memory, are ignored, and so are readings that are not finite. Returns a drift when it begins, and again when it ends.
    ///
    /// # Panics
    /// If there are fewer readings than channels.
    pub fn take(&mut self, position: u64, readings: &[f64]) -> Option<Drift> {
        let readings = &readings[..self.reference.channels()];
        if !readings.iter().all(|reading| reading.is_finite()) {
            return None;
        }
        if self.block.count == 0 {
            self.begins.push_back(position);
        }
        self.block.read(&self.reference, readings);
        self.block.add();
        if self.block.count < self.reference.block {
            return None;
        }
        let in_a_row = self.reference.blocks_in_a_row();
        if self.begins.len() > in_a_row {
            self.begins.pop_front();
        }
        let mut sign = None;
        for (index, (value, [low, high])) in self.block.finish().iter().zip(&self.reference.ranges).enumerate() {
            let (runs, is_drifted) = (&mut self.runs[index], &mut self.is_drifted[index]);
            for (side, is_beyond) in [value < low, value > high].into_iter().enumerate() {
                runs[side] = if is_beyond { runs[side] + 1 } else { 0 };
                is_drifted[side] |= runs[side] >= in_a_row;
                if is_beyond && is_drifted[side] {
                    sign.get_or_insert((index, side == 1));
                }
            }
        }
        let Some(drift) = &mut self.drift else {
            let (statistic, is_larger) = sign?;
            self.drift = Some(Drift {
                first: *self.begins.front()?,
                last: position,
                has_ended: false,
                statistic: Statistic::at(statistic, self.reference.channels()),
                is_larger,
            });
            return self.drift;
        };
        if sign.is_some() {
            drift.last = position;
            self.blocks_without = 0;
            return None;
        }
        self.blocks_without += 1;
        if self.blocks_without < in_a_row {
            return None;
        }
        self.blocks_without = 0;
        self.is_drifted.fill([false; 2]);
        drift.has_ended = true;
        self.drift.take()
    }

    /// Current drift; `None` as long as the readings look like the training readings.
    pub fn drift(&self) -> Option<&Drift> {
        self.drift.as_ref()
    }

    /// Description of the training readings.
    pub fn reference(&self) -> &DriftReference {
        &self.reference
    }
}

#[cfg(test)]
mod tests;
