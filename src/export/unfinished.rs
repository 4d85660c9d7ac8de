use std::{
    collections::BTreeSet,
    fs::File,
    io,
    path::{Path, PathBuf},
    sync::{Mutex, MutexGuard, PoisonError},
};

use tempfile::NamedTempFile;

/// Paths of all files in the making. A program that is ended from another thread drops nothing, so it looks here.
static ALL: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn all() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    // A set is whole at any time.
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file in the making, removed when dropped.
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
    /// Begins a temporary file in `folder`, created with the default permissions (0666 minus the umask).
    pub(super) fn begin(folder: &Path) -> io::Result<Self> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".decoupler-").suffix(".part");
        #[cfg(unix)]
        {
            use std::{fs::Permissions, os::unix::fs::PermissionsExt};
            builder.permissions(Permissions::from_mode(0o666));
        }
        // The default error repeats the temporary name, which means nothing to the user.
        let plain = |error: io::Error| error.raw_os_error().map_or(error, io::Error::from_raw_os_error);
        let mut all = all();
        let file = builder.tempfile_in(folder).map_err(plain)?;
        all.insert(file.path().to_owned());
        let listed = Listed(file.path().to_owned());
        Ok(Self { file, listed })
    }

    pub(super) fn as_file(&self) -> &File {
        self.file.as_file()
    }

    /// Puts it in the place of `target`.
    pub(super) fn persist(self, target: &Path) -> io::Result<()> {
        let Self { file, listed } = self;
        let persisted = file.persist(target);
        drop(listed);
        persisted.map(drop).map_err(|error| error.error)
    }
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
