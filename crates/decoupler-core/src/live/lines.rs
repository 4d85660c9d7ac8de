use std::{
    io::{self, ErrorKind, Read},
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use super::line_parser::{Batch, Entry, Splitter};
use crate::text::LONGEST_ROW;

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
    pub const LONGEST: usize = LONGEST_ROW as usize;

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
}
