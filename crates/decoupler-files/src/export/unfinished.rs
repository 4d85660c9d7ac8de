use std::{
    collections::BTreeSet,
    ffi::OsStr,
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use tempfile::{Builder, NamedTempFile, TempDir};

const PREFIX: &str = ".decoupler-";
const SUFFIX: &str = ".part";

/// Paths of all unfinished files and folders, and the folders that were swept.
static ALL: Mutex<(BTreeSet<PathBuf>, BTreeSet<PathBuf>)> = Mutex::new((BTreeSet::new(), BTreeSet::new()));

/// An unfinished file or folder, removed when dropped. It is locked while in use; an unlocked one was left by a program that
/// was killed. Windows cannot lock folders, so none is swept there.
#[derive(Debug)]
pub(super) struct Unfinished<T> {
    item: T,
    _listed: Listed,
    /// Open while it is in use.
    _lock: Option<File>,
}

pub(super) type UnfinishedFile = Unfinished<NamedTempFile>;
pub(super) type UnfinishedFolder = Unfinished<TempDir>;

/// An entry of [`ALL`], removed when dropped. A program that exits from another thread drops nothing, so
/// [`exit_leaving_nothing`] removes these.
#[derive(Debug)]
struct Listed(PathBuf);

impl Drop for Listed {
    fn drop(&mut self) {
        ALL.lock().unwrap_or_else(PoisonError::into_inner).0.remove(&self.0);
    }
}

impl<T: AsRef<Path>> Unfinished<T> {
    /// Creates it in `parent` with the permissions `mode` minus the umask. The first call for a parent removes what killed
    /// programs left there.
    fn create(parent: &Path, mode: u32, create: impl Fn(&Builder<'_, '_>) -> io::Result<T>) -> io::Result<Self> {
        /// A program sweeps a folder once, so that more attempts mean another fault.
        const ATTEMPTS: usize = 10;
        // A panic elsewhere does not leave the sets inconsistent.
        let (all, swept) = &mut *ALL.lock().unwrap_or_else(PoisonError::into_inner);
        if swept.insert(parent.to_owned()) {
            sweep(parent);
        }
        let mut builder = Builder::new();
        builder.prefix(PREFIX).suffix(SUFFIX);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
        for _ in 0..ATTEMPTS {
            // The default error contains the temporary name, which the user does not know.
            let item =
                create(&builder).map_err(|error| error.raw_os_error().map_or(error, io::Error::from_raw_os_error))?;
            // Some file systems have no locks; nothing is swept there.
            let _lock = File::open(&item).ok().inspect(|file| _ = file.lock());
            // Another program may have swept it before it was locked.
            if item.as_ref().try_exists()? {
                all.insert(item.as_ref().to_owned());
                let _listed = Listed(item.as_ref().to_owned());
                return Ok(Self { item, _listed, _lock });
            }
        }
        Err(io::Error::other(
            "temporary files vanish as soon as they are created; give another place",
        ))
    }
}

impl UnfinishedFile {
    /// Creates a temporary file in `folder`.
    pub(super) fn begin(folder: &Path) -> io::Result<Self> {
        Self::create(folder, 0o666, |builder| builder.tempfile_in(folder))
    }

    pub(super) fn as_file(&self) -> &File {
        self.item.as_file()
    }

    /// Renames it to `target`; if there is a file already, replaces it or fails.
    pub(super) fn persist(self, target: &Path, may_replace: bool) -> io::Result<()> {
        match may_replace {
            true => self.item.persist(target),
            false => self.item.persist_noclobber(target),
        }?;
        sync_folder(folder_of(target));
        Ok(())
    }
}

impl UnfinishedFolder {
    /// Creates a temporary folder in `parent`.
    pub(super) fn begin(parent: &Path) -> io::Result<Self> {
        Self::create(parent, 0o777, |builder| builder.tempdir_in(parent))
    }

    pub(super) fn path(&self) -> &Path {
        self.item.path()
    }

    /// Renames it to `target`, which must be missing or an empty folder.
    pub(super) fn persist(self, target: &Path) -> io::Result<()> {
        fs::rename(self.item.path(), target)?;
        // Its temporary name no longer exists.
        let _ = self.item.keep();
        sync_folder(folder_of(target));
        Ok(())
    }
}

/// Folder of the file `path`.
pub(super) fn folder_of(path: &Path) -> &Path {
    // Standard input and output are where the program runs.
    let is_standard = [Path::new("/dev/stdin"), Path::new("/dev/stdout")].contains(&path);
    let parent = path
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty() && !is_standard);
    parent.unwrap_or(Path::new("."))
}

