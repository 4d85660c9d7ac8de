use super::AutoSamples;
use crate::dataset::{Memory, Span};

/// Returns memories to try: exponential averages with time constants from a few samples to a tenth of the recording, since
/// some sensors forget within a moment and others creep for hours.
pub(super) fn memories(samples: &AutoSamples<'_>, differences: bool) -> Vec<Memory> {
    /// Shortest time constant in samples.
    const SHORTEST: f64 = 3.0;
    /// Number of time constants, spread evenly in their logarithm.
    const CONSTANTS: i32 = 5;
    let Some((history, _)) = samples.past else {
        return Vec::new();
    };
    let interval_s = history.interval_s();
    let ratio = (samples.set.samples() as f64 / 10.0 / SHORTEST).max(2.0);
    let span = |place: i32| {
        let length = SHORTEST * ratio.powf(f64::from(place) / f64::from(CONSTANTS - 1));
        match interval_s {
            // Two significant digits.
            Some(interval_s) => Span::Seconds(format!("{:.1e}", length * interval_s).parse().expect("a number")),
            None => Span::Samples(length.round()),
        }
    };
    let sets: [&[i32]; 5] = [&[0, 1], &[1, 2], &[2, 3], &[3, 4], &[0, 2, 4]];
    let memory = |places: &[i32]| Memory {
        averages: places.iter().map(|place| span(*place)).collect(),
        differences,
        interval_s,
        ..Memory::default()
    };
    sets.into_iter().map(memory).collect()
}
