use ndarray::Axis;

use super::{super::errors::varies, AutoSamples};
use crate::{
    dataset::{Dataset, History, Memory, Span},
    numerics::{autocorrelation, median},
};

/// Shortest time constant in samples.
const SHORTEST: f64 = 2.0;

/// Returns memories to try: exponential averages with time constants around the correlation time T of the targets, the
/// lag at which their autocorrelation falls to 1/e. Sensors that forget within a sample, or drift over the whole
/// recording, are covered by the shortest and the longest.
pub(super) fn memories(samples: &AutoSamples<'_>) -> Vec<Memory> {
    let Some((history, of_history)) = samples.past else {
        return Vec::new();
    };
    let longest = samples.set.samples() as f64 / 10.0;
    let correlation =
        correlation_time(samples.set, history, of_history).clamp(2.0 * SHORTEST, longest.max(2.0 * SHORTEST));
    let interval_s = history.interval_s();
    let span = |length: f64| match interval_s {
        Some(interval_s) => Span::Seconds(rounded(length * interval_s)),
        None => Span::Samples(length.round()),
    };
    let factors: [&[f64]; 4] = [&[0.25, 1.0], &[1.0, 4.0], &[4.0, 16.0], &[0.125, 0.5, 2.0]];
    let mut memories: Vec<Memory> = Vec::new();
    for factors in factors {
        let length = |factor: &f64| (factor * correlation).clamp(SHORTEST, longest.max(SHORTEST));
        let mut lengths = Vec::from_iter(factors.iter().map(length));
        lengths.dedup();
        let memory = Memory {
            averages: lengths.into_iter().map(span).collect(),
            interval_s,
            ..Memory::default()
        };
        if !memories.contains(&memory) {
            memories.push(memory);
        }
    }
    memories
}

/// Rounds to two significant digits.
fn rounded(value: f64) -> f64 {
    let unit = 10.0_f64.powf(value.log10().floor() - 1.0);
    // Division by a power of ten gives the nearest double of the decimal.
    if unit >= 1.0 {
        (value / unit).round() * unit
    } else {
        (value / unit).round() / (1.0 / unit).round()
    }
}

/// Median over the targets of the lag in samples at which the autocorrelation falls to 1/e, with stretches one after the
/// other.
fn correlation_time(set: &Dataset, history: &History, samples: &[usize]) -> f64 {
    let row = |sample: usize| history.samples()[samples[sample]];
    let stretches = history.stretches();
    // Rows of groups whose times overlap are interleaved.
    let count = set.samples();
    let mut order = Vec::from_iter(0..count);
    order.sort_by_key(|&sample| (stretches[row(sample)], row(sample)));
    let mut times: Vec<f64> = Vec::new();
    for column in set.targets().columns() {
        if !varies(column) {
            continue;
        }
        let values = column.select(Axis(0), &order);
        let is_alike = |lag| autocorrelation(values.view(), lag).is_some_and(|found| found > (-1.0_f64).exp());
        let mut lag = 1;
        while lag < count / 4 && is_alike(lag) {
            lag += 1 + lag / 5;
        }
        times.push(lag as f64);
    }
    if times.is_empty() { 1.0 } else { median(times) }
}
