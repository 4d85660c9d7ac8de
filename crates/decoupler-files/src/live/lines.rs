use std::{
    collections::VecDeque,
    io::{self, ErrorKind, Read},
    ops::Range,
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
    /// Number of lines dropped so far.
    pub dropped: u64,
}

/// A line, its number and its time of arrival.
#[derive(Clone, Debug)]
pub struct Line {
    /// Number in the source, from 1; dropped lines are counted.
    pub number: u64,
    /// False for a last line without a line break, which may be cut off.
    pub is_ended: bool,
    /// Time when its last byte was read.
    pub read_at: Instant,
    /// Place in the bytes of its batch; `None` for a line that is too long.
    place: Option<Range<usize>>,
}

/// Overflow policy for lines that arrive faster than they are consumed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeping {
    /// Keep all lines and pause reading.
    All,
    /// Keep only the latest lines.
    Latest,
}

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    /// Notified when lines arrive or are taken, and at the end: reader and receiver never wait at the same time.
    changed: Condvar,
}

#[derive(Debug, Default)]
struct State {
    /// Number of newest lines that are kept.
    kept: usize,
    waiting: Batch,
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

    /// Starts a thread that opens a source, which may take minutes, and reads it. With `skips_first` its first line is skipped
    /// unless it is empty or begins with a letter or a quote, like a header: reading from a device may begin in the middle of a
    /// line.
    ///
    /// # Errors
    /// If the operating system cannot create a thread.
    pub fn spawn<R: Read>(
        open: impl FnOnce() -> io::Result<R> + Send + 'static,
        keeping: Keeping,
        skips_first: bool,
    ) -> io::Result<Self> {
        let shared: Arc<Shared> = Arc::default();
        let reader = Arc::clone(&shared);
        thread::Builder::new().name("lines".to_owned()).spawn(move || {
            let read = || reader.read(open()?, keeping, skips_first);
            // A panic of a driver must not look like a source without lines.
            let read = catch_unwind(AssertUnwindSafe(read));
            let end = read.unwrap_or_else(|_| Err(io::Error::other("an internal error stopped the reading")));
            reader.lock().end = Some(end.err());
            reader.changed.notify_one();
        })?;
        Ok(Self {
            shared,
            keeping,
            batch: Batch::default(),
            dropped: 0,
        })
    }

    /// Sets the number of newest lines kept when older ones are dropped: those of a whole snapshot.
    pub fn set_kept(&mut self, lines: usize) {
        self.shared.lock().kept = lines;
    }

    /// Number of bytes that have arrived since the last end of a line.
    pub fn unended(&self) -> usize {
        self.shared.lock().unended
    }

    /// Waits for the next line, up to `timeout`.
    ///
    /// # Errors
    /// Once the source has ended, with an error unless it ended normally.
    pub fn next(&mut self, timeout: Duration) -> Result<Option<Line>, Option<io::Error>> {
        if self.batch.lines.is_empty() {
            self.batch.bytes.clear();
            let mut state = self.shared.lock();
            if state.waiting.lines.is_empty() && state.end.is_none() {
                let waited = self.shared.changed.wait_timeout(state, timeout);
                state = waited.unwrap_or_else(PoisonError::into_inner).0;
            }
            if state.waiting.lines.is_empty() {
                let end = state.end.as_mut().map(Option::take);
                return end.map_or(Ok(None), Err);
            }
            std::mem::swap(&mut self.batch, &mut state.waiting);
            self.shared.changed.notify_one();
        }
        // A lock per line would wait for the reader, which holds it most of the time when lines arrive fast.
        if self.keeping == Keeping::Latest && self.batch.is_old(Instant::now()) {
            let state = self.shared.lock();
            let kept = state.kept.saturating_sub(state.waiting.lines.len());
            self.batch.drop_old(Instant::now(), kept);
        }
        self.dropped += std::mem::take(&mut self.batch.dropped);
        Ok(self.batch.lines.pop_front())
    }

