use std::{collections::VecDeque, time::Instant};

use super::Lines;

/// Lines one after the other in one buffer.
#[derive(Debug, Default)]
pub(super) struct Batch {
    pub(super) bytes: Vec<u8>,
    pub(super) lines: VecDeque<Entry>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) number: u64,
    /// Place in the bytes; `None` for a line that is too long.
    pub(super) place: Option<(usize, usize)>,
    /// True if it looks like names of columns.
    pub(super) has_names: bool,
    pub(super) read_at: Instant,
}

impl Batch {
    /// Drops all but the newest `kept` lines if the oldest has waited too long; returns how many. The latest names of
    /// columns stay: without them the lines that follow would be taken for others.
    pub(super) fn drop_old(&mut self, now: Instant, kept: usize) -> u64 {
        let is_old = |entry: &Entry| now.saturating_duration_since(entry.read_at) > Lines::PATIENCE;
        if !self.lines.front().is_some_and(is_old) || self.lines.len() <= kept {
            return 0;
        }
        let mut dropped = self.lines.len() - kept;
        let mut drained: Vec<Entry> = self.lines.drain(..dropped).collect();
        if let Some(names) = drained.iter().rposition(|entry| entry.has_names) {
            self.lines.push_front(drained.swap_remove(names));
            dropped -= 1;
        }
        // The bytes of the others go at once, so that the buffer never grows beyond what waits.
        let mut bytes = Vec::with_capacity(self.bytes.len());
        for (from, to) in self.lines.iter_mut().filter_map(|entry| entry.place.as_mut()) {
            let start = bytes.len();
            bytes.extend_from_slice(&self.bytes[*from..*to]);
            (*from, *to) = (start, bytes.len());
        }
        self.bytes = bytes;
        dropped as u64
    }
}

/// Splits chunks of bytes into lines.
#[derive(Debug, Default)]
pub(super) struct Splitter {
    /// Beginning of a line whose end has not come.
    partial: Vec<u8>,
    is_too_long: bool,
    number: u64,
    skips_first: bool,
}

impl Splitter {
    /// With `skips_first` the first line is left out, unless it is empty or begins as names do.
    pub(super) fn new(skips_first: bool) -> Self {
        Self {
            skips_first,
            ..Self::default()
        }
    }

    pub(super) fn split(&mut self, mut bytes: &[u8], read_at: Instant, batch: &mut Batch) {
        while let Some(end) = bytes.iter().position(|&byte| byte == b'\n') {
            self.extend(&bytes[..end]);
            bytes = &bytes[end + 1..];
            self.end_line(read_at, batch);
        }
        self.extend(bytes);
    }

    /// Gives the last line, if it has no line break.
    pub(super) fn finish(&mut self, read_at: Instant, batch: &mut Batch) {
        if self.is_too_long || !self.partial.is_empty() {
            self.end_line(read_at, batch);
        }
    }

    fn extend(&mut self, bytes: &[u8]) {
        if self.partial.len() + bytes.len() >= Lines::LONGEST {
            self.is_too_long = true;
        }
        if self.is_too_long {
            self.partial.clear();
        } else {
            self.partial.extend_from_slice(bytes);
        }
    }

    fn end_line(&mut self, read_at: Instant, batch: &mut Batch) {
        self.number += 1;
        let begins_as_names = |text: &[u8]| {
            text.first()
                .is_none_or(|first| first.is_ascii_alphabetic() || *first == b'"')
        };
        let is_skipped = self.number == 1 && self.skips_first && !begins_as_names(self.partial.trim_ascii());
        if !is_skipped {
            let has_names = begins_as_names(self.partial.trim_ascii()) && self.partial.contains(&b',');
            let start = batch.bytes.len();
            batch.bytes.extend_from_slice(&self.partial);
            batch.lines.push_back(Entry {
                number: self.number,
                place: (!self.is_too_long).then_some((start, batch.bytes.len())),
                has_names: has_names && !self.is_too_long,
                read_at,
            });
        }
        self.partial.clear();
        self.is_too_long = false;
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn names_of_columns_are_not_dropped() {
        let start = Instant::now();
        let mut batch = Batch::default();
        let mut splitter = Splitter::default();
        splitter.split(b"r_2,r_1\n1,2\n3,4\n5,6\n", start, &mut batch);
        assert_eq!(batch.drop_old(start + Duration::from_millis(101), 1), 2);
        let texts = batch.lines.iter().map(|entry| {
            let (from, to) = entry.place.unwrap();
            String::from_utf8_lossy(&batch.bytes[from..to]).into_owned()
        });
        assert!(texts.eq(["r_2,r_1", "5,6"]));
    }

    #[test]
    fn the_latest_lines_win_once_the_oldest_is_too_old() {
        let start = Instant::now();
        let after = |millis| start + Duration::from_millis(millis);
        let mut batch = Batch::default();
        let mut splitter = Splitter::default();
        for k in 0..10 {
            splitter.split(format!("line {k}\n").as_bytes(), after(k), &mut batch);
        }
        assert_eq!(batch.drop_old(after(100), 3), 0);
        assert_eq!(batch.drop_old(after(101), 3), 7);
        let texts = batch.lines.iter().map(|entry| {
            let (from, to) = entry.place.unwrap();
            String::from_utf8_lossy(&batch.bytes[from..to]).into_owned()
        });
        assert!(texts.eq(["line 7", "line 8", "line 9"]));
        assert_eq!(batch.drop_old(after(500), 3), 0);
        assert_eq!(batch.bytes.len(), 18);
    }
}
