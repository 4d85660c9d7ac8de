use std::{
    io::{self, ErrorKind, Read},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use super::line_parser::{Batch, Entry, Splitter};
use crate::text::LONGEST_ROW;

/// Lines of a source, read by a thread of their own as they come.
///
/// From a file or pipe every line is given, and the source waits if no one takes them. From a device or socket that does
/// not wait the latest win: once a line has waited for [`Lines::PATIENCE`], all but the newest are dropped, and counted.
/// Lines that are dropped are the oldest, and as many remain as [`Lines::set_kept`] says. Buffers are used again, so that
/// nothing is allocated in steady state.
#[derive(Debug)]
pub struct Lines {
    shared: Arc<Shared>,
    /// Lines taken from the reader, not yet given.
    batch: Batch,
}

/// A line with its number from 1 and the time when its last byte was read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line<'a> {
    /// Number in the source, from 1; dropped lines count.
    pub number: u64,
    /// Its bytes without LF; `None` if it is longer than [`Lines::LONGEST`], which is not kept.
    pub text: Option<&'a [u8]>,
    /// Time when its last byte was read.
    pub read_at: Instant,
}

/// Result of [`Lines::next`].
#[derive(Debug)]
pub enum NextLine<'a> {
    /// A line.
    Line(Line<'a>),
    /// None has come in time.
    None,
    /// The source has ended, with an error unless it is a regular end.
    End(Option<io::Error>),
}

/// Keeping of lines that no one takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeping {
    /// All, and the source waits.
    All,
    /// The latest.
    Latest,
}

#[derive(Debug)]
struct Shared {
    state: Mutex<State>,
    /// Told when lines come or the source ends.
    filled: Condvar,
    /// Told when lines are taken.
    emptied: Condvar,
}

#[derive(Debug)]
struct State {
    keeping: Keeping,
    kept: usize,
    waiting: Batch,
    dropped: u64,
    end: Option<Option<io::Error>>,
    /// No one takes lines any more.
    is_abandoned: bool,
}

/// Most bytes read at once. Of lines that all count, no more are read before these are taken: what waits grows old.
const CHUNK: usize = 1 << 14;

impl Lines {
    /// Time after which a waiting line is too old if only the latest count: longer than a busy machine lets a program wait
    /// for its turn.
    pub const PATIENCE: Duration = Duration::from_millis(100);
    /// Most bytes of a line, its line break included: 1 MiB, as of any file of readings.
    pub const LONGEST: usize = LONGEST_ROW as usize;

    /// Starts to read `source`. With `skips_first` its first line is not given unless it is empty or begins with a letter
    /// or a quote, as names do: a device may have been met in the middle of a line.
    ///
    /// # Errors
    /// If the operating system has no further thread.
    pub fn spawn(source: impl Read + Send + 'static, keeping: Keeping, skips_first: bool) -> io::Result<Self> {
        let shared = Arc::new(Shared {
            state: Mutex::new(State {
                keeping,
                kept: 1,
                waiting: Batch::default(),
                dropped: 0,
                end: None,
                is_abandoned: false,
            }),
            filled: Condvar::new(),
            emptied: Condvar::new(),
        });
        let reader = Arc::clone(&shared);
        thread::Builder::new().name("lines".to_owned()).spawn(move || {
            let end = reader.read(source, skips_first);
            let mut state = reader.lock();
            state.end = Some(end.err());
            reader.filled.notify_one();
        })?;
        Ok(Self {
            shared,
            batch: Batch::default(),
        })
    }

    /// Sets how many of the newest lines remain when older ones are dropped: those of a whole snapshot.
    pub fn set_kept(&mut self, lines: usize) {
        self.shared.lock().kept = lines.max(1);
    }

    /// Number of lines dropped so far.
    pub fn dropped(&self) -> u64 {
        self.shared.lock().dropped
    }

    /// Returns `true` if no line waits at present.
    pub fn is_empty(&self) -> bool {
        self.batch.lines.is_empty() && self.shared.lock().waiting.lines.is_empty()
    }

    /// Waits for the next line, at most so long.
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

    /// Drops lines that have waited too long, if newer ones are there.
    fn drop_old(&mut self, now: Instant) {
        let mut state = self.shared.lock();
        if state.keeping == Keeping::Latest {
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
        // Nothing panics while the lock is held, and counts stay counts if it did.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reads lines until the source ends or no one takes them.
    fn read(&self, mut source: impl Read, skips_first: bool) -> io::Result<()> {
        let mut chunk = vec![0; CHUNK];
        let mut splitter = Splitter::new(skips_first);
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
            let mut state = self.lock();
            while state.keeping == Keeping::All && !state.waiting.lines.is_empty() && !state.is_abandoned {
                state = self.emptied.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
            if state.is_abandoned {
                return Ok(());
            }
            if count == 0 {
                splitter.finish(read_at, &mut state.waiting);
                return Ok(());
            }
            splitter.split(&chunk[..count], read_at, &mut state.waiting);
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

    /// Gives a few bytes at a time, interrupted now and then.
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
    fn every_line_comes_with_its_number() {
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
    fn the_source_waits_for_who_takes_its_lines() {
        let text = format!("{}\n", "y".repeat(999)).repeat(2000);
        assert_eq!(all(io::Cursor::new(text), false).len(), 2000);
    }

    #[test]
    fn a_line_without_end_is_not_kept() {
        let long = io::Cursor::new(vec![b'x'; 3 * Lines::LONGEST]).chain(&b"\nshort\n"[..]);
        assert_eq!(all(long, false), [(1, None), (2, Some("short".to_owned()))]);
    }

    #[test]
    fn what_a_device_sends_first_may_be_the_rest_of_a_line() {
        assert_eq!(all(&b"3,4\n1,2\n"[..], true), [(2, Some("1,2".to_owned()))]);
        assert_eq!(all(&b"r_1,r_2\n1,2\n"[..], true).len(), 2);
        assert_eq!(all(&b"\n1,2\n"[..], true).len(), 2);
    }
}
