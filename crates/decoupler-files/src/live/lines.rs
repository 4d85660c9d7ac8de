use std::{
    collections::VecDeque,
    io::{self, ErrorKind, Read},
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use crate::import::LONGEST_LINE;

/// Lines of a source, read on a separate thread as they arrive.
///
/// Every line of a file or pipe is returned, and reading pauses while lines are waiting. A device or socket cannot be
/// paused: once a line has waited for [`Lines::PATIENCE`], the oldest lines are dropped and counted, and the number of
/// newest lines set by [`Lines::set_kept`] is kept. Buffers are reused, so that nothing is allocated in steady state.
#[derive(Debug)]
pub struct Lines {
    shared: Arc<Shared>,
    keeping: Keeping,
    /// Lines taken from the reader, not yet returned.
    batch: Batch,
}

/// A line, its number and its time of arrival.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line<'a> {
    /// Number in the source, from 1; dropped lines are counted.
    pub number: u64,
    /// Bytes without LF; `None` if the line is longer than [`Lines::LONGEST`].
    pub text: Option<&'a [u8]>,
    /// Time when its last byte was read.
    pub read_at: Instant,
}

/// Result of [`Lines::next`].
#[derive(Debug)]
pub enum NextLine<'a> {
    /// A line.
    Line(Line<'a>),
    /// No line arrived before the timeout.
    None,
    /// The source has ended, with an error unless it ended normally.
    End(Option<io::Error>),
}

/// Overflow policy for lines that arrive faster than they are consumed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeping {
    /// Keep all lines and pause reading.
    All,
    /// Keep only the latest lines.
    Latest,
}

#[derive(Debug)]
struct Shared {
    state: Mutex<State>,
    /// Notified when lines arrive or the source ends.
    filled: Condvar,
    /// Notified when lines are taken.
    emptied: Condvar,
}

#[derive(Debug)]
struct State {
    keeping: Keeping,
    kept: usize,
    waiting: Batch,
    dropped: u64,
    /// Bytes that have arrived since the last end of a line.
    unended: usize,
    end: Option<Option<io::Error>>,
    /// True once the [`Lines`] are dropped.
    is_abandoned: bool,
}

/// Maximum number of bytes read at once. With [`Keeping::All`] no more are read before these are taken, because waiting
/// lines become stale.
const CHUNK: usize = 1 << 14;

impl Lines {
    /// Waiting time after which a line is too old with [`Keeping::Latest`]: longer than the scheduling delays of a busy
    /// machine.
    pub const PATIENCE: Duration = Duration::from_millis(100);
    /// Maximum length of a line in bytes, including its line break: 1 MiB, as for any file of readings.
    pub const LONGEST: usize = LONGEST_LINE;

    /// Starts reading `source`. With `skips_first` its first line is skipped unless it is empty or begins with a letter
    /// or a quote, like a header: reading from a device may begin in the middle of a line.
    ///
    /// # Errors
    /// If the operating system cannot create a thread.
    pub fn spawn(source: impl Read + Send + 'static, keeping: Keeping, skips_first: bool) -> io::Result<Self> {
        let shared = Arc::new(Shared {
            state: Mutex::new(State {
                keeping,
                kept: 1,
                waiting: Batch::default(),
                dropped: 0,
                unended: 0,
                end: None,
                is_abandoned: false,
            }),
            filled: Condvar::new(),
            emptied: Condvar::new(),
        });
        let reader = Arc::clone(&shared);
        thread::Builder::new().name("lines".to_owned()).spawn(move || {
            // A panic of a driver must not look like a source without lines.
            let read = catch_unwind(AssertUnwindSafe(|| reader.read(source, skips_first)));
            let end = read.unwrap_or_else(|_| Err(io::Error::other("an internal error stopped the reading")));
            let mut state = reader.lock();
            state.end = Some(end.err());
            reader.filled.notify_one();
        })?;
        Ok(Self {
            shared,
            keeping,
            batch: Batch::default(),
        })
    }

