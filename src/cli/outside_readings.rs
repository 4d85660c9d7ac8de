use std::io::{Write, stderr};

use crate::network::{DecouplingNetwork, ReadingRange};

/// Lines that are told one by one; a damaged file may have thousands.
const MOST_TOLD: usize = 10;

/// Readings outside the range seen in training, counted line by line.
#[derive(Default)]
pub(super) struct OutsideReadings {
    lines: usize,
    outside: usize,
    told: Vec<String>,
}

impl OutsideReadings {
    /// Counts the readings of a line that are outside; `None` if the range of `network` is not known.
    pub(super) fn count(&mut self, network: &DecouplingNetwork, line: u64, readings_ohm: &[f64]) -> Option<usize> {
        let inputs = network.inputs();
        let range = inputs.range()?;
        self.lines += 1;
        let mut channels = range.outside(inputs.quantity(), readings_ohm);
        let Some(first) = channels.next() else { return Some(0) };
        let others = channels.count();
        self.outside += 1;
        if self.told.len() < MOST_TOLD {
            self.told
                .push(describe(range, line, first, readings_ohm[first], others));
        }
        Some(1 + others)
    }

    /// Warns of them on standard error.
    pub(super) fn warn(&self) {
        let Self { lines, outside, told } = self;
        if *outside == 0 {
            return;
        }
        let mut stderr = stderr().lock();
        for line in told {
            // Nobody is left to tell if this fails.
            let _ = writeln!(stderr, "warning: {line}");
        }
        let _ = writeln!(
            stderr,
            "warning: {outside} of {lines} lines have readings far outside the range seen in training, where the network \
             only guesses: the column readings_outside has their number; check these readings, or train with a scene \
             that has them"
        );
    }
}

fn describe(range: &ReadingRange, line: u64, channel: usize, reading_ohm: f64, others: usize) -> String {
    let (low, high) = range.extremes(channel);
    let more = match others {
        0 => String::new(),
        others => format!(", and {others} more"),
    };
    format!(
        "line {line}: r_{} is {reading_ohm:?} ohm; in training it was from {low:.4e} to {high:.4e}{more}",
        channel + 1
    )
}
