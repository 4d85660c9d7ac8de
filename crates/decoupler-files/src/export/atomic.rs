//! Atomic writing of files, and bounded reading of JSON files.

use std::{
    fs::{self, File, Permissions},
    io::{self, BufWriter, ErrorKind, Write},
    path::{Path, PathBuf},
};

use thiserror::Error;

use super::unfinished::{UnfinishedFile, folder_of};
use crate::machine::system_cause;

/// Error of writing a file.
#[derive(Debug, Error)]
#[error("cannot write '{}': {}", .path.display(), system_cause(.source))]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// The error of the operating system, or a cause in words.
    pub source: io::Error,
}

impl WriteError {
    /// Wraps the operating system's error about `path`.
    pub fn io(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        Self { path, source }
    }

    /// The folder of `path` is missing.
    pub(super) fn no_folder(path: &Path, folder: &Path) -> Self {
        let cause = format!("the folder '{}' does not exist; make it first", folder.display());
        Self::io(path, io::Error::other(cause))
    }
}

/// A file that is written under a temporary name next to its target and then renamed over it: readers never see a
/// partial file. Dropped before [`Self::commit`], it leaves nothing.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    writer: BufWriter<File>,
    /// The temporary file and its target; `None` for a pipe or device, which cannot be replaced by renaming.
    unfinished: Option<(UnfinishedFile, PathBuf)>,
}

/// Returns the file that a path leads to, in an existing folder, and its permissions if it exists; `None` for a pipe or device.
fn target_of(path: &Path) -> Result<Option<(PathBuf, Option<Permissions>)>, WriteError> {
    /// The limit of Linux.
    const MAX_LINKS: usize = 40;
    // Also a file to which a shell redirects it is not replaced.
    if path == Path::new("/dev/stdout") {
        return Ok(None);
    }
    let is_folder = path.file_name().is_none() || path.to_string_lossy().ends_with(std::path::is_separator);
    if is_folder || path.is_dir() {
        return Err(WriteError::io(path, ErrorKind::IsADirectory.into()));
    }
    // The target of a link is replaced, not the link itself.
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        let Ok(next) = fs::read_link(&target) else { break };
        target = target.parent().unwrap_or(Path::new("")).join(next);
    }
    let folder = folder_of(&target);
    if !folder.is_dir() {
        return Err(WriteError::no_folder(path, folder));
    }
    let refused = match fs::metadata(&target) {
        Ok(old) if !old.is_file() => return Ok(None),
        Ok(old) if old.permissions().readonly() => io::Error::other("it is read-only; give another name"),
        Ok(old) => return Ok(Some((target, Some(old.permissions())))),
        Err(missing) if missing.kind() == ErrorKind::NotFound => return Ok(Some((target, None))),
        Err(error) => error,
    };
    Err(WriteError::io(path, refused))
}

impl AtomicFile {
    /// Creates the temporary file for `path`, whose folder must exist.
    ///
    /// # Errors
    /// The path cannot be written.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let place = target_of(path)?;
        let created = || {
            let Some((target, permissions)) = place else {
                return Ok((File::options().append(true).open(path)?, None));
            };
            let unfinished = UnfinishedFile::begin(folder_of(&target))?;
            if let Some(permissions) = permissions {
                unfinished.lock.set_permissions(permissions)?;
            }
            Ok((unfinished.lock.try_clone()?, Some((unfinished, target))))
        };
        let (file, unfinished) = created().map_err(|source| WriteError::io(path, source))?;
        Ok(Self {
            path: path.to_owned(),
            writer: BufWriter::new(file),
            unfinished,
        })
    }

    /// Renames the temporary file to its target.
    ///
    /// # Errors
    /// Any error of the operating system; a file that was there before is then unchanged.
    pub fn commit(self) -> Result<(), WriteError> {
        self.finish(true).map(drop)
    }

    /// As [`Self::commit`], but never replaces a file, not even one that another program has just written: returns `false` if
    /// there is one.
    ///
    /// # Errors
    /// Any error of the operating system.
    pub(super) fn commit_new(self) -> Result<bool, WriteError> {
        self.finish(false)
    }

    fn finish(self, may_replace: bool) -> Result<bool, WriteError> {
        let finished = || {
            let file = self.writer.into_inner().map_err(io::IntoInnerError::into_error)?;
            let Some((unfinished, target)) = self.unfinished else {
                return Ok(true);
            };
            file.sync_all()?;
            match unfinished.persist(&target, may_replace) {
                Err(error) if !may_replace && error.kind() == ErrorKind::AlreadyExists => Ok(false),
                persisted => persisted.map(|()| true),
            }
        };
        finished().map_err(|source| WriteError::io(&self.path, source))
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

/// Writes the file at `path` atomically: whole or not at all.
///
/// # Errors
/// The path cannot be written, or `write` failed.
pub fn atomic_write(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    write(&mut file).map_err(|source| WriteError::io(path, source))?;
    file.commit()
}

/// Checks that `path` can be written, before the work that produces its contents. Leaves no trace.
///
/// # Errors
/// The path cannot be written.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    match target_of(path)? {
        // Opening and closing a pipe would signal the end of the file to its reader.
        None => Ok(()),
        Some(_) => AtomicFile::create(path).map(drop),
    }
}