    /// Sets the number of newest lines kept when older ones are dropped: those of a whole snapshot.
    pub fn set_kept(&mut self, lines: usize) {
        self.shared.lock().kept = lines.max(1);
    }

    /// Number of lines dropped so far.
    pub fn dropped(&self) -> u64 {
        self.shared.lock().dropped
    }

    /// Number of bytes that have arrived since the last end of a line.
    pub fn unended(&self) -> usize {
        self.shared.lock().unended
    }

    /// Returns `true` if no line is waiting.
    pub fn is_empty(&self) -> bool {
        self.batch.lines.is_empty() && self.shared.lock().waiting.lines.is_empty()
    }

    /// Waits for the next line, up to `timeout`.
    pub fn next(&mut self, timeout: Duration) -> NextLine<'_> {
        if self.batch.lines.is_empty() {
            self.batch.bytes.clear();
            let mut state = self.shared.lock();
            if state.waiting.lines.is_empty() && state.end.is_none() {
                let waited = self.shared.filled.wait_timeout(state, timeout);
                state = waited.unwrap_or_else(PoisonError::into_inner).0;
            }
            if state.waiting.lines.is_empty() {
                return match state.end.take() {
                    Some(end) => {
                        state.end = Some(None);
                        NextLine::End(end)
                    }
                    None => NextLine::None,
                };
            }
            std::mem::swap(&mut self.batch, &mut state.waiting);
            self.shared.emptied.notify_one();
        }
        self.drop_old(Instant::now());
        match self.batch.lines.pop_front() {
            Some(Entry {
                number, place, read_at, ..
            }) => NextLine::Line(Line {
                number,
                text: place.map(|(start, end)| &self.batch.bytes[start..end]),
                read_at,
            }),
            None => NextLine::None,
        }
    }

    /// Drops lines that have waited too long, if there are newer ones.
    fn drop_old(&mut self, now: Instant) {
        // A lock per line would wait for the reader, which holds it most of the time when lines arrive fast.
        if self.keeping == Keeping::Latest && self.batch.is_old(now) {
            let mut state = self.shared.lock();
            let kept = state.kept.saturating_sub(state.waiting.lines.len()).max(1);
            state.dropped += self.batch.drop_old(now, kept);
        }
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        self.shared.lock().is_abandoned = true;
        self.shared.emptied.notify_one();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Nothing panics while the lock is held, and the state would still be valid if it did.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads lines until the source ends or the receiver is dropped.
    fn read(&self, mut source: impl Read, skips_first: bool) -> io::Result<()> {
        let mut chunk = vec![0; CHUNK];
        let mut splitter = Splitter::new(skips_first);
        let mut arrived = Batch::default();
        loop {
            let count = match source.read(&mut chunk) {
                Ok(count) => count,
                Err(error)
                    if matches!(
                        error.kind(),
                        ErrorKind::Interrupted | ErrorKind::TimedOut | ErrorKind::WouldBlock
                    ) =>
                {
                    if self.lock().is_abandoned {
                        return Ok(());
                    }
                    continue;
                }
                Err(error) => return Err(error),
            };
            let read_at = Instant::now();
            // Without the lock, for which the receiver would wait.
            match count {
                0 => splitter.finish(read_at, &mut arrived),
                _ => splitter.split(&chunk[..count], read_at, &mut arrived),
            }
            let mut state = self.lock();
            while state.keeping == Keeping::All && !state.waiting.lines.is_empty() && !state.is_abandoned {
                state = self.emptied.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
            if state.is_abandoned {
                return Ok(());
            }
            state.waiting.append(&mut arrived);
            if count == 0 {
                return Ok(());
            }
            state.unended = match chunk[..count].iter().rposition(|&byte| byte == b'\n') {
                Some(end) => count - end - 1,
                None => state.unended + count,
            };
            if state.keeping == Keeping::Latest {
                let kept = state.kept;
                state.dropped += state.waiting.drop_old(read_at, kept);
            }
            if !state.waiting.lines.is_empty() {
                self.filled.notify_one();
            }
        }
    }
}

/// Lines stored consecutively in one buffer.
#[derive(Debug, Default)]
struct Batch {
    bytes: Vec<u8>,
    lines: VecDeque<Entry>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    number: u64,
    /// Start and end in the bytes; `None` for a line that is too long.
    place: Option<(usize, usize)>,
    /// True if it looks like a header.
    has_names: bool,
    read_at: Instant,
}

impl Batch {
    /// Returns true if the oldest line has waited too long.
    fn is_old(&self, now: Instant) -> bool {
        let oldest = self.lines.front();
        oldest.is_some_and(|entry| now.saturating_duration_since(entry.read_at) > Lines::PATIENCE)
    }

    /// Moves the lines of `newer` to the end.
    fn append(&mut self, newer: &mut Self) {
        let shift = self.bytes.len();
        self.bytes.append(&mut newer.bytes);
        self.lines.extend(newer.lines.drain(..).map(|mut entry| {
            entry.place = entry.place.map(|(start, end)| (start + shift, end + shift));
            entry
        }));
    }

    /// Drops all but the newest `kept` lines if the oldest has waited too long; returns the number of dropped lines. The
    /// latest header is kept: without it the lines that follow would be misinterpreted.
    fn drop_old(&mut self, now: Instant, kept: usize) -> u64 {
        if !self.is_old(now) || self.lines.len() <= kept {
            return 0;
        }
        let mut dropped = self.lines.len() - kept;
        let mut drained: Vec<Entry> = self.lines.drain(..dropped).collect();
        if let Some(names) = drained.iter().rposition(|entry| entry.has_names) {
            self.lines.push_front(drained.swap_remove(names));
            dropped -= 1;
        }
        // The bytes of dropped lines are freed at once, so that the buffer never exceeds the waiting lines.
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
struct Splitter {
    /// Beginning of an incomplete line.
    partial: Vec<u8>,
    is_too_long: bool,
    number: u64,
    skips_first: bool,
}

impl Splitter {
    /// With `skips_first` the first line is skipped, unless it is empty or begins like a header.
    fn new(skips_first: bool) -> Self {
        Self {
            skips_first,
            ..Self::default()
        }
    }

    fn split(&mut self, mut bytes: &[u8], read_at: Instant, batch: &mut Batch) {
        while let Some(end) = bytes.iter().position(|&byte| byte == b'\n') {
            self.extend(&bytes[..end]);
            bytes = &bytes[end + 1..];
            self.end_line(read_at, batch);
        }
        self.extend(bytes);
    }

    /// Adds the last line, if it has no line break.
    fn finish(&mut self, read_at: Instant, batch: &mut Batch) {
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
        let begins_like_header = |text: &[u8]| {
            text.first()
                .is_none_or(|first| first.is_ascii_alphabetic() || *first == b'"')
        };
        let is_skipped = self.number == 1 && self.skips_first && !begins_like_header(self.partial.trim_ascii());
        if !is_skipped {
            let has_names = begins_like_header(self.partial.trim_ascii()) && self.partial.contains(&b',');
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
    use super::*;

    fn all(source: impl Read + Send + 'static, skips_first: bool) -> Vec<(u64, Option<String>)> {
        let mut lines = Lines::spawn(source, Keeping::All, skips_first).unwrap();
        let mut found = Vec::new();
        loop {
            match lines.next(Duration::from_secs(60)) {
                NextLine::Line(line) => {
                    let text = line.text.map(|text| String::from_utf8_lossy(text).into_owned());
                    found.push((line.number, text));
                }
                NextLine::None => {}
                NextLine::End(error) => {
                    assert!(error.is_none());
                    return found;
                }
            }
        }
    }

    /// Returns a few bytes at a time, with occasional interruptions.
    struct Dribble(Vec<u8>, usize);

    impl Read for Dribble {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            self.1 += 1;
            if self.1.is_multiple_of(3) {
                return Err(ErrorKind::Interrupted.into());
            }
            let count = self.0.len().min(self.1 % 7 + 1).min(buffer.len());
            buffer[..count].copy_from_slice(&self.0[..count]);
            self.0.drain(..count);
            Ok(count)
        }
    }

    #[test]
    fn every_line_has_its_number() {
        let text: String = (1..=2000).map(|k| format!("{k},{}\n", "x".repeat(k % 50))).collect();
        let expected: Vec<_> = (1..).zip(text.lines().map(|line| Some(line.to_owned()))).collect();
        assert_eq!(all(io::Cursor::new(text.clone()), false), expected);
        assert_eq!(all(Dribble(text.into_bytes(), 0), false), expected);
        assert_eq!(
            all(&b"a\n\nb"[..], false)[1..],
            [(2, Some(String::new())), (3, Some("b".to_owned()))]
        );
        assert!(all(&b""[..], false).is_empty());
    }

    #[test]
    fn the_source_waits_for_a_slow_receiver() {
        let text = format!("{}\n", "y".repeat(999)).repeat(2000);
        assert_eq!(all(io::Cursor::new(text), false).len(), 2000);
    }

    #[test]
    fn lines_that_were_taken_over_are_returned_without_the_lock() {
        let mut lines = Lines::spawn(&b"1\n2\n3\n"[..], Keeping::All, false).unwrap();
        let shared = Arc::clone(&lines.shared);
        assert!(matches!(lines.next(Duration::from_secs(60)), NextLine::Line(_)));
        // The reader holds it most of the time when lines arrive fast.
        let _held = shared.lock();
        for number in 2..=3 {
            let NextLine::Line(line) = lines.next(Duration::from_secs(60)) else {
                panic!("no line {number}")
            };
            assert_eq!(line.number, number);
        }
    }

    #[test]
    fn a_line_without_end_is_not_kept() {
        let long = io::Cursor::new(vec![b'x'; 3 * Lines::LONGEST]).chain(&b"\nshort\n"[..]);
        assert_eq!(all(long, false), [(1, None), (2, Some("short".to_owned()))]);
    }

    #[test]
    fn a_reader_that_panics_ends_with_an_error() {
        struct Panics;
        impl Read for Panics {
            fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
                panic!("a defect of the driver")
            }
        }
        let mut lines = Lines::spawn(Panics, Keeping::All, false).unwrap();
        let NextLine::End(Some(error)) = lines.next(Duration::from_secs(60)) else {
            panic!("no error")
        };
        assert!(error.to_string().contains("internal error"), "{error}");
    }

    #[test]
    fn an_incomplete_first_line_of_a_device_is_skipped() {
        assert_eq!(all(&b"3,4\n1,2\n"[..], true), [(2, Some("1,2".to_owned()))]);
        assert_eq!(all(&b"r_1,r_2\n1,2\n"[..], true).len(), 2);
        assert_eq!(all(&b"\n1,2\n"[..], true).len(), 2);
    }

    #[test]
    fn lines_that_arrive_later_follow_those_that_wait() {
        let (now, mut splitter) = (Instant::now(), Splitter::new(false));
        let (mut waiting, mut arrived) = (Batch::default(), Batch::default());
        for chunk in ["1,a\n22", ",b\n\n", "3"] {
            splitter.split(chunk.as_bytes(), now, &mut arrived);
            waiting.append(&mut arrived);
            assert!(arrived.lines.is_empty() && arrived.bytes.is_empty());
        }
        splitter.finish(now, &mut arrived);
        waiting.append(&mut arrived);
        let texts = waiting.lines.iter().map(|entry| {
            let (start, end) = entry.place.unwrap();
            (entry.number, std::str::from_utf8(&waiting.bytes[start..end]).unwrap())
        });
        assert_eq!(Vec::from_iter(texts), [(1, "1,a"), (2, "22,b"), (3, ""), (4, "3")]);
    }

    #[test]
    fn headers_are_not_dropped() {
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
    fn old_lines_are_dropped_once_the_oldest_is_too_old() {
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