    /// Returns the bytes of the line that was returned last, without LF; `None` if it is longer than [`LONGEST_LINE`].
    pub fn text(&self, line: &Line) -> Option<&[u8]> {
        line.place.clone().map(|place| &self.batch.bytes[place])
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        self.shared.lock().is_abandoned = true;
        self.shared.changed.notify_one();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Nothing panics while the lock is held, and the state would still be valid if it did.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads lines until the source ends or the receiver is dropped.
    fn read(&self, mut source: impl Read, keeping: Keeping, skips_first: bool) -> io::Result<()> {
        let mut chunk = vec![0; CHUNK];
        let mut splitter = Splitter {
            skips_first,
            ..Splitter::default()
        };
        loop {
            let count = match source.read(&mut chunk) {
                Ok(count) => Some(count),
                Err(error) => match error.kind() {
                    ErrorKind::Interrupted | ErrorKind::TimedOut | ErrorKind::WouldBlock => None,
                    _ => return Err(error),
                },
            };
            let read_at = Instant::now();
            let mut state = self.lock();
            while keeping == Keeping::All && !state.waiting.lines.is_empty() && !state.is_abandoned {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
            if state.is_abandoned {
                return Ok(());
            }
            let Some(count) = count else { continue };
            splitter.split(&chunk[..count], read_at, &mut state.waiting);
            if count == 0 {
                return Ok(());
            }
            state.unended = splitter.length;
            if keeping == Keeping::Latest {
                let kept = state.kept;
                state.waiting.drop_old(read_at, kept);
            }
            if !state.waiting.lines.is_empty() {
                self.changed.notify_one();
            }
        }
    }
}

/// Lines stored consecutively in one buffer.
#[derive(Debug, Default)]
struct Batch {
    bytes: Vec<u8>,
    lines: VecDeque<Line>,
    /// Number of lines dropped from this batch.
    dropped: u64,
}

impl Batch {
    /// Returns true if the oldest line has waited too long.
    fn is_old(&self, now: Instant) -> bool {
        let oldest = self.lines.front();
        oldest.is_some_and(|entry| now.saturating_duration_since(entry.read_at) > Lines::PATIENCE)
    }

    /// Drops all but the newest `kept` lines if the oldest has waited too long, and counts them. The latest header is kept:
    /// without it the lines that follow would be misinterpreted.
    fn drop_old(&mut self, now: Instant, kept: usize) {
        let (before, kept) = (self.lines.len(), kept.max(1));
        if !self.is_old(now) || before <= kept {
            return;
        }
        let bytes = &self.bytes;
        let has_names = |line: &Line| {
            let text = bytes[line.place.clone().unwrap_or_default()].trim_ascii();
            begins_like_header(text) && text.contains(&b',')
        };
        let names = self.lines.drain(..before - kept).rfind(has_names);
        self.lines.extend(names);
        self.lines.rotate_right(self.lines.len() - kept);
        // The bytes of dropped lines are freed at once, so that the buffer never exceeds the waiting lines.
        let mut bytes = Vec::with_capacity(self.bytes.len());
        for place in self.lines.iter_mut().filter_map(|entry| entry.place.as_mut()) {
            let start = bytes.len();
            bytes.extend_from_slice(&self.bytes[place.clone()]);
            *place = start..bytes.len();
        }
        self.bytes = bytes;
        self.dropped += (before - self.lines.len()) as u64;
    }
}

fn begins_like_header(text: &[u8]) -> bool {
    (text.first()).is_none_or(|first| first.is_ascii_alphabetic() || *first == b'"')
}

/// Splits chunks of bytes into lines.
#[derive(Debug, Default)]
struct Splitter {
    /// Beginning of an incomplete line; empty if it is too long.
    partial: Vec<u8>,
    /// Length of the incomplete line.
    length: usize,
    number: u64,
    /// True if the first line is skipped, unless it is empty or begins like a header.
    skips_first: bool,
}

impl Splitter {
    /// Appends the lines that end in `bytes`; without bytes, the last line, if it has no line break.
    fn split(&mut self, bytes: &[u8], read_at: Instant, batch: &mut Batch) {
        for part in bytes.split_inclusive(|&byte| byte == b'\n') {
            let text = part.strip_suffix(b"\n").unwrap_or(part);
            self.length += text.len();
            if self.length < LONGEST_LINE {
                self.partial.extend_from_slice(text);
            } else {
                self.partial.clear();
            }
            if text.len() < part.len() {
                self.end_line(true, read_at, batch);
            }
        }
        if bytes.is_empty() && self.length > 0 {
            self.end_line(false, read_at, batch);
        }
    }

    fn end_line(&mut self, is_ended: bool, read_at: Instant, batch: &mut Batch) {
        self.number += 1;
        if self.number > 1 || !self.skips_first || begins_like_header(self.partial.trim_ascii()) {
            let start = batch.bytes.len();
            batch.bytes.extend_from_slice(&self.partial);
            batch.lines.push_back(Line {
                number: self.number,
                place: (self.length < LONGEST_LINE).then_some(start..batch.bytes.len()),
                is_ended,
                read_at,
            });
        }
        self.partial.clear();
        self.length = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(source: impl Read + Send + 'static, skips_first: bool) -> Vec<(u64, Option<String>)> {
        let mut lines = Lines::spawn(|| Ok(source), Keeping::All, skips_first).unwrap();
        let mut found = Vec::new();
        loop {
            match lines.next(Duration::from_secs(600)) {
                Ok(Some(line)) => {
                    let text = lines.text(&line).map(|text| String::from_utf8_lossy(text).into_owned());
                    found.push((line.number, text));
                }
                Ok(None) => {}
                Err(error) => {
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
        let mut lines = Lines::spawn(|| Ok(&b"1\n2\n3\n"[..]), Keeping::All, false).unwrap();
        let shared = Arc::clone(&lines.shared);
        assert!(matches!(lines.next(Duration::from_secs(600)), Ok(Some(_))));
        // The reader holds it most of the time when lines arrive fast.
        let _held = shared.lock();
        for number in 2..=3 {
            let Ok(Some(line)) = lines.next(Duration::from_secs(600)) else {
                panic!("no line {number}")
            };
            assert_eq!(line.number, number);
        }
    }

    #[test]
    fn a_line_without_end_is_not_kept() {
        let long = io::Cursor::new(vec![b'x'; 3 * LONGEST_LINE]).chain(&b"\nshort\n"[..]);
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
        let mut lines = Lines::spawn(|| Ok(Panics), Keeping::All, false).unwrap();
        let Err(Some(error)) = lines.next(Duration::from_secs(600)) else {
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
        let (now, mut splitter, mut waiting) = (Instant::now(), Splitter::default(), Batch::default());
        for chunk in ["1,a\n22", ",b\n\n", "3", ""] {
            splitter.split(chunk.as_bytes(), now, &mut waiting);
        }
        let texts = waiting.lines.iter().map(|entry| {
            let text = &waiting.bytes[entry.place.clone().unwrap()];
            (entry.number, std::str::from_utf8(text).unwrap())
        });
        assert_eq!(Vec::from_iter(texts), [(1, "1,a"), (2, "22,b"), (3, ""), (4, "3")]);
    }

    #[test]
    fn headers_are_not_dropped() {
        let start = Instant::now();
        let mut batch = Batch::default();
        let mut splitter = Splitter::default();
        splitter.split(b"r_2,r_1\n1,2\n3,4\n5,6\n", start, &mut batch);
        batch.drop_old(start + Duration::from_millis(101), 1);
        assert_eq!(batch.dropped, 2);
        let texts = batch
            .lines
            .iter()
            .map(|entry| String::from_utf8_lossy(&batch.bytes[entry.place.clone().unwrap()]).into_owned());
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
        batch.drop_old(after(100), 3);
        assert_eq!(batch.dropped, 0);
        batch.drop_old(after(101), 3);
        assert_eq!(batch.dropped, 7);
        let texts = batch
            .lines
            .iter()
            .map(|entry| String::from_utf8_lossy(&batch.bytes[entry.place.clone().unwrap()]).into_owned());
        assert!(texts.eq(["line 7", "line 8", "line 9"]));
        batch.drop_old(after(500), 3);
        assert_eq!(batch.dropped, 7);
        assert_eq!(batch.bytes.len(), 18);
    }
}
