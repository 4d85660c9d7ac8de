use std::collections::HashMap;

use ndarray::{ArrayView1, Axis};

use crate::dataset::Dataset;

/// Number of different values below which a channel is nearly dead.
const FEW_VALUES: usize = 12;
/// Share of the samples at one value above which a channel may be at rest.
const AT_REST: f64 = 0.5;
/// Shares of the samples at one value above which a channel with few values is left out, and one without any relation.
const AT_ONE_VALUE: (f64, f64) = (0.9, 0.99);

/// Returns the channels of `set` that should be left out: those with few different values that are nearly always at one of
/// them or have no relation to a target, and those that are hardly ever away from one value, without any relation. A channel
/// at the end of its range may wake in a later session, where a decoder that takes it in would answer anything. Sparse
/// channels, such as taxels that are rarely pressed, stay.
pub fn dead_channels(set: &Dataset) -> Vec<usize> {
    let readings = set.readings();
    let stuck = Vec::from_iter(readings.columns().into_iter().map(|readings| {
        let mut counts: HashMap<u64, usize> = HashMap::new();
        for value in readings {
            *counts.entry(value.to_bits()).or_default() += 1;
        }
        let most = counts.iter().max_by_key(|(bits, count)| (**count, **bits));
        let (&bits, &count) = most.expect("a set has samples");
        let has_few = counts.len() < FEW_VALUES.min(set.samples() / 2);
        (has_few, count as f64 / readings.len() as f64, f64::from_bits(bits))
    }));
    // Most channels of a skin are at rest while it is touched elsewhere.
    if 2 * stuck.iter().filter(|(_, share, _)| *share > AT_REST).count() > stuck.len() {
        return Vec::new();
    }
    let is_dead = |channel: &usize| {
        let (has_few, share, usual) = stuck[*channel];
        let is_suspect = has_few || share >= AT_ONE_VALUE.1;
        has_few && share >= AT_ONE_VALUE.0 || is_suspect && !is_related(set, readings.column(*channel), usual)
    };
    let dead = Vec::from_iter((0..set.channels()).filter(is_dead));
    if dead.len() < set.channels() { dead } else { Vec::new() }
}

/// Returns `true` if the mean of a target while the channel is away from its usual value differs from that of all samples by
/// more than three standard errors, or its variance is smaller by more than that, where each stretch away counts as one sample.
fn is_related(set: &Dataset, readings: ArrayView1<'_, f64>, usual: f64) -> bool {
    const DEVIATIONS: f64 = 3.0;
    let away = Vec::from_iter((0..readings.len()).filter(|&sample| readings[sample] != usual));
    let stretches = away.chunk_by(|one, next| one + 1 == *next).count().max(1) as f64;
    set.targets().columns().into_iter().any(|target| {
        let (mean, variance) = (target.mean().unwrap_or(0.0), target.var(0.0));
        let of_away = target.select(Axis(0), &away);
        let off = of_away.mean().unwrap_or(mean) - mean;
        off.abs() > DEVIATIONS * (variance / stretches).sqrt()
            || of_away.var(0.0) < variance * (1.0 - DEVIATIONS * (2.0 / stretches).sqrt())
    })
}
