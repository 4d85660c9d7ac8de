//! Timing of closures.

use std::{hint::black_box, time::Instant};

/// Returns the time of `work` in milliseconds.
pub(crate) fn time_ms<T>(work: impl FnOnce() -> T) -> f64 {
    let begun = Instant::now();
    black_box(work());
    begun.elapsed().as_secs_f64() * 1e3
}

/// Returns the median of some times.
pub(crate) fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}
