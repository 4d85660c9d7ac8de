use std::{
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, channel},
};

use crate::app::{
    shared::Contents,
    threads::{Report, Wake},
};

/// Files being written, each on a thread of its own.
pub struct Files {
    report: Report<Result<PathBuf, String>>,
    written: Receiver<Result<PathBuf, String>>,
}

impl Files {
    /// None yet. `wake` is called after each file.
    pub fn new(wake: Wake) -> Self {
        let (outgoing, written) = channel();
        Self {
            report: Report::new(outgoing, wake),
            written,
        }
    }

    /// Writes a file.
    pub fn write(&self, contents: Contents, path: PathBuf) {
        let write = move |path: &Path| contents.write(path);
        self.report.write("file", path, write, |written| written);
    }

    /// The next file that was written, or why one was not.
    pub fn next_written(&self) -> Option<Result<PathBuf, String>> {
        self.written.try_recv().ok()
    }
}
