//! Files in the making, each on a thread of its own.

use std::{
    fmt::{self, Display},
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use crate::window::job::{Job, JobError, Wake};

/// Longest time that dropping waits for a file. What takes longer is removed when the program ends.
const LONGEST_WAIT: Duration = Duration::from_secs(5);

/// Sentence that reports a file, or the reason why it was not written, unless the thread failed.
type Written = Result<Result<String, String>, JobError>;

/// Files that are being written.
pub struct Files {
    wake: Wake,
    under_way: Vec<(PathBuf, Job<Written>)>,
}

impl Files {
    /// No file yet. `wake` is called when one is there.
    pub fn new(wake: Wake) -> Self {
        Self {
            wake,
            under_way: Vec::new(),
        }
    }

    /// Writes the file `path` in the background. `write` returns the message for the user then.
    pub fn write<X: Display>(
        &mut self,
        path: PathBuf,
        write: impl FnOnce(&Path) -> Result<String, X> + Send + 'static,
    ) {
        let mut job = Job::prompt("file", Arc::clone(&self.wake));
        let target = path.clone();
        job.start(
            move |_| write(&target).map_err(|error| error.to_string()),
            |written| written,
        );
        self.under_way.push((path, job));
    }

    /// Sentence that reports the next file that is there, or the reason why it is not.
    pub fn next_written(&mut self) -> Option<Result<String, String>> {
        let mut jobs = self.under_way.iter().enumerate();
        let (number, written) = jobs.find_map(|(number, (_, job))| Some((number, job.next_event()?)))?;
        let (path, _) = self.under_way.remove(number);
        Some(match written {
            Ok(written) => written,
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

#[cfg(test)]
mod tests {
    use std::{fs, sync::mpsc::channel};

    use super::*;
    use decoupler_files::export::WriteError;

    #[test]
    fn every_file_is_told_also_one_whose_writing_panicked() {
        let (woke, wakes) = channel();
        let mut files = Files::new(Arc::new(move || woke.send(()).unwrap_or(())));
        let folder = tempfile::tempdir().unwrap();
        let [whole, broken, missing] = ["whole", "broken", "none/missing"].map(|name| folder.path().join(name));
        let told = "it is there".to_owned();
        files.write(whole, move |path| fs::write(path, "text").map(|()| told));
        files.write(broken.clone(), |_| -> Result<String, WriteError> { panic!("a defect") });
        files.write(missing, |path| {
            decoupler_files::export::atomic_write(path, |_| Ok(())).map(|()| String::new())
        });
        assert_eq!(files.paths().count(), 3);
        let mut told = Vec::new();
        while told.len() < 3 {
            wakes.recv_timeout(Duration::from_secs(60)).unwrap();
            told.extend(std::iter::from_fn(|| files.next_written()));
        }
        assert_eq!(files.paths().count(), 0);
        let has = |wanted: &dyn Fn(&Result<String, String>) -> bool| told.iter().any(wanted);
        assert!(has(&|told| told.as_deref() == Ok("it is there")));
        assert!(has(&|told| told
            .as_ref()
            .is_err_and(|reason| reason.contains("does not exist"))));
        let name = broken.display().to_string();
        assert!(has(&|told| {
            let reason = told.as_ref().err();
            reason.is_some_and(|reason| reason.contains(&name) && reason.contains("a defect"))
        }));
    }

    #[test]
    fn dropping_waits_for_what_is_being_written() {
        let (begun, has_begun) = channel();
        let (gate, opened) = channel::<()>();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("slow");
        let mut files = Files::new(Arc::new(|| ()));
        files.write(path.clone(), move |path| {
            begun.send(()).unwrap();
            opened.recv().unwrap();
            fs::write(path, "text").map(|()| String::new())
        });
        has_begun.recv().unwrap();
        gate.send(()).unwrap();
        drop(files);
        assert_eq!(fs::read(path).unwrap(), b"text");
    }
}
