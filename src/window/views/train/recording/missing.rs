//! Recordings that are not where they were when a run was saved.

use std::path::{Path, PathBuf};

use super::draft::file_name;
use decoupler_files::{
    export::CheckpointFile,
    import::{FileChecksum, Plan, Recorded, file_crc32},
};

/// An import to be opened again: its plan, and checksums of its files where they are known.
#[derive(Clone, Debug)]
pub(super) struct Reopened {
    /// Plan with absolute paths, and checksums; an empty checksum is not known.
    pub(super) recorded: Recorded,
    /// Training to be resumed once all files are found.
    pub(super) checkpoint: Option<Box<CheckpointFile>>,
    /// Names of files whose contents differ from those at the time of the run.
    pub(super) changed: Vec<String>,
}

impl From<Recorded> for Reopened {
    fn from(recorded: Recorded) -> Self {
        Self {
            recorded,
            checkpoint: None,
            changed: Vec::new(),
        }
    }
}

impl From<Plan> for Reopened {
    /// Returns the import of a plan of whose files no checksums are known.
    fn from(plan: Plan) -> Self {
        let unknown = |path: &PathBuf| FileChecksum {
            path: path.clone(),
            crc32: String::new(),
        };
        Self::from(Recorded {
            files: plan.files().map(unknown).collect(),
            samples_crc32: String::new(),
            plan,
        })
    }
}

impl Reopened {
    /// Paths of the files that are not where they were.
    pub(super) fn missing(&self) -> Vec<&Path> {
        self.recorded.missing()
    }

    /// Notes the names of files whose contents have changed.
    ///
    /// # Errors
    /// If a file cannot be read, or a training is to be resumed with other contents.
    pub(super) fn compare(&mut self) -> Result<(), String> {
        let mut changed = Vec::new();
        for file in &self.recorded.files {
            if file.path.is_file() && !has_checksum(&file.path, &file.crc32)? {
                changed.push(file_name(&file.path));
            }
        }
        if let (Some(_), Some(name)) = (&self.checkpoint, changed.first()) {
            return Err(format!(
                "{name} has other contents than when the training was saved, so the training cannot be resumed with it. \
                 Use the file of that time."
            ));
        }
        self.changed = changed;
        Ok(())
    }

    /// Replaces a missing file by `found`, and other missing files by those of the same name and contents next to it.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub(super) fn relocate(&mut self, missing: &Path, found: &Path) -> Result<(), String> {
        self.recorded = self.recorded.relocated(missing, found);
        let folder = found.parent().unwrap_or(Path::new(""));
        for file in self.recorded.files.clone() {
            let beside = file.path.file_name().map(|name| folder.join(name));
            if let Some(beside) = beside.filter(|beside| !file.path.exists() && beside.is_file())
                && has_checksum(&beside, &file.crc32)?
            {
                self.recorded = self.recorded.relocated(&file.path, &beside);
            }
        }
        Ok(())
    }
}

/// Returns true if the file has this checksum, or the checksum is not known.
fn has_checksum(path: &Path, crc32: &str) -> Result<bool, String> {
    if crc32.is_empty() {
        return Ok(true);
    }
    let found = file_crc32(path).map_err(|error| format!("cannot read '{}': {error}", path.display()))?;
    Ok(found == crc32)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_file_is_found_with_its_neighbours_and_other_contents_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for (name, text) in [("sensor.csv", "1\n"), ("states.csv", "2\n"), ("other.csv", "3\n")] {
            fs::write(at(name), text).unwrap();
        }
        let gone = |name: &str| PathBuf::from("/gone").join(name);
        let mut plan = Plan::default();
        plan.import.data = gone("sensor.csv");
        plan.import.join = vec![decoupler_files::import::Joined {
            file: gone("states.csv"),
            ..Default::default()
        }];
        let mut reopened = Reopened::from(plan);
        for file in &mut reopened.recorded.files {
            file.crc32 = file_crc32(&at(&file_name(&file.path))).unwrap();
        }
        assert_eq!(reopened.missing(), [gone("sensor.csv"), gone("states.csv")]);

        let mut found = reopened.clone();
        found.relocate(&gone("sensor.csv"), &at("sensor.csv")).unwrap();
        assert!(found.missing().is_empty(), "the other file lies next to it");
        assert_eq!(found.recorded.plan.import.join[0].file, at("states.csv"));
        found.compare().unwrap();
        assert!(found.changed.is_empty());

        reopened.relocate(&gone("sensor.csv"), &at("other.csv")).unwrap();
        reopened.compare().unwrap();
        assert_eq!(reopened.changed, ["other.csv"]);
    }
}
