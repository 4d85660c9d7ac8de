use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::{self, ErrorKind},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use tempfile::{Builder, TempPath};

const PREFIX: &str = ".decoupler-";
const SUFFIX: &str = ".part";

/// Paths of all unfinished files and folders, and the folders that were swept. A program that exits from another thread drops
/// nothing, so [`exit_leaving_nothing`] removes the unfinished ones.
static ALL: Mutex<(BTreeSet<PathBuf>, BTreeSet<PathBuf>)> = Mutex::new((BTreeSet::new(), BTreeSet::new()));

/// An unfinished file or folder, removed when dropped. It is locked while in use; an unlocked one was left by a program that
/// was killed. Windows cannot lock folders, so none is swept there.
#[derive(Debug)]
pub(super) struct Unfinished<L> {
    path: PathBuf,
    /// Open and locked while it is in use.
    pub(super) lock: L,
}

pub(super) type UnfinishedFile = Unfinished<File>;
pub(super) type UnfinishedFolder = Unfinished<Option<File>>;

impl<L> Unfinished<L> {
    /// Creates it in `parent` by `create`, which returns its lock. The first call for a parent removes what killed programs
    /// left there.
    fn create(parent: &Path, create: impl Fn(&Path) -> io::Result<L>) -> io::Result<Self> {
        // A panic elsewhere does not leave the sets inconsistent.
        let (all, swept) = &mut *ALL.lock().unwrap_or_else(PoisonError::into_inner);
        if swept.insert(parent.to_owned()) {
            sweep(parent);
        }
        let created = Builder::new().prefix(PREFIX).suffix(SUFFIX).make_in(parent, |path| {
            let lock = create(path)?;
            // Another program may have swept it before it was locked: another name is tried.
            let exists = path.try_exists()?;
            exists.then_some(lock).ok_or_else(|| ErrorKind::AlreadyExists.into())
        });
        let created = created.map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => {
                io::Error::other("temporary files vanish as soon as they are created; give another place")
            }
            _ => error,
        });
        let (lock, path) = created?.into_parts();
        let path = path.keep()?;
        all.insert(path.clone());
        Ok(Self { path, lock })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Renames it to `target`; if there is a file or an empty folder already, replaces it or fails.
    pub(super) fn persist(self, target: &Path, may_replace: bool) -> io::Result<()> {
        let path = TempPath::try_from_path(&self.path)?;
        match may_replace {
            true => path.persist(target),
            false => path.persist_noclobber(target),
        }?;
        // The name survives a power failure as far as the file system can; the file is complete and in place.
        let _ = File::open(folder_of(target)).and_then(|folder| folder.sync_all());
        Ok(())
    }
}

impl<L> Drop for Unfinished<L> {
    fn drop(&mut self) {
        remove(&self.path);
        ALL.lock().unwrap_or_else(PoisonError::into_inner).0.remove(&self.path);
    }
}

impl UnfinishedFile {
    /// Creates a temporary file in `folder`.
    pub(super) fn begin(folder: &Path) -> io::Result<Self> {
        Self::create(folder, |path| File::create_new(path).map(locked))
    }
}

impl UnfinishedFolder {
    /// Creates a temporary folder in `parent`.
    pub(super) fn begin(parent: &Path) -> io::Result<Self> {
        Self::create(parent, |path| {
            fs::create_dir(path).map(|()| File::open(path).ok().map(locked))
        })
    }
}

fn locked(file: File) -> File {
    // Some file systems have no locks; nothing is swept there.
    let _ = file.lock();
    file
}

/// Folder of the file `path`.
pub(super) fn folder_of(path: &Path) -> &Path {
    // Standard input and output are where the program runs.
    let is_standard = [Path::new("/dev/stdin"), Path::new("/dev/stdout")].contains(&path);
    let parent = path.parent().filter(|parent| *parent != Path::new(""));
    parent.filter(|_| !is_standard).unwrap_or(Path::new("."))
}

/// Removes the unfinished files and folders in `folder` that are not in use. Those that cannot be removed stay.
fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, Ok(kind)) = (entry.path(), entry.file_type()) else {
            continue;
        };
        // Opening a pipe would wait for a program that writes to it.
        if !entry.file_name().to_str().is_some_and(is_our_name) || !(kind.is_file() || kind.is_dir()) {
            continue;
        }
        // Some file systems lock only what is open for writing, which a folder cannot be.
        let left = File::options().read(true).write(kind.is_file()).open(&path);
        if left.is_ok_and(|left| left.try_lock().is_ok()) {
            remove(&path);
        }
    }
}

fn is_our_name(name: &str) -> bool {
    /// Default length of the random part.
    const RANDOM: usize = 6;
    let random = name.strip_prefix(PREFIX).and_then(|name| name.strip_suffix(SUFFIX));
    random.is_some_and(|random| random.len() == RANDOM && random.bytes().all(|byte| byte.is_ascii_alphanumeric()))
}

/// Removes a file, or a folder to which another thread may be writing.
fn remove(path: &Path) {
    /// Each attempt fails only if a file was created while it removed the others.
    const ATTEMPTS: usize = 1000;
    // It may have been renamed or removed just now.
    if fs::remove_file(path).is_err() {
        let _ = (0..ATTEMPTS).find(|_| fs::remove_dir_all(path).is_ok() || !path.exists());
    }
}

/// Ends the program with this exit status, from any thread, after removing unfinished files.
pub fn exit_leaving_nothing(status: i32) -> ! {
    // Held until the end, so no other thread can add an entry.
    let all = ALL.lock().unwrap_or_else(PoisonError::into_inner);
    all.0.iter().for_each(|path| remove(path));
    std::process::exit(status)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_vanish_are_created_again_until_it_is_hopeless() {
        let home = tempfile::tempdir().unwrap();
        let attempts = std::cell::Cell::new(0);
        let vanishing = |remaining: usize| {
            attempts.set(0);
            Unfinished::create(home.path(), |path| {
                attempts.set(attempts.get() + 1);
                let file = File::create_new(path)?;
                if attempts.get() <= remaining {
                    fs::remove_file(path)?;
                }
                Ok(file)
            })
        };
        assert!(vanishing(3).is_ok() && attempts.get() == 4);
        assert!(
            vanishing(usize::MAX)
                .unwrap_err()
                .to_string()
                .contains("give another place")
        );
    }

    #[test]
    fn a_folder_is_removed_while_another_thread_fills_it() {
        let home = tempfile::tempdir().unwrap();
        for round in 0..20 {
            let folder = home.path().join(round.to_string());
            fs::create_dir(&folder).unwrap();
            std::thread::scope(|scope| {
                let filling = scope.spawn(|| (0..).find(|k| fs::write(folder.join(format!("{k}")), "x").is_err()));
                remove(&folder);
                assert!(!folder.exists());
                filling.join().unwrap();
            });
        }
    }

    /// Windows cannot lock folders.
    #[cfg(unix)]
    #[test]
    fn a_folder_in_use_stays_and_one_that_was_left_is_removed() {
        let home = tempfile::tempdir().unwrap();
        let at_work = UnfinishedFolder::begin(home.path()).unwrap();
        fs::write(at_work.path().join("half"), "1").unwrap();
        sweep(home.path());
        assert!(at_work.path().join("half").exists());
        // As a killed program leaves it: neither removed nor locked.
        let left = home.path().join(".decoupler-abc123.part");
        fs::create_dir(&left).unwrap();
        sweep(home.path());
        assert!(!left.exists() && at_work.path().exists());
        drop(at_work);
        assert_eq!(fs::read_dir(home.path()).unwrap().count(), 0);
    }
}
