use std::{
    io::{self, Read},
    ops::ControlFlow,
};

/// Number of bytes between two progress reports.
const INTERVAL: u64 = 1 << 20;

/// Progress of reading one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Number of bytes read.
    pub bytes: u64,
    /// Size of the file in bytes; `None` for a pipe.
    pub of: Option<u64>,
}

/// Callback for every megabyte read; [`ControlFlow::Break`] cancels the import.
pub type Watch<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

/// Source that reports the number of bytes read.
pub(super) struct Watched<'a, R> {
    source: R,
    progress: Progress,
    next: u64,
    watch: Watch<'a>,
}

impl<'a, R: Read> Watched<'a, R> {
    pub(super) fn new(source: R, of: Option<u64>, watch: Watch<'a>) -> Self {
        Self {
            source,
            progress: Progress { bytes: 0, of },
            next: 0,
            watch,
        }
    }
}

impl<R: Read> Read for Watched<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.progress.bytes >= self.next {
            if (self.watch)(self.progress).is_break() {
                return Err(io::Error::other(Cancelled));
            }
            self.next = self.progress.bytes + INTERVAL;
        }
        let read = self.source.read(buffer)?;
        self.progress.bytes += read as u64;
        Ok(read)
    }
}

/// Cancellation, passed as an I/O error through readers that support no other.
#[derive(Debug, thiserror::Error)]
#[error("cancelled")]
pub(super) struct Cancelled;