/// Makes the names in `folder` survive a power failure, as far as its file system can.
fn sync_folder(folder: &Path) {
    // Errors are ignored because the file is complete and in place. Windows cannot open folders.
    if cfg!(unix) {
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
}

/// Removes the unfinished files and folders in `folder` that are not in use. Those that cannot be removed stay.
fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, Ok(kind)) = (entry.path(), entry.file_type()) else {
            continue;
        };
        // Opening a pipe would wait for a program that writes to it.
        if !is_our_name(&entry.file_name()) || !(kind.is_file() || kind.is_dir()) {
            continue;
        }
        // Some file systems lock only what is open for writing, which a folder cannot be.
        let left = File::options().read(true).write(kind.is_file()).open(&path);
        if left.is_ok_and(|left| left.try_lock().is_ok()) {
            let _ = fs::remove_file(&path).or_else(|_| fs::remove_dir_all(&path));
        }
    }
}

fn is_our_name(name: &OsStr) -> bool {
    /// Default length of the random part.
    const RANDOM: usize = 6;
    let random = name
        .to_str()
        .and_then(|name| name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX));
    random.is_some_and(|random| random.len() == RANDOM && random.bytes().all(|byte| byte.is_ascii_alphanumeric()))
}

/// Removes a folder to which another thread may be writing.
fn remove_folder(path: &Path) {
    /// Each attempt fails only if a file was created while it removed the others.
    const ATTEMPTS: usize = 1000;
    let _ = (0..ATTEMPTS).find(|_| fs::remove_dir_all(path).is_ok() || !path.exists());
}

/// Ends the program with this exit status, from any thread, after removing unfinished files.
pub fn exit_leaving_nothing(status: i32) -> ! {
    // Held until the end, so no other thread can add an entry.
    let all = ALL.lock().unwrap_or_else(PoisonError::into_inner);
    for path in &all.0 {
        // It may have been renamed or removed just now.
        if fs::remove_file(path).is_err() {
            remove_folder(path);
        }
    }
    std::process::exit(status)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn attempts_are_limited() {
        let home = tempfile::tempdir().unwrap();
        let attempts = std::cell::Cell::new(0);
        let vanishing = |remaining: usize| {
            attempts.set(0);
            Unfinished::create(home.path(), 0o666, |builder| {
                attempts.set(attempts.get() + 1);
                let file = builder.tempfile_in(home.path())?;
                if attempts.get() <= remaining {
                    fs::remove_file(file.path())?;
                }
                Ok(file)
            })
        };
        assert!(vanishing(usize::MAX).is_err() && attempts.get() == 10, "{attempts:?}");
        assert!(vanishing(3).is_ok() && attempts.get() == 4);
    }

    #[test]
    fn a_folder_is_removed_while_another_thread_fills_it() {
        let home = tempfile::tempdir().unwrap();
        for round in 0..20 {
            let folder = home.path().join(round.to_string());
            fs::create_dir(&folder).unwrap();
            std::thread::scope(|scope| {
                let filling = scope.spawn(|| (0..).find(|k| fs::write(folder.join(format!("{k}")), "x").is_err()));
                remove_folder(&folder);
                assert!(!folder.exists());
                filling.join().unwrap();
            });
        }
    }

    #[test]
    fn a_folder_in_use_stays_and_one_that_was_left_is_removed() {
        let home = tempfile::tempdir().unwrap();
        let at_work = UnfinishedFolder::begin(home.path()).unwrap();
        fs::write(at_work.path().join("half"), "1").unwrap();
        sweep(home.path());
        assert!(at_work.path().join("half").exists());
        // As a killed program leaves it: neither removed nor locked.
        let Unfinished { item, _lock: lock, .. } = at_work;
        let left = item.keep();
        drop(lock);
        sweep(home.path());
        assert!(!left.exists());
    }
}
