use std::{
    fs::{self, File, TryLockError},
    io,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use decoupler_core::evaluation::Run;

use super::{CheckpointFile, DocumentError};
use crate::import::Recorded;

/// Reciprocal of the largest share of the time spent on saving.
const LARGEST_SHARE: u32 = 20;

/// Saves a run to a checkpoint at intervals.
#[derive(Debug)]
pub struct Checkpointing {
    path: PathBuf,
    interval: Duration,
    next: Instant,
    has_failed: bool,
    /// Origin of recorded samples.
    recorded: Option<Recorded>,
}

impl Checkpointing {
    /// Saves to `path` every `interval`, first after one interval; `recorded` is the origin of recorded samples.
    pub fn every(interval: Duration, path: PathBuf, recorded: Option<&Recorded>) -> Self {
        Self {
            path,
            interval,
            next: Instant::now() + interval,
            has_failed: false,
            recorded: recorded.cloned(),
        }
    }

    /// As [`Self::every`], first at once.
    pub fn from_now(interval: Duration, path: PathBuf, recorded: Option<&Recorded>) -> Self {
        Self {
            next: Instant::now(),
            ..Self::every(interval, path, recorded)
        }
    }

    /// Saves `run` if due. Returns the reason the first time that it fails; later attempts may succeed.
    pub fn save_if_due(&mut self, run: &Run) -> Option<DocumentError> {
        let begun = Instant::now();
        if begun < self.next {
            return None;
        }
        let failed = self.save(run).err();
        self.next = Instant::now() + self.interval.max(LARGEST_SHARE * begun.elapsed());
        failed.filter(|_| !std::mem::replace(&mut self.has_failed, true))
    }

    /// Saves `run`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, run: &Run) -> Result<(), DocumentError> {
        CheckpointFile::from_run(run, self.recorded.as_ref())?.save(&self.path)
    }
}

/// A place in a folder for the checkpoint of a running training, locked while a program uses it: programs that share the
/// folder use different places.
#[derive(Debug)]
pub struct CheckpointPlace {
    path: PathBuf,
    /// Locked while it is open. A file of its own, because a checkpoint is replaced whenever it is saved.
    _lock: File,
}

impl CheckpointPlace {
    /// Returns a free place in `folder`, which is created if it is missing, and the places with the checkpoints of programs
    /// that ended during a training.
    ///
    /// # Errors
    /// If the folder cannot be written, or its file system has no locks.
    pub fn find(folder: &Path) -> io::Result<(Self, Vec<Self>)> {
        fs::create_dir_all(folder)?;
        let (mut free, mut left) = (None, Vec::new());
        let paths = (1..).map(|number| folder.join(format!("training-{number}.checkpoint")));
        for path in paths {
            let lock = path.with_extension("lock");
            if let Some(free) = free.take_if(|_| !lock.exists()) {
                return Ok((free, left));
            }
            let lock = File::options().create(true).truncate(false).write(true).open(lock)?;
            match lock.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => continue,
                Err(TryLockError::Error(error)) => return Err(error),
            }
            let place = Self { path, _lock: lock };
            if place.path.try_exists()? {
                left.push(place);
            } else {
                free.get_or_insert(place);
            }
        }
        unreachable!("there are places without end")
    }

    /// Path of the checkpoint.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Removes the checkpoint, if there is one.
    pub fn clear(&self) {
        // One that cannot be removed is offered at the next start.
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_use_different_places_and_find_what_was_left() {
        let home = tempfile::tempdir().unwrap();
        let folder = home.path().join("data");
        let name = |place: &CheckpointPlace| place.path().file_stem().unwrap().to_str().unwrap().to_owned();
        let [first, second, third] = [(); 3].map(|()| {
            let (free, left) = CheckpointPlace::find(&folder).unwrap();
            assert!(left.is_empty());
            free
        });
        assert_eq!(
            [&first, &second, &third].map(name),
            ["training-1", "training-2", "training-3"]
        );
        for place in [&first, &third] {
            fs::write(place.path(), "").unwrap();
        }
        drop((second, third));
        let (free, left) = CheckpointPlace::find(&folder).unwrap();
        assert_eq!(
            (name(&free), Vec::from_iter(left.iter().map(name))),
            ("training-2".into(), vec!["training-3".into()])
        );
        // Another program offers none of these, and the one in use is not offered at all.
        let (other, none) = CheckpointPlace::find(&folder).unwrap();
        assert!(name(&other) == "training-4" && none.is_empty());
        left[0].clear();
        drop((free, left));
        assert!(CheckpointPlace::find(&folder).unwrap().1.is_empty());
    }
}
