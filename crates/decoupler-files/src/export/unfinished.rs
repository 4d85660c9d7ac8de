use std::{
    collections::BTreeSet,
    ffi::OsStr,
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
};

use tempfile::{Builder, NamedTempFile, TempDir};

const PREFIX: &str = ".decoupler-";
const SUFFIX: &str = ".part";

/// Paths of all unfinished files and folders. A program that exits from another thread drops nothing, so
/// [`exit_leaving_nothing`] removes these.
static ALL: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn all() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A panic elsewhere does not leave the set inconsistent.
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Folders in which this program has removed the unfinished files of killed programs.
static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// An unfinished file or folder, removed when dropped. It is locked while in use; an unlocked one was left by a program that
/// was killed. Windows cannot lock folders, so none is swept there.
#[derive(Debug)]
pub(super) struct Unfinished<T> {
    item: T,
    listed: Listed,
    /// Open while it is in use.
    lock: Option<File>,
}

pub(super) type UnfinishedFile = Unfinished<NamedTempFile>;
pub(super) type UnfinishedFolder = Unfinished<TempDir>;

/// An entry of [`ALL`], removed when dropped.
#[derive(Debug)]
struct Listed(PathBuf);

impl Drop for Listed {
    fn drop(&mut self) {
        all().remove(&self.0);
    }
}

impl<T: AsRef<Path>> Unfinished<T> {
    /// Creates it in `parent` with the permissions `mode` minus the umask. The first call for a parent removes what killed
    /// programs left there.
    fn create(parent: &Path, mode: u32, create: impl Fn(&Builder<'_, '_>) -> io::Result<T>) -> io::Result<Self> {
        sweep_once(parent);
        let mut builder = Builder::new();
        builder.prefix(PREFIX).suffix(SUFFIX);
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(mode));
        let mut all = all();
        let (item, lock) = not_swept(|| {
            let item = create(&builder).map_err(plain)?;
            // Some file systems have no locks; nothing is swept there.
            let lock = File::open(&item).ok();
            let _ = lock.as_ref().map(File::lock);
            Ok(item.as_ref().try_exists()?.then_some((item, lock)))
        })?;
        all.insert(item.as_ref().to_owned());
        let listed = Listed(item.as_ref().to_owned());
        Ok(Self { item, listed, lock })
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
        let Self { item, listed, lock } = self;
        let persisted = match may_replace {
            true => item.persist(target),
            false => item.persist_noclobber(target),
        };
        drop((listed, lock));
        persisted.map_err(|error| error.error)?;
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
        let Self { item, listed, lock } = self;
        fs::rename(item.path(), target)?;
        // Its temporary name no longer exists.
        let _ = item.keep();
        drop((listed, lock));
        sync_folder(folder_of(target));
        Ok(())
    }
}

/// Calls `create` until what it has created still exists: another program may have swept it before it was locked.
fn not_swept<T>(mut create: impl FnMut() -> io::Result<Option<T>>) -> io::Result<T> {
    /// A program sweeps a folder once, so that more attempts mean another fault.
    const ATTEMPTS: usize = 10;
    for _ in 0..ATTEMPTS {
        if let Some(created) = create()? {
            return Ok(created);
        }
    }
    Err(io::Error::other(
        "temporary files vanish as soon as they are created; give another place",
    ))
}

/// Returns the system's error: the default one contains the temporary name, which the user does not know.
fn plain(error: io::Error) -> io::Error {
    error.raw_os_error().map_or(error, io::Error::from_raw_os_error)
}

/// Opens and locks a folder that is not in use.
fn locked_folder(path: &Path) -> Option<File> {
    let folder = File::open(path).ok()?;
    folder.try_lock().is_ok().then_some(folder)
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

/// Sweeps `folder` the first time that this program writes there.
fn sweep_once(folder: &Path) {
    let is_new = SWEPT
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .insert(folder.to_owned());
    if is_new {
        sweep(folder);
    }
}

/// Removes the unfinished files and folders in `folder` that are not in use. Those that cannot be removed stay.
fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let Ok(kind) = entry.file_type() else { continue };
        if !is_our_name(&entry.file_name()) {
            continue;
        }
        let path = entry.path();
        if kind.is_file() {
            let left = File::options().read(true).write(true).open(&path);
            if left.is_ok_and(|left| left.try_lock().is_ok()) {
                let _ = fs::remove_file(path);
            }
        } else if kind.is_dir() && locked_folder(&path).is_some() {
            let _ = fs::remove_dir_all(path);
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
fn remove_folder(path: &Path) -> io::Result<()> {
    /// Each attempt fails only if a file was created while it removed the others.
    const ATTEMPTS: usize = 1000;
    let mut removed = fs::remove_dir_all(path);
    for _ in 1..ATTEMPTS {
        if removed.is_ok() || !path.exists() {
            break;
        }
        removed = fs::remove_dir_all(path);
    }
    removed
}

/// Ends the program with this exit status, from any thread, after removing unfinished files.
pub fn exit_leaving_nothing(status: i32) -> ! {
    // Held until the end, so no other thread can add an entry.
    let all = all();
    for path in all.iter() {
        // It may have been renamed or removed just now.
        let _ = fs::remove_file(path).or_else(|_| remove_folder(path));
    }
    std::process::exit(status)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn attempts_are_limited() {
        let mut attempts = 0;
        let vanished = not_swept(|| {
            attempts += 1;
            Ok(None::<()>)
        });
        assert!(vanished.is_err() && attempts == 10, "{attempts}");
        assert_eq!(not_swept(|| Ok(Some(1))).unwrap(), 1);
    }

    #[test]
    fn a_folder_is_removed_while_another_thread_fills_it() {
        let home = tempfile::tempdir().unwrap();
        for round in 0..20 {
            let folder = home.path().join(round.to_string());
            fs::create_dir(&folder).unwrap();
            std::thread::scope(|scope| {
                let filling = scope.spawn(|| (0..).find(|k| fs::write(folder.join(format!("{k}")), "x").is_err()));
                let _ = remove_folder(&folder);
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
        let Unfinished { item, lock, .. } = at_work;
        let left = item.keep();
        drop(lock);
        sweep(home.path());
        assert!(!left.exists());
    }
}
