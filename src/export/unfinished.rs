use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::{self, ErrorKind},
    path::{Path, PathBuf},
    process,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

/// Paths of all temporary files. A program ended from another thread runs no destructors, so it removes these.
static ALL: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn all() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A set is whole at any time.
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A temporary file, removed when dropped.
#[derive(Debug)]
pub(super) struct Unfinished {
    file: File,
    /// Listed in [`ALL`] until the file is renamed.
    path: PathBuf,
}

impl Unfinished {
    /// Creates a temporary file in `folder`, with the default permissions (0666 minus the umask).
    pub(super) fn begin(folder: &Path) -> io::Result<Self> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let mut all = all();
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let path = folder.join(format!(".decoupler-{}-{number}.part", process::id()));
            match File::create_new(&path) {
                // Another machine or container has a process of the same number, or one was killed.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
                Ok(file) => {
                    all.insert(path.clone());
                    return Ok(Self { file, path });
                }
            }
        }
    }

    pub(super) fn as_file(&self) -> &File {
        &self.file
    }

    /// Renames the file to `target`, replacing a file that is there.
    pub(super) fn persist(self, target: &Path) -> io::Result<()> {
        fs::rename(&self.path, target)?;
        all().remove(&self.path);
        Ok(())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if all().remove(&self.path) {
            // What cannot be removed stays beside the target; nobody is left to tell.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Ends the program with this exit status, from any thread, after removing all temporary files.
#[cfg(feature = "cli")]
pub(crate) fn exit_leaving_nothing(status: i32) -> ! {
    // Held to the end, so that no other thread begins one meanwhile.
    let all = all();
    for path in all.iter() {
        // It may have found its place or have been removed just now.
        let _ = fs::remove_file(path);
    }
    process::exit(status)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_left_by_another_process_is_neither_taken_nor_changed() {
        let folder = tempfile::tempdir().unwrap();
        let first = Unfinished::begin(folder.path()).unwrap();
        let name = first.path.file_stem().unwrap().to_str().unwrap();
        let (start, number) = name.rsplit_once('-').unwrap();
        let number: u64 = number.parse().unwrap();
        let left = (1..100).map(|later| folder.path().join(format!("{start}-{}.part", number + later)));
        let left: Vec<_> = left.collect();
        left.iter().for_each(|path| fs::write(path, "left").unwrap());
        let second = Unfinished::begin(folder.path()).unwrap();
        assert!(!left.contains(&second.path));
        drop((first, second));
        for path in &left {
            assert_eq!(fs::read(path).unwrap(), b"left");
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), left.len());
    }
}
