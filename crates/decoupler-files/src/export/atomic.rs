//! Atomic writing of files, and bounded reading of JSON files.

use std::{
    fs::{self, File, Permissions},
    io::{self, BufWriter, ErrorKind, Read, Write},
    path::{Path, PathBuf},
};

use thiserror::Error;

use super::{
    tables::{Heading, NoHeading},
    unfinished::{UnfinishedFile, folder_of},
};
use crate::machine::{ReadingBudget, system_cause};

/// Errors of writing a file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WriteError {
    /// Its folder is missing.
    #[error("cannot write '{}': the folder '{}' does not exist; make it first", .path.display(), .folder.display())]
    NoFolder {
        /// The file.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
    },
    /// The path is a folder.
    #[error("cannot write '{}': it is a folder; give the name of a file", .0.display())]
    Folder(PathBuf),
    /// The file there is write-protected.
    #[error("cannot write '{}': it is read-only; give another name", .0.display())]
    ReadOnly(PathBuf),
    /// The operating system refuses.
    #[error("cannot write '{}': {}", .path.display(), system_cause(.source))]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
}

impl WriteError {
    /// Wraps the operating system's error about `path`.
    pub fn io(path: &Path, source: io::Error) -> Self {
        Self::Io {
            path: path.to_owned(),
            source,
        }
    }

    /// Returns true if there is such a file already, see [`AtomicFile::commit_new`].
    pub(super) fn is_taken(&self) -> bool {
        matches!(self, Self::Io { source, .. } if source.kind() == ErrorKind::AlreadyExists)
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

/// The file that a path leads to, new or old, in an existing folder.
struct Place {
    target: PathBuf,
    folder: PathBuf,
    permissions: Option<Permissions>,
}

impl Place {
    /// Returns the place of a file; `None` for a pipe or device.
    fn of(path: &Path) -> Result<Option<Self>, WriteError> {
        // Also a file to which a shell redirects it is not replaced.
        if path == Path::new("/dev/stdout") {
            return Ok(None);
        }
        let is_folder = path.file_name().is_none() || path.to_string_lossy().ends_with(std::path::is_separator);
        if is_folder || path.is_dir() {
            return Err(WriteError::Folder(path.to_owned()));
        }
        let folder = existing_folder(path, path)?;
        let error = |source| WriteError::io(path, source);
        let old = match fs::metadata(path) {
            Ok(old) => old,
            Err(missing) if missing.kind() == ErrorKind::NotFound => {
                let target = link_target(path);
                let folder = existing_folder(path, &target)?;
                let permissions = None;
                return Ok(Some(Self {
                    target,
                    folder,
                    permissions,
                }));
            }
            Err(source) => return Err(error(source)),
        };
        if !old.is_file() {
            return Ok(None);
        }
        if old.permissions().readonly() {
            return Err(WriteError::ReadOnly(path.to_owned()));
        }
        // The target of a link is replaced, not the link itself.
        let target = fs::canonicalize(path).map_err(error)?;
        let folder = target.parent().unwrap_or(&folder).to_owned();
        let permissions = Some(old.permissions());
        Ok(Some(Self {
            target,
            folder,
            permissions,
        }))
    }
}

/// Returns the folder of `target`, the file that `path` leads to.
fn existing_folder(path: &Path, target: &Path) -> Result<PathBuf, WriteError> {
    let folder = folder_of(target).to_owned();
    if folder.is_dir() {
        return Ok(folder);
    }
    let path = path.to_owned();
    Err(WriteError::NoFolder { path, folder })
}

/// Follows a link to a file that is missing, through further links.
fn link_target(path: &Path) -> PathBuf {
    /// The limit of Linux.
    const MAX_LINKS: usize = 40;
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        let Ok(next) = fs::read_link(&target) else { break };
        target = target.parent().unwrap_or(Path::new("")).join(next);
    }
    target
}

impl AtomicFile {
    /// Creates the temporary file for `path`, whose folder must exist.
    ///
    /// # Errors
    /// The path cannot be written.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let place = Place::of(path)?;
        let created = || {
            let Some(place) = place else {
                return Ok((File::options().append(true).open(path)?, None));
            };
            let unfinished = UnfinishedFile::begin(&place.folder)?;
            if let Some(permissions) = place.permissions {
                unfinished.as_file().set_permissions(permissions)?;
            }
            Ok((unfinished.as_file().try_clone()?, Some((unfinished, place.target))))
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
        self.finish(true)
    }

    /// As [`Self::commit`], but never replaces a file, not even one that another program has just written.
    ///
    /// # Errors
    /// Any error of the operating system: [`ErrorKind::AlreadyExists`] if there is such a file.
    pub(super) fn commit_new(self) -> Result<(), WriteError> {
        self.finish(false)
    }

