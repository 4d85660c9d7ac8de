use std::{
    fmt,
    time::{Duration, Instant},
};

/// Number of answers and their times; rate and error are those of the last half second.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Lines, samples or frames decoded.
    pub decoded: u64,
    /// The same per second, recently.
    pub frames_per_second: f64,
    /// Times from reading a frame to its answer.
    pub latencies: Latencies,
    /// Frames, or lines of a device, dropped in favour of newer ones.
    pub dropped: u64,
    /// Malformed lines, and frames that could not be decoded.
    pub bad: u64,
    /// Reason for the first of them.
    pub first_bad: Option<String>,
    /// Reason for the last of them.
    pub last_bad: Option<String>,
    /// True if no frame has arrived for a while.
    pub is_waiting: bool,
    /// Mean error of the recent answers in millimetres, if the truth is known.
    pub error_mm: Option<f64>,
    /// Time of the last frame, or at which it was first asked for silence.
    last: Option<Instant>,
    /// Beginning of the current span, and its frames.
    begun: Option<Instant>,
    frames: u32,
    /// Number of errors in this span, and their sum in millimetres.
    errors: (u32, f64),
}

/// Length of a span.
const SPAN: Duration = Duration::from_millis(500);
/// Time without a frame after which a source counts as silent.
const SILENCE: Duration = Duration::from_secs(2);

impl Tally {
    /// Counts an answer that was given `now`, with its error in millimetres if that is known.
    pub(super) fn good(&mut self, read_at: Instant, now: Instant, error_mm: Option<f64>) {
        self.decoded += 1;
        self.is_waiting = false;
        self.latencies.add(now.saturating_duration_since(read_at));
        self.last = Some(now);
        let length = now.saturating_duration_since(*self.begun.get_or_insert(now));
        // A frame with which a span begins is not in it.
        self.frames += u32::from(!length.is_zero());
        if let Some(error_mm) = error_mm {
            self.errors = (self.errors.0 + 1, self.errors.1 + error_mm);
        }
        if length >= SPAN {
            self.frames_per_second = f64::from(self.frames) / length.as_secs_f64();
            let (errors, sum_mm) = self.errors;
            self.error_mm = (errors > 0).then(|| sum_mm / f64::from(errors));
            (self.begun, self.frames, self.errors) = (Some(now), 0, (0, 0.0));
        }
    }

    pub(super) fn bad(&mut self, reason: &str) {
        self.bad += 1;
        self.first_bad.get_or_insert_with(|| reason.to_owned());
        self.last_bad = Some(reason.to_owned());
    }

    /// Returns `true` once, when no frame has come for two seconds.
    pub fn falls_silent(&mut self, now: Instant) -> bool {
        let last = *self.last.get_or_insert(now);
        let falls = !self.is_waiting && now.saturating_duration_since(last) >= SILENCE;
        if falls {
            (self.frames_per_second, self.is_waiting) = (0.0, true);
            (self.begun, self.frames, self.errors) = (None, 0, (0, 0.0));
        }
        falls
    }
}

/// Histogram of latencies in fixed memory: bins of 1/32 of an octave, 2.2 % wide, from one microsecond upwards. The
/// maximum is stored exactly.
#[derive(Clone, Debug, Default)]
pub struct Latencies {
    /// Empty before the first.
    bins: Vec<u64>,
    count: u64,
    largest: Duration,
}

const BINS_PER_OCTAVE: f64 = 32.0;
/// Octaves above one microsecond: up to an hour.
const OCTAVES: usize = 32;

impl Latencies {
    /// Counts the latency of a frame.
    pub fn add(&mut self, latency: Duration) {
        let last = OCTAVES * BINS_PER_OCTAVE as usize;
        self.bins.resize(last + 1, 0);
        let micros = latency.as_secs_f64() * 1e6;
        let bin = (micros.max(1.0).log2() * BINS_PER_OCTAVE).ceil() as usize;
        self.bins[bin.min(last)] += 1;
        self.count += 1;
        self.largest = self.largest.max(latency);
    }

    /// Returns the quantile of the latencies for a `share` of the frames from 0 to 1, rounded up by at most 2.2 % and to
    /// at least one microsecond; `None` without frames.
    pub fn quantile(&self, share: f64) -> Option<Duration> {
        let rank = ((self.count as f64 * share).ceil() as u64).max(1);
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
        let Some((median, high)) = self.quantile(0.5).zip(self.quantile(0.99)) else {
            return write!(f, "no latency");
        };
        let [median, high, largest] = [median, high, self.largest].map(|latency| latency.as_secs_f64() * 1e3);
        write!(f, "latency p50 {median:.3} ms, p99 {high:.3} ms, max {largest:.3} ms")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_and_error_are_those_of_the_last_half_second() {
        let start = Instant::now();
        let after = |millis| start + Duration::from_millis(millis);
        let mut tally = Tally::default();
        (0..=50).for_each(|k| tally.good(after(10 * k), after(10 * k + 2), Some(0.1)));
        assert_eq!(tally.frames_per_second, 100.0);
        (51..=75).for_each(|k| tally.good(after(20 * k - 500), after(20 * k - 498), Some(0.3)));
        assert_eq!((tally.decoded, tally.frames_per_second), (76, 50.0));
        assert!((tally.error_mm.unwrap() - 0.3).abs() < 1e-12);
        let [median, high] = [0.5, 0.99].map(|share| tally.latencies.quantile(share).unwrap());
        assert!(median == high && (2.0..2.1).contains(&(median.as_secs_f64() * 1e3)));
    }

    #[test]
    fn silence_is_reported_once_and_ends_with_a_frame() {
        let start = Instant::now();
        let mut tally = Tally::default();
        assert!(!tally.falls_silent(start) && !tally.falls_silent(start + Duration::from_secs(1)));
        assert!(tally.falls_silent(start + SILENCE) && !tally.falls_silent(start + 2 * SILENCE));
        let now = start + 2 * SILENCE;
        tally.good(now, now, None);
        assert!(!tally.is_waiting && tally.falls_silent(now + SILENCE));
    }

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
        assert_eq!(latencies.quantile(1.0), Some(Duration::from_micros(sorted[9999])));
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
        assert!(
            latencies
                .to_string()
                .ends_with(&format!("max {}000.000 ms", 1_u64 << 40))
        );
    }
}
