use std::{fs, path::Path};

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

#[cfg(test)]
mod tests {
    use super::*;

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
