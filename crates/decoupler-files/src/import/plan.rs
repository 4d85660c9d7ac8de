use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{
    FileSet, ImportError, Recipe, Recording, Watch,
    recipe::{absolute, is_irregular},
};
use decoupler_core::dataset::{Dataset, Division, Seed, Split, SplitBy};

/// Files, the meanings of their columns, and the split of their samples: everything needed to repeat a run on measured
/// samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Recipe for importing the samples.
    pub import: Recipe,
    /// Test files; if absent, a part of the samples is held out for testing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test: Option<FileSet>,
    /// Split of the samples. With separate test files, only the validation fraction is used.
    #[serde(default)]
    pub division: Division,
}

impl Plan {
    /// Imports the files, whose paths are relative to `folder`: returns all samples except those of the test files, and the
    /// samples of the test files, if there are any.
    ///
    /// # Errors
    /// If the files cannot be imported.
    pub fn recordings(&self, folder: &Path, watch: Watch<'_>) -> Result<(Recording, Option<Recording>), ImportError> {
        let recording = self.recording(folder, watch)?;
        let Some(tests) = self.test.as_ref().map(FileSet::flat) else {
            return Ok((recording, None));
        };
        self.check_test_files(folder, &tests)?;
        // Lags in seconds have as many samples as in training.
        let memory = recording.problem.memory.as_ref();
        let test = self.import.import_sets(&tests, memory, folder, watch)?;
        Ok((recording, Some(test)))
    }

    /// Refuses test rows that are also used for training. The same file may be joined to both, because its rows are matched by
    /// time.
    fn check_test_files(&self, folder: &Path, tests: &[FileSet]) -> Result<(), ImportError> {
        let real = |path: &PathBuf| folder.join(path).canonicalize().ok();
        let trained = HashSet::<PathBuf>::from_iter(self.import.data_files().filter_map(real));
        let is_trained = |path: &&PathBuf| real(path).is_some_and(|path| trained.contains(&path));
        match tests.iter().map(|set| &set.data).find(is_trained) {
            Some(path) => Err(ImportError::Samples(format!(
                "'{}' is trained on, so it cannot be a test file; give another one",
                path.display()
            ))),
            None => Ok(()),
        }
    }

    /// Splits imported samples; `seed` is the seed of the run.
    ///
    /// # Errors
    /// If the samples cannot be split.
    pub fn divide(
        &self,
        recording: &Recording,
        test_recording: Option<&Recording>,
        seed: Seed,
    ) -> Result<(Split, Dataset), ImportError> {
        let test = test_recording.map(|recording| &recording.set);
        Ok(self.division.sets(&recording.set, test, seed)?)
    }

    /// Imports the samples, without the test files.
    ///
    /// # Errors
    /// If the files cannot be imported, or there are no groups for a split by group.
    pub fn recording(&self, folder: &Path, watch: Watch<'_>) -> Result<Recording, ImportError> {
        if self.division.by == SplitBy::Group && !self.import.has_groups() {
            let reason = "no column is the group, by which the samples are split; name at least one";
            return Err(ImportError::Columns(reason.to_owned()));
        }
        self.import.import(folder, watch)
    }

    /// Returns the rule that determines the order of the test samples: by time in files of their own, whose rows are all
    /// test samples.
    pub fn test_order(&self) -> SplitBy {
        if self.test.is_some() {
            SplitBy::Time
        } else {
            self.division.by
        }
    }

    /// Returns all files of the plan.
    pub fn files(&self) -> Vec<PathBuf> {
        self.clone().paths_mut().into_iter().map(std::mem::take).collect()
    }

    fn paths_mut(&mut self) -> Vec<&mut PathBuf> {
        let import = &mut self.import;
        let mut paths = vec![&mut import.data];
        paths.extend(import.join.iter_mut().map(|joined| &mut joined.file));
        paths.extend(import.append.iter_mut().flat_map(FileSet::files_mut));
        paths.extend(&mut import.positions);
        paths.extend(self.test.iter_mut().flat_map(FileSet::files_mut));
        paths
    }

    /// Returns the first file that is a pipe or device, which only a user may name: one in a stored plan could block for ever.
    pub fn irregular(&self) -> Option<PathBuf> {
        self.files().into_iter().find(|path| is_irregular(path))
    }

    /// Returns this plan with absolute paths.
    #[must_use]
    pub fn absolute(&self) -> Self {
        self.with_paths(absolute)
    }

    /// Returns this plan with its paths joined to `folder`.
    #[must_use]
    pub fn within(&self, folder: &Path) -> Self {
        self.with_paths(|path| folder.join(path))
    }

    /// Returns this plan with file names instead of paths.
    #[must_use]
    pub fn named(&self) -> Self {
        self.with_paths(|path| path.file_name().unwrap_or(path.as_os_str()).into())
    }

    /// Returns this plan with other paths.
    pub(crate) fn with_paths(&self, of: impl Fn(&Path) -> PathBuf) -> Self {
        let mut plan = self.clone();
        plan.paths_mut().into_iter().for_each(|path| *path = of(path));
        plan
    }
}
