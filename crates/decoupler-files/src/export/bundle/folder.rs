use std::{
    fs,
    path::{Path, PathBuf},
};

use super::report::BundleError;
use crate::export::{
    WriteError,
    unfinished::{UnfinishedFolder, folder_of},
};

/// A folder that is filled under a temporary name next to its target and then renamed: it exists completely or not at
/// all. Dropped before [`Self::commit`], it leaves nothing.
#[derive(Debug)]
pub(super) struct AtomicFolder {
    target: PathBuf,
    folder: UnfinishedFolder,
    /// Names of its files, with their sizes in bytes.
    files: Vec<(String, u64)>,
}

impl AtomicFolder {
    /// Creates the temporary folder next to `target`, which must be missing or an empty folder.
    ///
    /// # Errors
    /// Something else is there, or its folder cannot be written.
    pub(super) fn create(target: &Path) -> Result<Self, BundleError> {
        let exists = || BundleError::Exists(target.to_owned());
        let name = target.file_name().ok_or_else(exists)?;
        let parent = folder_of(target);
        if !parent.is_dir() {
            return Err(WriteError::no_folder(target, parent).into());
        }
        if fs::symlink_metadata(target).is_ok() && !is_empty_folder(target) {
            return Err(exists());
        }
        let folder = UnfinishedFolder::begin(parent).map_err(|error| WriteError::io(target, error))?;
        Ok(Self {
            target: parent.join(name),
            folder,
            files: Vec::new(),
        })
    }

    /// Path of the temporary folder.
    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Writes a file into it.
    ///
    /// # Errors
    /// The operating system refuses.
    pub(super) fn write(&mut self, name: &str, contents: impl AsRef<[u8]>) -> Result<(), BundleError> {
        let path = self.path().join(name);
        let written = fs::write(&path, &contents).and_then(|()| fs::File::open(&path)?.sync_all());
        written.map_err(|error| WriteError::io(&self.target.join(name), error))?;
        self.files.push((name.to_owned(), contents.as_ref().len() as u64));
        Ok(())
    }

    /// Renames it to its target. Returns the names of its files in order, with their sizes in bytes.
    ///
    /// # Errors
    /// Something has been created there in the meantime, or the operating system refuses.
    pub(super) fn commit(mut self) -> Result<Vec<(String, u64)>, BundleError> {
        let refused = |error| WriteError::io(&self.target, error);
        if is_empty_folder(&self.target) {
            fs::remove_dir(&self.target).map_err(refused)?;
        }
        self.folder.persist(&self.target, true).map_err(refused)?;
        self.files.sort();
        Ok(self.files)
    }
}

fn is_empty_folder(path: &Path) -> bool {
    fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none())
}

/// Maximum length of the identifier: with its suffixes it stays within the 63 characters of MATLAB.
const LONGEST: usize = 40;

/// Name for functions and files, after the folder of the bundle: lower-case letters, digits and underscores.
pub(super) fn identifier(path: &Path) -> String {
    let name = path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    let words = name
        .split(|c: char| !c.is_ascii_alphanumeric())
        .filter(|word| !word.is_empty());
    let mut joined = Vec::from_iter(words).join("_");
    if !joined.starts_with(|c: char| c.is_ascii_lowercase()) {
        joined.insert_str(0, if joined.is_empty() { "network" } else { "network_" });
    }
    joined.truncate(LONGEST);
    joined
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::test_folder::names;

    #[test]
    fn a_folder_exists_completely_or_not_at_all() {
        let home = tempfile::tempdir().unwrap();
        let target = home.path().join("bundle");
        let mut dropped = AtomicFolder::create(&target).unwrap();
        dropped.write("half", "1").unwrap();
        drop(dropped);
        assert_eq!(names(home.path()), [""; 0]);
        fs::create_dir(&target).unwrap();
        let mut folder = AtomicFolder::create(&target).unwrap();
        folder.write("whole", "2").unwrap();
        folder.commit().unwrap();
        assert_eq!(
            (names(home.path()), names(&target)),
            (vec!["bundle".into()], vec!["whole".into()])
        );
    }

    #[test]
    fn existing_files_and_folders_are_kept() {
        let home = tempfile::tempdir().unwrap();
        let [file, full] = ["file", "full"].map(|name| home.path().join(name));
        fs::write(&file, "").unwrap();
        fs::create_dir(&full).unwrap();
        fs::write(full.join("kept"), "").unwrap();
        for (path, expected) in [
            (&file, "is there already"),
            (&full, "is there already"),
            (&home.path().join("none/bundle"), "does not exist"),
        ] {
            let message = AtomicFolder::create(path).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        assert_eq!(
            (names(home.path()), names(&full)),
            (vec!["file".into(), "full".into()], vec!["kept".into()])
        );
    }

    #[test]
    fn every_folder_gives_a_valid_name() {
        let cases = [
            ("out/Left hand-2", "left_hand_2"),
            ("10x10_5x30", "network_10x10_5x30"),
            ("hånd", "h_nd"),
            ("__", "network"),
            ("a.b.bundle", "a_b"),
            ("", "network"),
        ];
        for (path, expected) in cases {
            assert_eq!(identifier(Path::new(path)), expected);
        }
        assert_eq!(identifier(Path::new(&"x".repeat(300))).len(), LONGEST);
    }
}
