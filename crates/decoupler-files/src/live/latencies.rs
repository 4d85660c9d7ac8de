use std::{fmt, time::Duration};

/// Histogram of latencies in fixed memory: bins of 1/32 of an octave, 2.2 % wide, from one microsecond upwards. The
/// maximum is stored exactly.
#[derive(Clone, Debug)]
pub struct Latencies {
    bins: Vec<u64>,
    count: u64,
    largest: Duration,
}

const BINS_PER_OCTAVE: f64 = 32.0;
/// Octaves above one microsecond: up to an hour.
const OCTAVES: usize = 32;

impl Default for Latencies {
    fn default() -> Self {
        Self {
            bins: vec![0; OCTAVES * BINS_PER_OCTAVE as usize + 1],
            count: 0,
            largest: Duration::ZERO,
        }
    }
}

impl Latencies {
    /// Counts the latency of a frame.
    pub fn add(&mut self, latency: Duration) {
        let micros = latency.as_secs_f64() * 1e6;
        let bin = (micros.max(1.0).log2() * BINS_PER_OCTAVE).ceil() as usize;
        let last = self.bins.len() - 1;
        self.bins[bin.min(last)] += 1;
        self.count += 1;
        self.largest = self.largest.max(latency);
    }

    /// Returns the number of frames counted.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns the largest latency.
    pub fn largest(&self) -> Duration {
        self.largest
    }

    /// Returns the quantile of the latencies for a `share` of the frames from 0 to 1, rounded up by at most 2.2 % and to
    /// at least one microsecond; `None` without frames.
    pub fn quantile(&self, share: f64) -> Option<Duration> {
        let rank = ((self.count as f64 * share).ceil() as u64).clamp(1, self.count.max(1));
        let mut below = 0;
        let bin = self.bins.iter().position(|count| {
            below += count;
            below >= rank
        })?;
        let upper = Duration::from_secs_f64((bin as f64 / BINS_PER_OCTAVE).exp2() * 1e-6);
        Some(upper.min(self.largest))
    }
}

impl fmt::Display for Latencies {
    /// Formats median, 99th percentile and maximum in milliseconds.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let millis = |duration: Duration| duration.as_secs_f64() * 1e3;
        match self.quantile(0.5).zip(self.quantile(0.99)) {
            Some((median, high)) => write!(
                f,
                "latency p50 {:.3} ms, p99 {:.3} ms, max {:.3} ms",
                millis(median),
                millis(high),
                millis(self.largest)
            ),
            None => write!(f, "no latency"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_match_sorted_latencies() {
        let micros = |k: u64| 3 + (k * k * 7919) % 1_000_003;
        let mut latencies = Latencies::default();
        let mut sorted: Vec<u64> = (0..10_000).map(micros).collect();
        sorted
            .iter()
            .for_each(|&micros| latencies.add(Duration::from_micros(micros)));
        sorted.sort_unstable();
        for (share, index) in [(0.5, 4999), (0.99, 9899), (0.0001, 0)] {
            let found = latencies.quantile(share).unwrap().as_secs_f64() * 1e6;
            let ratio = found / sorted[index] as f64;
            assert!((0.999..1.023).contains(&ratio), "{share}: {found}");
        }
        assert_eq!(latencies.largest(), Duration::from_micros(sorted[9999]));
        assert_eq!(latencies.quantile(1.0), Some(latencies.largest()));
    }

    #[test]
    fn empty_and_extreme_latencies_are_formatted() {
        let mut latencies = Latencies::default();
        assert_eq!(
            (latencies.quantile(0.5), latencies.to_string()),
            (None, "no latency".to_owned())
        );
        latencies.add(Duration::ZERO);
        latencies.add(Duration::from_secs(1 << 40));
        assert_eq!(latencies.quantile(0.5), Some(Duration::from_micros(1)));
        assert_eq!(latencies.largest(), Duration::from_secs(1 << 40));
    }
}
