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
        let (used, reason) = match self {
            Self::Recording(used) => (used, "it is a recording that is open"),
            Self::Checkpoint(used) => (used, "the current training was resumed from this checkpoint"),
            Self::Recorded(used) => (used, "frames are being recorded to it"),
            Self::Kept(folder) => {
                let is_inside = || Some(path.canonicalize().ok()?.parent()? == folder.canonicalize().ok()?);
                return is_inside()
                    .unwrap_or(false)
                    .then_some("it is kept by this program from session to session");
            }
        };
        is_same(used, path).then_some(reason)
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