/// Returns true if two paths lead to the same file, existing or not, also through links and hard links. Pipes and devices
/// are never the same: reading from one does not destroy what was written to it.
pub fn is_same(one: &Path, other: &Path) -> bool {
    let is_special = |path: &Path| fs::metadata(path).is_ok_and(|found| !found.is_file());
    if is_special(one) || is_special(other) {
        return false;
    }
    let place = |path: &Path| {
        let new = || Some(fs::canonicalize(folder_of(path)).ok()?.join(path.file_name()?));
        fs::canonicalize(path).ok().or_else(new)
    };
    same_file::is_same_file(one, other).unwrap_or(false) || (place(one).is_some() && place(one) == place(other))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::export::test_folder::names;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("kept.csv");
        atomic_write(&path, |writer| writer.write_all(b"old")).unwrap();
        let failed = atomic_write(&path, |writer| {
            writer.write_all(b"new")?;
            Err(io::Error::other("the disk is full"))
        });
        assert!(failed.unwrap_err().to_string().contains("kept.csv': the disk is full"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["kept.csv"]);
        check_writable(&folder.path().join("other.csv")).unwrap();
        assert_eq!(names(folder.path()), ["kept.csv"]);
    }

    #[test]
    fn unwritable_paths_are_reported_before_any_work() {
        let folder = tempfile::tempdir().unwrap();
        let read_only = folder.path().join("fixed.csv");
        fs::write(&read_only, "old").unwrap();
        let mut permissions = fs::metadata(&read_only).unwrap().permissions();
        permissions.set_readonly(true);
        fs::set_permissions(&read_only, permissions).unwrap();
        let cases = [
            ("a missing folder", folder.path().join("none/file"), "does not exist"),
            ("a folder", folder.path().to_owned(), "it is a folder"),
            ("a folder to be", folder.path().join("new/"), "it is a folder"),
            ("a read-only file", read_only.clone(), "read-only"),
            ("a file as folder", read_only.join("file"), "does not exist"),
            ("too long a name", folder.path().join("x".repeat(300)), "too long"),
        ];
        for (sentence, path, expected) in cases {
            let message = check_writable(&path).unwrap_err().to_string();
            assert!(message.contains(expected), "{sentence}: {message}");
            assert!(atomic_write(&path, |_| Ok(())).is_err(), "{sentence}");
        }
        assert_eq!(names(folder.path()), ["fixed.csv"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_and_permissions_are_preserved() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [path, ordinary, link] = ["file", "ordinary", "link"].map(|name| folder.path().join(name));
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        fs::write(&ordinary, "").unwrap();
        atomic_write(&path, |_| Ok(())).unwrap();
        assert_eq!(mode(&path), mode(&ordinary));
        fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        atomic_write(&link, |writer| writer.write_all(b"through")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"through");
        assert_eq!(mode(&path), 0o640);
        atomic_write(Path::new("/dev/null"), |writer| writer.write_all(b"gone")).unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }

    #[cfg(unix)]
    #[test]
    fn dangling_links_stay_links_and_their_target_is_created() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("inner")).unwrap();
        symlink("second", at("first")).unwrap();
        symlink("inner/file", at("second")).unwrap();
        symlink("none/file", at("stray")).unwrap();
        symlink("circle", at("circle")).unwrap();
        atomic_write(&at("first"), |writer| writer.write_all(b"through")).unwrap();
        for link in ["first", "second"] {
            assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink(), "{link}");
        }
        assert_eq!(fs::read(at("inner/file")).unwrap(), b"through");
        let missing = atomic_write(&at("stray"), |_| Ok(())).unwrap_err().to_string();
        assert!(missing.contains("none' does not exist"), "{missing}");
        assert!(atomic_write(&at("circle"), |_| Ok(())).is_err());
        assert_eq!(names(&at("inner")), ["file"]);
    }

    #[test]
    fn a_new_file_never_replaces_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.json");
        let write = |text: &[u8]| {
            let mut file = AtomicFile::create(&path)?;
            file.write_all(text).unwrap();
            Ok(file)
        };
        let (first, second) = (write(b"first"), write(b"second"));
        let commit = |file: Result<AtomicFile, WriteError>| file.unwrap().commit_new();
        assert!(commit(first).unwrap() && !commit(second).unwrap());
        assert_eq!(fs::read(&path).unwrap(), b"first");
        assert_eq!(names(folder.path()), ["run.json"]);
    }

    #[test]
    fn a_file_is_the_same_by_any_of_its_paths() {
        let folder = tempfile::tempdir().unwrap();
        let [file, same, other] = ["a", "./a", "b"].map(|name| folder.path().join(name));
        assert!(
            is_same(&file, &same) && !is_same(&file, &other),
            "before there is a file"
        );
        fs::write(&file, "").unwrap();
        assert!(is_same(&file, &same) && !is_same(&file, &other));
        fs::hard_link(&file, &other).unwrap();
        assert!(is_same(&file, &other));
    }

    #[cfg(unix)]
    #[test]
    fn a_device_may_be_read_and_written() {
        assert!(!is_same(Path::new("/dev/null"), Path::new("/dev/null")));
    }
}
