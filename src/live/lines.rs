use std::{
    collections::VecDeque,
    io::{self, ErrorKind, Read},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use crate::dataset::LONGEST_ROW;

/// Lines of a source, read by a thread of their own as they come.
///
/// From a file or pipe every line is given, and the source waits if nobody takes them. From a device or socket that does
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

/// What [`Lines::next`] gives.
#[derive(Debug)]
pub enum NextLine<'a> {
    /// A line.
    Line(Line<'a>),
    /// None has come in time.
    None,
    /// The source has ended, with an error unless it is a regular end.
    End(Option<io::Error>),
}

/// Keeping of lines that nobody takes.
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
    /// Nobody takes lines any more.
    is_abandoned: bool,
}

/// Lines one after the other in one buffer.
#[derive(Debug, Default)]
struct Batch {
    bytes: Vec<u8>,
    lines: VecDeque<Entry>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    number: u64,
    /// Place in the bytes; `None` for a line that is too long.
    place: Option<(usize, usize)>,
    read_at: Instant,
}

/// Bytes in a buffer at which a source waits.
const FULL: usize = 1 << 18;

impl Lines {
    /// Time after which a waiting line is too old if only the latest count.
    pub const PATIENCE: Duration = Duration::from_millis(20);
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
            Some(Entry { number, place, read_at }) => NextLine::Line(Line {
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

    /// Reads lines until the source ends or nobody takes them.
    fn read(&self, mut source: impl Read, skips_first: bool) -> io::Result<()> {
        let mut chunk = vec![0; 1 << 16];
        let mut splitter = Splitter {
            skips_first,
            ..Splitter::default()
        };
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
            while state.keeping == Keeping::All && state.waiting.bytes.len() >= FULL && !state.is_abandoned {
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

impl Batch {
    /// Drops all but the newest `kept` lines if the oldest has waited too long; returns how many.
    fn drop_old(&mut self, now: Instant, kept: usize) -> u64 {
        let is_old = |entry: &Entry| now.saturating_duration_since(entry.read_at) > Lines::PATIENCE;
        if !self.lines.front().is_some_and(is_old) || self.lines.len() <= kept {
            return 0;
        }
        let dropped = self.lines.len() - kept;
        self.lines.drain(..dropped);
        // Their bytes go when the buffer is next emptied, but never grow beyond what waits.
        if let Some(start) = self.lines.iter().find_map(|entry| entry.place).map(|(start, _)| start) {
            self.bytes.drain(..start);
            for (from, to) in self.lines.iter_mut().filter_map(|entry| entry.place.as_mut()) {
                (*from, *to) = (*from - start, *to - start);
            }
        }
        dropped as u64
    }
}

/// Splits chunks of bytes into lines.
#[derive(Debug, Default)]
struct Splitter {
    /// Beginning of a line whose end has not come.
    partial: Vec<u8>,
    is_too_long: bool,
    number: u64,
    skips_first: bool,
}

impl Splitter {
    fn split(&mut self, mut bytes: &[u8], read_at: Instant, batch: &mut Batch) {
        while let Some(end) = bytes.iter().position(|&byte| byte == b'\n') {
            self.extend(&bytes[..end]);
            bytes = &bytes[end + 1..];
            self.end_line(read_at, batch);
        }
        self.extend(bytes);
    }

    /// Gives the last line, if it has no line break.
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
        let begins_as_names = |text: &[u8]| {
            text.first()
                .is_none_or(|first| first.is_ascii_alphabetic() || *first == b'"')
        };
        let is_skipped = self.number == 1 && self.skips_first && !begins_as_names(self.partial.trim_ascii());
        if !is_skipped {
            let start = batch.bytes.len();
            batch.bytes.extend_from_slice(&self.partial);
            batch.lines.push_back(Entry {
                number: self.number,
                place: (!self.is_too_long).then_some((start, batch.bytes.len())),
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

    #[test]
    fn the_latest_lines_win_once_the_oldest_is_too_old() {
        let start = Instant::now();
        let after = |millis| start + Duration::from_millis(millis);
        let mut batch = Batch::default();
        let mut splitter = Splitter::default();
        for k in 0..10 {
            splitter.split(format!("line {k}\n").as_bytes(), after(k), &mut batch);
        }
        assert_eq!(batch.drop_old(after(20), 3), 0);
        assert_eq!(batch.drop_old(after(21), 3), 7);
        let texts = batch.lines.iter().map(|entry| {
            let (from, to) = entry.place.unwrap();
            String::from_utf8_lossy(&batch.bytes[from..to]).into_owned()
        });
        assert!(texts.eq(["line 7", "line 8", "line 9"]));
        assert_eq!(batch.drop_old(after(100), 3), 0);
        assert_eq!(batch.bytes.len(), 18);
    }
}
