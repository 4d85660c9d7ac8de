use std::{
    fmt::Display,
    io::{Write, stderr},
    time::{Duration, Instant},
};

use super::failure::Failure;
use decoupler_core::live::{Latencies, Source};

/// Counts of what came, and messages on standard error.
pub(super) struct Report {
    source: Source,
    begin: Instant,
    last: Instant,
    latencies: Latencies,
    bad: u64,
    /// Reason of the first bad line.
    first_bad: Option<String>,
    /// Bad lines that were not told.
    untold: u64,
    last_told: Instant,
}

/// Bad lines that are told one by one; after them at most one a second.
const TOLD: u64 = 10;
const BETWEEN_TOLD: Duration = Duration::from_secs(1);

impl Report {
    pub(super) fn new(source: Source) -> Self {
        let now = Instant::now();
        Self {
            source,
            begin: now,
            last: now,
            latencies: Latencies::default(),
            bad: 0,
            first_bad: None,
            untold: 0,
            last_told: now,
        }
    }

    pub(super) fn source(&self) -> &Source {
        &self.source
    }

    /// Counts an answer that was flushed so long after its line was read.
    pub(super) fn good(&mut self, latency: Duration) {
        self.latencies.add(latency);
    }

    /// Counts a bad line and reports it, unless many were told.
    pub(super) fn bad(&mut self, reason: &dyn Display) {
        self.bad += 1;
        self.first_bad.get_or_insert_with(|| reason.to_string());
        if self.bad > TOLD && self.last_told.elapsed() < BETWEEN_TOLD {
            self.untold += 1;
            return;
        }
        self.last_told = Instant::now();
        let mut stderr = stderr().lock();
        // There is no one to report to if writing fails.
        let _ = match self.untold {
            0 => writeln!(stderr, "warning: {reason}"),
            untold => writeln!(
                stderr,
                "warning: {reason} ({untold} other bad lines since the last message)"
            ),
        };
        self.untold = 0;
        if let Source::Serial { baud, .. } = self.source
            && self.bad == TOLD
            && self.latencies.count() == 0
        {
            let _ = writeln!(
                stderr,
                "warning: none of the first {TOLD} lines is a frame: is {baud} the baud rate at which the device sends?"
            );
        }
    }

    /// Returns `true` once every so often.
    pub(super) fn is_due(&mut self, every: Duration) -> bool {
        let is_due = self.last.elapsed() >= every;
        if is_due {
            self.last = Instant::now();
        }
        is_due
    }

    /// Result at the end of the source.
    ///
    /// # Errors
    /// If not one line was decoded.
    pub(super) fn end(&self) -> Result<(), Failure> {
        if self.latencies.count() > 0 {
            return Ok(());
        }
        let reason = self.first_bad.clone();
        Err(Failure::NothingDecoded {
            input: self.source.clone(),
            reason: reason.unwrap_or_else(|| "it has no line of readings".to_owned()),
        })
    }

    /// Tells the counts and latencies so far.
    pub(super) fn tell(&self, dropped: u64) {
        let (decoded, seconds) = (self.latencies.count(), self.begin.elapsed().as_secs_f64());
        let (rate, bad, latencies) = (decoded as f64 / seconds.max(1e-9), self.bad, &self.latencies);
        // There is no one to report to if this fails.
        let _ = writeln!(
            stderr(),
            "{decoded} lines decoded in {seconds:.1} s ({rate:.0} a second), {bad} bad, {dropped} dropped; {latencies}"
        );
    }
}
