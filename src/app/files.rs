//! Files in the making, each on a thread of its own.

use std::{
    fmt::{self, Display},
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use super::job::{Job, JobError, Wake};

/// Longest time that dropping waits for a file. What takes longer is removed when the program ends.
const LONGEST_WAIT: Duration = Duration::from_secs(5);

/// Files that are being written.
pub struct Files {
    wake: Wake,
    under_way: Vec<(PathBuf, Job<Result<Result<(), String>, JobError>>)>,
}

impl Files {
    /// No file yet. `wake` is called when one is there.
    pub fn new(wake: Wake) -> Self {
        Self {
            wake,
            under_way: Vec::new(),
        }
    }

    /// Writes the file `path` in the background.
    pub fn write<X: Display>(&mut self, path: PathBuf, write: impl FnOnce(&Path) -> Result<(), X> + Send + 'static) {
        let mut job = Job::new("file", Arc::clone(&self.wake));
        let target = path.clone();
        job.start(
            move |_| write(&target).map_err(|error| error.to_string()),
            |written| written,
        );
        self.under_way.push((path, job));
    }

    /// The next file that is there, or why it is not.
    pub fn next_written(&mut self) -> Option<Result<PathBuf, String>> {
        let mut jobs = self.under_way.iter().enumerate();
        let (number, written) = jobs.find_map(|(number, (_, job))| Some((number, job.next_event()?)))?;
        let (path, _) = self.under_way.remove(number);
        Some(match written {
            Ok(written) => written.map(|()| path),
            Err(error) => Err(format!("cannot write '{}': {error}", path.display())),
        })
    }

    /// Paths of the files that are being written.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.under_way.iter().map(|(path, _)| path.as_path())
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        for (_, job) in &mut self.under_way {
            job.wait(LONGEST_WAIT);
        }
    }
}

impl fmt::Debug for Files {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.paths()).finish()
    }
}
