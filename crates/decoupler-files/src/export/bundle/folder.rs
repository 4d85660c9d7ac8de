use std::{
    fs,
    path::{Path, PathBuf},
};

use super::error::BundleError;
use crate::export::{WriteError, unfinished::UnfinishedFolder};

/// A folder that is filled under a temporary name next to its target and then renamed, so that it is there whole or not at
/// all. Dropped before [`Self::commit`], it leaves nothing.
#[derive(Debug)]
pub(super) struct AtomicFolder {
    target: PathBuf,
    folder: UnfinishedFolder,
}

impl AtomicFolder {
    /// Creates the temporary folder next to `target`, which must be missing or an empty folder.
    ///
    /// # Errors
    /// Something else is there, or its folder cannot be written.
    pub(super) fn create(target: &Path) -> Result<Self, BundleError> {
        let name = target
            .file_name()
            .ok_or_else(|| BundleError::Exists(target.to_owned()))?;
        let parent = target.parent().filter(|parent| !parent.as_os_str().is_empty());
        let parent = parent.unwrap_or(Path::new("."));
        if !parent.is_dir() {
            let (path, folder) = (target.to_owned(), parent.to_owned());
            return Err(WriteError::NoFolder { path, folder }.into());
        }
        if fs::symlink_metadata(target).is_ok() && !is_empty_folder(target) {
            return Err(BundleError::Exists(target.to_owned()));
        }
        let folder = UnfinishedFolder::begin(parent).map_err(|error| WriteError::io(target, error))?;
        Ok(Self {
            target: parent.join(name),
            folder,
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
    pub(super) fn write(&self, name: &str, contents: impl AsRef<[u8]>) -> Result<(), BundleError> {
        let path = self.path().join(name);
        let written = fs::write(&path, contents).and_then(|()| fs::File::open(&path)?.sync_all());
        Ok(written.map_err(|error| WriteError::io(&self.target.join(name), error))?)
    }

    /// Names of its files in order, with their sizes in bytes.
    ///
    /// # Errors
    /// The operating system refuses.
    pub(super) fn sizes(&self) -> Result<Vec<(String, u64)>, BundleError> {
        let sizes = || {
            let mut sizes = Vec::new();
            for entry in fs::read_dir(self.path())? {
                let entry = entry?;
                sizes.push((
                    entry.file_name().to_string_lossy().into_owned(),
                    entry.metadata()?.len(),
                ));
            }
            sizes.sort();
            Ok(sizes)
        };
        Ok(sizes().map_err(|error| WriteError::io(&self.target, error))?)
    }

    /// Puts one of its files in the place of its target, and leaves nothing of the folder.
    ///
    /// # Errors
    /// Something came to be there meanwhile, or the operating system refuses.
    pub(super) fn commit_only(self, name: &str) -> Result<(), BundleError> {
        if fs::symlink_metadata(&self.target).is_ok() {
            return Err(BundleError::Exists(self.target));
        }
        let renamed = fs::rename(self.path().join(name), &self.target);
        Ok(renamed.map_err(|error| WriteError::io(&self.target, error))?)
    }

    /// Renames it to its target.
    ///
    /// # Errors
    /// Something came to be there meanwhile, or the operating system refuses.
    pub(super) fn commit(self) -> Result<(), BundleError> {
        let Self { target, folder } = self;
        if is_empty_folder(&target) {
            fs::remove_dir(&target).map_err(|error| WriteError::io(&target, error))?;
        }
        Ok(folder
            .persist(&target)
            .map_err(|error| WriteError::io(&target, error))?)
    }
}

fn is_empty_folder(path: &Path) -> bool {
    fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::test_folder::names;

    #[test]
    fn it_is_there_whole_or_not_at_all() {
        let home = tempfile::tempdir().unwrap();
        let target = home.path().join("bundle");
        let dropped = AtomicFolder::create(&target).unwrap();
        dropped.write("half", "1").unwrap();
        drop(dropped);
        assert_eq!(names(home.path()), [""; 0]);
        fs::create_dir(&target).unwrap();
        let folder = AtomicFolder::create(&target).unwrap();
        folder.write("whole", "2").unwrap();
        folder.commit().unwrap();
        assert_eq!(
            (names(home.path()), names(&target)),
            (vec!["bundle".into()], vec!["whole".into()])
        );
    }

    #[test]
    fn what_is_in_the_way_stays() {
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
}
