use std::time::{Duration, Instant};

use super::Latencies;

/// Number of answers and their times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Counts {
    /// Lines, samples or frames decoded.
    pub decoded: u64,
    /// The same per second, recently.
    pub frames_per_second: f64,
    /// Median and 99th percentile of the time from reading a frame to its answer.
    pub latency: Option<[Duration; 2]>,
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
}

/// Counts frames, and the errors of their answers, over spans of about half a second.
#[derive(Debug)]
pub(super) struct Tally {
    pub(super) counts: Counts,
    pub(super) latencies: Latencies,
    span: Span,
    /// Mean error over the last whole span, in millimetres.
    error_mm: Option<f64>,
    /// Time at which the last frame arrived, or counting began.
    last: Instant,
}

#[derive(Debug)]
struct Span {
    begun: Instant,
    frames: u32,
    errors: u32,
    error_sum_mm: f64,
}

/// Length of a span.
const SPAN: Duration = Duration::from_millis(500);
/// Time without a frame after which a source counts as silent.
const SILENCE: Duration = Duration::from_secs(2);

impl Tally {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            counts: Counts::default(),
            latencies: Latencies::default(),
            span: Span::new(now),
            error_mm: None,
            last: now,
        }
    }

    /// Counts an answer that was given `now`, with its error in millimetres if that is known.
    pub(super) fn good(&mut self, read_at: Instant, now: Instant, error_mm: Option<f64>) {
        self.counts.decoded += 1;
        self.counts.is_waiting = false;
        self.latencies.add(now.saturating_duration_since(read_at));
        self.last = now;
        let span = &mut self.span;
        span.frames += 1;
        if let Some(error_mm) = error_mm {
            span.errors += 1;
            span.error_sum_mm += error_mm;
        }
        let length = now.saturating_duration_since(span.begun);
        if length >= SPAN {
            self.counts.frames_per_second = f64::from(span.frames) / length.as_secs_f64();
            self.error_mm = (span.errors > 0).then(|| span.error_sum_mm / f64::from(span.errors));
            *span = Span::new(now);
        }
    }

    pub(super) fn bad(&mut self, reason: &str) {
        self.counts.bad += 1;
        self.counts.first_bad.get_or_insert_with(|| reason.to_owned());
        self.counts.last_bad = Some(reason.to_owned());
    }

    /// Returns `true` once, when no frame has come for [`SILENCE`].
    pub(super) fn falls_silent(&mut self, now: Instant) -> bool {
        let is_silent = now.saturating_duration_since(self.last) >= SILENCE;
        if is_silent && !self.counts.is_waiting {
            self.counts.frames_per_second = 0.0;
            self.span = Span::new(now);
            self.counts.is_waiting = true;
            return true;
        }
        false
    }

    /// Returns the mean error of the recent answers, in millimetres.
    pub(super) fn error_mm(&self) -> Option<f64> {
        self.error_mm
    }

    pub(super) fn counts(&self) -> Counts {
        let quantile = |share| self.latencies.quantile(share);
        Counts {
            latency: quantile(0.5).zip(quantile(0.99)).map(|(median, high)| [median, high]),
            ..self.counts.clone()
        }
    }
}

impl Span {
    fn new(begun: Instant) -> Self {
        Self {
            begun,
            frames: 0,
            errors: 0,
            error_sum_mm: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_and_error_are_those_of_the_last_half_second() {
        let start = Instant::now();
        let after = |millis| start + Duration::from_millis(millis);
        let mut tally = Tally::new(start);
        assert_eq!((tally.counts(), tally.error_mm()), (Counts::default(), None));
        (1..=50).for_each(|k| tally.good(after(10 * k - 2), after(10 * k), Some(0.1)));
        (51..=75).for_each(|k| tally.good(after(20 * k - 502), after(20 * k - 500), Some(0.3)));
        let counts = tally.counts();
        assert_eq!((counts.decoded, counts.frames_per_second), (75, 50.0));
        assert!((tally.error_mm().unwrap() - 0.3).abs() < 1e-12);
        let [median, high] = counts.latency.unwrap();
        assert!(median == high && (2.0..2.1).contains(&(median.as_secs_f64() * 1e3)));
    }

    #[test]
    fn silence_is_reported_once_and_ends_with_a_frame() {
        let start = Instant::now();
        let mut tally = Tally::new(start);
        assert!(!tally.falls_silent(start + Duration::from_secs(1)));
        assert!(tally.falls_silent(start + SILENCE) && !tally.falls_silent(start + 2 * SILENCE));
        let now = start + 2 * SILENCE;
        tally.good(now, now, None);
        assert!(!tally.counts().is_waiting && tally.falls_silent(now + SILENCE));
    }
}
