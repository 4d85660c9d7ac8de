use std::{
    collections::BTreeSet,
    ffi::OsStr,
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
};

use tempfile::{NamedTempFile, PersistError};

const PREFIX: &str = ".decoupler-";
const SUFFIX: &str = ".part";

/// Paths of all files in the making. A program that is ended from another thread drops nothing, so it looks here.
static ALL: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn all() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A set is whole at any time.
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Folders in which this program has looked for what others left.
static SWEPT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// A file in the making, removed when dropped. It is locked while it is worked on: one that is not locked was left by a
/// program that was killed.
#[derive(Debug)]
pub(super) struct Unfinished {
    file: NamedTempFile,
    listed: Listed,
}

/// An entry of [`ALL`], while it lives.
#[derive(Debug)]
struct Listed(PathBuf);

impl Drop for Listed {
    fn drop(&mut self) {
        all().remove(&self.0);
    }
}

impl Unfinished {
    /// Begins a temporary file in `folder`, created with the default permissions (0666 minus the umask). The first time
    /// it removes what killed programs left there.
    pub(super) fn begin(folder: &Path) -> io::Result<Self> {
        let is_new = SWEPT
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(folder.to_owned());
        if is_new {
            sweep(folder);
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX).suffix(SUFFIX);
        #[cfg(unix)]
        {
            use std::{fs::Permissions, os::unix::fs::PermissionsExt};
            builder.permissions(Permissions::from_mode(0o666));
        }
        // The default error repeats the temporary name, which means nothing to the user.
        let plain = |error: io::Error| error.raw_os_error().map_or(error, io::Error::from_raw_os_error);
        let mut all = all();
        let file = loop {
            let file = builder.tempfile_in(folder).map_err(plain)?;
            // Some file systems have no locks: nobody will sweep there.
            let _ = file.as_file().lock();
            // Another program may have swept it before it was locked.
            if file.path().exists() {
                break file;
            }
        };
        all.insert(file.path().to_owned());
        let listed = Listed(file.path().to_owned());
        Ok(Self { file, listed })
    }

    pub(super) fn as_file(&self) -> &File {
        self.file.as_file()
    }

    /// Puts it in the place of `target`.
    pub(super) fn persist(self, target: &Path) -> io::Result<()> {
        self.persist_by(target, NamedTempFile::persist)
    }

    /// Puts it at `target`, where no file may be.
    pub(super) fn persist_new(self, target: &Path) -> io::Result<()> {
        self.persist_by(target, NamedTempFile::persist_noclobber)
    }

    fn persist_by(
        self,
        target: &Path,
        persist: fn(NamedTempFile, PathBuf) -> Result<File, PersistError>,
    ) -> io::Result<()> {
        let Self { file, listed } = self;
        let persisted = persist(file, target.to_owned());
        drop(listed);
        persisted.map_err(|error| error.error)?;
        sync_folder(folder_of(target));
        Ok(())
    }
}

/// Folder of the file `path`.
pub(super) fn folder_of(path: &Path) -> &Path {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent.unwrap_or(Path::new("."))
}

/// Has the names in `folder` outlast a power failure, as far as its file system can.
fn sync_folder(folder: &Path) {
    // The file is whole and in its place, so there is nothing to fail; Windows opens no folders.
    if cfg!(unix) {
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
}

/// Removes the files of [`Unfinished`] in `folder` that nobody works on. What cannot be removed stays.
fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if !is_file || !is_our_name(&entry.file_name()) {
            continue;
        }
        let left = File::options().read(true).write(true).open(entry.path());
        if left.is_ok_and(|left| left.try_lock().is_ok()) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn is_our_name(name: &OsStr) -> bool {
    /// As many as the random part has by default.
    const RANDOM: usize = 6;
    let random = name
        .to_str()
        .and_then(|name| name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX));
    random.is_some_and(|random| random.len() == RANDOM && random.bytes().all(|byte| byte.is_ascii_alphanumeric()))
}

/// Ends the program with this exit status, from any thread. Files in the making leave nothing.
#[cfg(feature = "cli")]
pub fn exit_leaving_nothing(status: i32) -> ! {
    // Held to the end, so that no other thread begins one meanwhile.
    let all = all();
    for path in all.iter() {
        // It may have found its place or have been removed just now.
        let _ = std::fs::remove_file(path);
    }
    std::process::exit(status)
}
