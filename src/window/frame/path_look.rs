//! Looks at typed paths on threads of their own: a network drive that does not answer must not hold the window.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::window::{
    job::{Job, Wake},
    shared::{FileInUse, refuse_in_use},
};

/// What is at a path to which a file is to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// Nothing that would be lost. What else is wrong with the path is told when it is written to.
    Nothing,
    /// Another file.
    File,
    /// A file that the program needs, and why nothing may be saved over it.
    InUse(String),
}

/// Paths that are being looked at.
pub(super) struct PathLooks {
    wake: Wake,
    under_way: Vec<(PathBuf, Job<Found>)>,
}

impl PathLooks {
    /// None yet. `wake` is called when something was found.
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            wake,
            under_way: Vec::new(),
        }
    }

    /// Looks at `path`, on which nothing is `used` that may be lost.
    pub(super) fn start(&mut self, path: PathBuf, used: Vec<FileInUse>) {
        // Each has a thread of its own: one that never ends holds no other up.
        let mut job = Job::prompt("path", Arc::clone(&self.wake));
        let looked_at = path.clone();
        job.start(
            move |_| look(&looked_at, &used),
            |found| found.unwrap_or_else(|error| Found::InUse(error.to_string())),
        );
        self.under_way.push((path, job));
    }

    /// The next path of which something is known.
    pub(super) fn next_found(&mut self) -> Option<(PathBuf, Found)> {
        let mut jobs = self.under_way.iter().enumerate();
        let (number, found) = jobs.find_map(|(number, (_, job))| Some((number, job.next_event()?)))?;
        let (path, _) = self.under_way.remove(number);
        Some((path, found))
    }
}

fn look(path: &Path, used: &[FileInUse]) -> Found {
    match refuse_in_use(path, used) {
        Err(reason) => Found::InUse(reason),
        // A folder is no file that could be lost, and a pipe or a device is there to be written to.
        Ok(()) if fs::metadata(path).is_ok_and(|found| found.is_file()) => Found::File,
        Ok(()) => Found::Nothing,
    }
}
