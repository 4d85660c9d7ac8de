use std::path::{Path, PathBuf};

use decoupler_files::export::is_same;

/// A file in use, which must not be overwritten.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileInUse {
    /// A recording or another file that is read again.
    Recording(PathBuf),
    /// The checkpoint that a training was resumed from. The same training may be saved over it.
    Checkpoint(PathBuf),
    /// The folder in which the program keeps networks from session to session.
    Kept(PathBuf),
    /// A file that is being written at this moment.
    Recorded(PathBuf),
}

impl FileInUse {
    /// Returns the reason why the file at `path` must not be overwritten, if it is this file.
    fn reason(&self, path: &Path) -> Option<&'static str> {
        let (is_this, reason) = match self {
            Self::Recording(used) => (is_same(used, path), "it is a recording that is open"),
            Self::Checkpoint(used) => (
                is_same(used, path),
                "the current training was resumed from this checkpoint",
            ),
            Self::Kept(folder) => (
                path.parent().is_some_and(|parent| is_same_folder(parent, folder)) && path.exists(),
                "it is kept by this program from session to session",
            ),
            Self::Recorded(used) => (is_same(used, path), "frames are being recorded to it"),
        };
        is_this.then_some(reason)
    }
}

/// Checks that the file at `path` is not one of `used` under any name. Asks the file system, which may be slow.
///
/// # Errors
/// If it is one of them; the message says what to do.
pub fn refuse_in_use(path: &Path, used: &[FileInUse]) -> Result<(), String> {
    match used.iter().find_map(|used| used.reason(path)) {
        Some(reason) => Err(format!("'{}' is in use: {reason}; give another name", path.display())),
        None => Ok(()),
    }
}

fn is_same_folder(one: &Path, other: &Path) -> bool {
    let real = |path: &Path| path.canonicalize().ok();
    real(one).is_some() && real(one) == real(other)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_file_in_use_is_refused_under_any_name_and_others_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("kept")).unwrap();
        for name in ["a.csv", "b.csv", "kept/run-1.json"] {
            fs::write(at(name), "").unwrap();
        }
        let used = [FileInUse::Recording(at("a.csv")), FileInUse::Kept(at("kept"))];
        for (name, is_refused) in [
            ("a.csv", true),
            ("kept/../a.csv", true),
            ("b.csv", false),
            ("none.csv", false),
            ("none/a.csv", false),
            ("kept/run-1.json", true),
            ("kept/new.json", false),
        ] {
            assert_eq!(refuse_in_use(&at(name), &used).is_err(), is_refused, "{name}");
        }
    }
}