    fn finish(self, may_replace: bool) -> Result<(), WriteError> {
        let finished = || {
            let file = self.writer.into_inner().map_err(io::IntoInnerError::into_error)?;
            let Some((unfinished, target)) = self.unfinished else {
                return Ok(());
            };
            file.sync_all()?;
            drop(file);
            unfinished.persist(&target, may_replace)
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
    match Place::of(path)? {
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
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = fs::canonicalize(folder.unwrap_or(Path::new("."))).ok()?;
        let new = path.file_name().map(|name| folder.join(name));
        fs::canonicalize(path).ok().or(new)
    };
    is_same_on_disk(one, other) || (place(one).is_some() && place(one) == place(other))
}

#[cfg(unix)]
fn is_same_on_disk(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let on_disk = |path: &Path| fs::metadata(path).ok().map(|found| (found.dev(), found.ino()));
    on_disk(one).is_some() && on_disk(one) == on_disk(other)
}

#[cfg(not(unix))]
fn is_same_on_disk(_one: &Path, _other: &Path) -> bool {
    false
}

/// Memory that a byte of JSON may take once it is read: short arrays of short numbers.
const MEMORY_OF_BYTE: u64 = 8;
/// Largest JSON file that is read or written, in bytes: 1 GiB.
pub(super) const LARGEST_BYTES: u64 = 1 << 30;
/// Number of bytes that are read at once.
const BLOCK: u64 = 1 << 20;
/// Number of bytes that are read first, to decide whether to read the rest.
const BEGINNING: u64 = 1 << 16;

/// Reads the JSON file at `path`. If its beginning shows that Decoupler did not write it, returns only the beginning.
///
/// # Errors
/// The operating system refuses, or the file does not end within [`LARGEST_BYTES`], or it needs too much memory.
pub(super) fn read_limited(path: &Path) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    if length > LARGEST_BYTES {
        return Err(too_large());
    }
    let mut budget = ReadingBudget::now();
    let mut claim = |bytes: u64| {
        let claimed = budget.claim(bytes.saturating_mul(MEMORY_OF_BYTE));
        claimed.map_err(|over| io::Error::new(ErrorKind::FileTooLarge, over))
    };
    claim(length)?;
    let mut bytes = Vec::new();
    (&file).take(BEGINNING).read_to_end(&mut bytes)?;
    if matches!(Heading::read(&bytes), Err(NoHeading::NotJson(_) | NoHeading::Other)) {
        return Ok(bytes);
    }
    // The length of a pipe or device is unknown.
    loop {
        let before = bytes.len() as u64;
        (&file).take(BLOCK).read_to_end(&mut bytes)?;
        let read = bytes.len() as u64;
        if read == before {
            return Ok(bytes);
        }
        if read > LARGEST_BYTES {
            return Err(too_large());
        }
        claim(read.saturating_sub(before.max(length)))?;
    }
}

pub(super) fn too_large() -> io::Error {
    io::Error::new(
        ErrorKind::FileTooLarge,
        "it is larger than 1 GiB, the largest size of such files",
    )
}

#[cfg(test)]
mod tests {
    use std::fs;

    use rand::{Rng, SeedableRng, rngs::ChaCha8Rng};

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
        commit(first).unwrap();
        assert!(commit(second).unwrap_err().is_taken());
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

    #[test]
    fn only_the_beginning_of_other_files_than_json_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let read = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            read_limited(&path).unwrap()
        };
        let json = format!("{{\"format\":\"a\",\"text\":\"{}\"}}", "ä".repeat(100_000));
        assert_eq!(read(json.as_bytes()), json.as_bytes());
        let cut = &json.as_bytes()[..150_000];
        assert_eq!(read(cut), cut);
        assert_eq!(read(&[b'x'; 100_000]).len(), 1 << 16);
    }

    #[test]
    fn only_the_beginning_of_random_bytes_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut bytes = vec![0; 100_000];
        ChaCha8Rng::seed_from_u64(0).fill_bytes(&mut bytes);
        for first in 0..=u8::MAX {
            bytes[0] = first;
            fs::write(&path, &bytes).unwrap();
            assert_eq!(read_limited(&path).unwrap().len(), 1 << 16, "first byte {first}");
        }
    }

    #[test]
    fn oversized_files_are_refused_unread() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, "{\"format\":\"").unwrap();
        File::options()
            .write(true)
            .open(&path)
            .unwrap()
            .set_len(1 << 40)
            .unwrap();
        assert_eq!(read_limited(&path).unwrap_err().kind(), ErrorKind::FileTooLarge);
    }
}
