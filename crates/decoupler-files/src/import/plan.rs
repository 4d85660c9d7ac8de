use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{
    FileSet, ImportError, Recipe, Recording, Watch,
    recipe::{is_irregular, restored, stored},
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
    pub test: Option<TestFiles>,
    /// Split of the samples. With separate test files, only the validation fraction is used.
    #[serde(default)]
    pub division: Division,
}

/// Test files that replace the files of the recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TestFiles {
    /// Replaces the first file.
    pub data: PathBuf,
    /// Replace the joined files, in the same order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub join: Vec<PathBuf>,
    /// Further test files, whose rows follow.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub append: Vec<FileSet>,
}

impl TestFiles {
    /// Returns the test files of these sets; `None` without any.
    pub fn of(sets: Vec<FileSet>) -> Option<Self> {
        let mut sets = sets.into_iter();
        let FileSet { data, join } = sets.next()?;
        let append = sets.collect();
        Some(Self { data, join, append })
    }

    /// Returns the sets of test files.
    pub(super) fn sets(&self) -> Vec<FileSet> {
        let Self { data, join, append } = self.clone();
        std::iter::once(FileSet { data, join }).chain(append).collect()
    }
}

/// Datasets of a run on measured samples.
#[derive(Clone, Debug)]
pub struct PlannedSets {
    /// All samples except those of the test files.
    pub recording: Recording,
    /// Samples of the test files, if there are any.
    pub test_recording: Option<Recording>,
    /// Training and validation samples.
    pub split: Split,
    /// Test samples.
    pub test: Dataset,
}

impl Plan {
    /// Imports the files, whose paths are relative to `folder`, and splits the samples; `seed` is the seed of the run.
    ///
    /// # Errors
    /// If the files cannot be imported or the samples cannot be split.
    pub fn sets(&self, folder: &Path, seed: Seed, watch: Watch<'_>) -> Result<PlannedSets, ImportError> {
        let (recording, test_recording) = self.recordings(folder, watch)?;
        self.planned(recording, test_recording, seed)
    }

    /// Splits imported samples; `seed` is the seed of the run.
    pub(super) fn planned(
        &self,
        recording: Recording,
        test_recording: Option<Recording>,
        seed: Seed,
    ) -> Result<PlannedSets, ImportError> {
        let (split, test) = self.divide(&recording, test_recording.as_ref(), seed)?;
        Ok(PlannedSets {
            recording,
            test_recording,
            split,
            test,
        })
    }

    /// Imports the files, whose paths are relative to `folder`: returns all samples except those of the test files, and the
    /// samples of the test files, if there are any.
    ///
    /// # Errors
    /// If the files cannot be imported.
    pub fn recordings(&self, folder: &Path, watch: Watch<'_>) -> Result<(Recording, Option<Recording>), ImportError> {
        let recording = self.recording(folder, watch)?;
        let Some(tests) = self.test.as_ref().map(TestFiles::sets) else {
            return Ok((recording, None));
        };
        self.check_test_files(folder, &tests)?;
        // Lags in seconds have as many samples as in training.
        let test = self.import.import_sets(&tests, recording.memory(), folder, watch)?;
        Ok((recording, Some(test)))
    }

    /// Refuses test rows that are also used for training. The same file may be joined to both, because its rows are matched by
    /// time.
    fn check_test_files(&self, folder: &Path, tests: &[FileSet]) -> Result<(), ImportError> {
        let real = |path: &PathBuf| folder.join(path).canonicalize().ok();
        let trained = HashSet::<PathBuf>::from_iter(self.import.data_files().filter_map(real));
        let is_trained = |path: &&PathBuf| real(path).is_some_and(|path| trained.contains(&path));
        match tests.iter().map(|set| &set.data).find(is_trained) {
            Some(path) => Err(ImportError::Files(format!(
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

    /// Converts paths relative to the working folder to paths relative to `folder`, for a file stored there. A recording in the
    /// user's home is stored by name only if `folder` is not in the home.
    #[must_use]
    pub fn relative_to(&self, folder: &Path) -> Self {
        self.with_paths(|path| stored(path, folder))
    }

    /// Converts the paths of a plan read from a file in `folder` to paths relative to the working folder. A recording that has
    /// been moved is also looked up next to the file.
    #[must_use]
    pub fn restored(&self, folder: &Path) -> Self {
        self.with_paths(|path| restored(path, folder))
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

    /// Returns `true` if the test samples are a random part of the recording: errors on them are optimistic if neighbouring
    /// rows are similar.
    pub fn is_optimistic(&self) -> bool {
        self.division.by == SplitBy::Random && self.test.is_none()
    }

    /// Returns all files of the plan.
    pub fn files(&self) -> impl Iterator<Item = PathBuf> + use<> {
        let paths = self
            .clone()
            .paths_mut()
            .into_iter()
            .map(std::mem::take)
            .collect::<Vec<_>>();
        paths.into_iter()
    }

    fn paths_mut(&mut self) -> Vec<&mut PathBuf> {
        let import = &mut self.import;
        let mut paths = vec![&mut import.data];
        paths.extend(import.join.iter_mut().map(|joined| &mut joined.file));
        paths.extend(import.append.iter_mut().flat_map(FileSet::files_mut));
        paths.extend(&mut import.positions);
        if let Some(TestFiles { data, join, append }) = &mut self.test {
            paths.push(data);
            paths.extend(join);
            paths.extend(append.iter_mut().flat_map(FileSet::files_mut));
        }
        paths
    }

    /// Returns the first file that is a pipe or device, which only a user may name: one in a stored plan could block for ever.
    pub fn irregular(&self) -> Option<PathBuf> {
        self.files().find(|path| is_irregular(path))
    }

    /// Returns this plan with absolute paths.
    #[must_use]
    pub fn absolute(&self) -> Self {
        self.with_paths(|path| std::path::absolute(path).unwrap_or_else(|_| path.clone()))
    }

    /// Returns this plan with its paths joined to `folder`.
    #[must_use]
    pub fn within(&self, folder: &Path) -> Self {
        self.with_paths(|path| folder.join(path))
    }

    /// Returns this plan with file names instead of paths.
    #[must_use]
    pub fn named(&self) -> Self {
        self.with_paths(|path| path.file_name().map_or_else(|| path.clone(), PathBuf::from))
    }

    pub(super) fn with_paths(&self, of: impl Fn(&PathBuf) -> PathBuf) -> Self {
        let mut plan = self.clone();
        plan.paths_mut().into_iter().for_each(|path| *path = of(path));
        plan
    }
}
