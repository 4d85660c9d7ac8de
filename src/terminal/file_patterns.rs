//! Files given as arguments: several, a pattern such as `runs/*.csv`, or a folder.

use std::path::{Path, PathBuf};

use decoupler_files::import::{FileSet, Format};
use glob::{Pattern, PatternError};

use super::failure::Failure;

/// Returns the files given by `argument`: a folder means the tables in it, and a pattern the files that match, sorted by name.
///
/// # Errors
/// If a folder has no table, or a pattern matches none or is invalid.
pub(super) fn expanded(argument: &str, given: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for path in given {
        let text = path.to_string_lossy();
        let refuse = |reason: &str| Failure::Arguments(format!("{argument}: '{text}' {reason}"));
        let is_pattern = text.contains(['*', '?', '[']);
        if path.is_dir() {
            let mut found = Format::tables_in(path).map_err(|error| refuse(&format!("cannot be read: {error}")))?;
            if found.is_empty() {
                let endings = Format::EXTENSIONS.join(", .");
                return Err(refuse(&format!("is a folder without tables (.{endings})")));
            }
            files.append(&mut found);
        } else if is_pattern && !path.exists() {
            let mut found = matching(&text).map_err(|error| refuse(&format!("is not a valid pattern: {error}")))?;
            if found.is_empty() {
                return Err(refuse("matches no file"));
            }
            files.append(&mut found);
        } else {
            files.push(path.clone());
        }
    }
    Ok(files)
}

/// Returns the files that match a pattern, sorted by name. `**` does not enter linked folders, which may lead back to it.
fn matching(pattern: &str) -> Result<Vec<PathBuf>, PatternError> {
    let paths = |pattern: &str| Ok(glob::glob(pattern)?.filter_map(Result::ok));
    let parts = Vec::from_iter(pattern.split(std::path::is_separator));
    let Some(place) = parts.iter().position(|part| *part == "**") else {
        return Ok(paths(pattern)?.filter(|path| path.is_file()).collect());
    };
    let mut folders = match parts[..place].join("/") {
        before if place == 0 => vec![PathBuf::from(before)],
        before if before.is_empty() => vec![PathBuf::from("/")],
        before => paths(&before)?.filter(|path| path.is_dir()).collect(),
    };
    let (rest, mut found) = (parts[place + 1..].join("/"), Vec::new());
    while let Some(folder) = folders.pop() {
        let readable = if folder == Path::new("") {
            Path::new(".")
        } else {
            &folder
        };
        for entry in readable.read_dir().into_iter().flatten().flatten() {
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                folders.push(folder.join(entry.file_name()));
            }
        }
        let escaped = Pattern::escape(&folder.to_string_lossy());
        found.append(&mut matching(&Path::new(&escaped).join(&rest).to_string_lossy())?);
    }
    found.sort();
    found.dedup();
    Ok(found)
}

/// Divides the joined files among the data files, in order, and returns the first of these with the others appended; `kind` is "test-" for those of the test.
///
/// # Errors
/// If the data files do not get the same number of joined files.
pub(super) fn file_sets(kind: &str, data: Vec<PathBuf>, join: Vec<PathBuf>) -> Result<Option<FileSet>, Failure> {
    if !join.len().is_multiple_of(data.len().max(1)) {
        return Err(Failure::Arguments(format!(
            "--{kind}join: {} joined files cannot be divided among the {} files of --{kind}data; give as many for each, in their order",
            join.len(),
            data.len()
        )));
    }
    let each = join.len() / data.len().max(1);
    let mut join = join.into_iter();
    let set = |data| FileSet {
        data,
        join: join.by_ref().take(each).collect(),
        append: Vec::new(),
    };
    let mut sets = Vec::from_iter(data.into_iter().map(set)).into_iter();
    Ok(sets.next().map(|first| FileSet {
        append: sets.collect(),
        ..first
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_and_patterns_are_the_tables_that_they_hold() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["b.csv", "a.csv", "notes.md", "c.NPY"] {
            std::fs::write(at(name), "1").unwrap();
        }
        let found = expanded("--data", &[folder.path().to_owned()]).unwrap();
        assert_eq!(found, [at("a.csv"), at("b.csv"), at("c.NPY")]);
        let found = expanded("--data", &[at("*.csv"), at("missing.csv")]).unwrap();
        assert_eq!(found, [at("a.csv"), at("b.csv"), at("missing.csv")]);
        let error = expanded("--data", &[at("*.mat")]).unwrap_err().to_string();
        assert!(error.contains("matches no file"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn two_stars_find_each_file_once_and_follow_no_links() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["a", "a/b", "a/[c]"] {
            std::fs::create_dir(at(name)).unwrap();
        }
        for name in ["1.csv", "a/2.csv", "a/b/3.csv", "a/[c]/4.csv", "a/b/5.txt"] {
            std::fs::write(at(name), "1").unwrap();
        }
        std::os::unix::fs::symlink(folder.path(), at("a/b/back")).unwrap();
        let of = |names: &[&str]| Vec::from_iter(names.iter().map(|name| at(name)));
        for (pattern, expected) in [
            ("**/*.csv", of(&["1.csv", "a/2.csv", "a/[c]/4.csv", "a/b/3.csv"])),
            ("*/**/*.csv", of(&["a/2.csv", "a/[c]/4.csv", "a/b/3.csv"])),
            ("**/b/**/*.*", of(&["a/b/3.csv", "a/b/5.txt"])),
            // A link that is named is followed.
            ("a/*/back/*.csv", of(&["a/b/back/1.csv"])),
        ] {
            assert_eq!(expanded("--data", &[at(pattern)]).unwrap(), expected, "{pattern}");
        }
        assert!(expanded("--data", &[at("**")]).is_err());
    }

    #[test]
    fn joined_files_go_with_the_data_files_in_order() {
        let paths = |names: &[&str]| Vec::from_iter(names.iter().map(PathBuf::from));
        let sets = file_sets("", paths(&["a", "b"]), paths(&["a1", "a2", "b1", "b2"])).unwrap();
        let sets = sets.unwrap();
        assert_eq!(sets.join, paths(&["a1", "a2"]));
        assert_eq!(
            (&sets.append[0].data, &sets.append[0].join),
            (&"b".into(), &paths(&["b1", "b2"]))
        );
        let error = file_sets("test-", paths(&["a", "b"]), paths(&["a1"]))
            .unwrap_err()
            .to_string();
        assert!(error.contains("--test-join"), "{error}");
    }
}
