use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{
    Cure, ImportError, Joined, Recipe, Recording, Watch,
    recipe::{restored, stored},
};
use decoupler_core::dataset::{Dataset, Division, Seed, Split, SplitBy};

/// Files, the meanings of their columns, and the division of their samples: all that a run on measured samples needs to be
/// repeated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Recipe by which samples are made of the files.
    pub import: Recipe,
    /// Files of the test samples; without them a part of the samples tests.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test: Option<TestFiles>,
    /// Division of the samples. Only the share for validation counts if the test samples have files of their own.
    #[serde(default)]
    pub division: Division,
}

/// Files of the test samples, in the place of those of the recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TestFiles {
    /// In the place of the first file.
    pub data: PathBuf,
    /// In the place of the joined files, in their order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub join: Vec<PathBuf>,
}

/// Sets of a run on measured samples.
#[derive(Clone, Debug)]
pub struct PlannedSets {
    /// All samples but those of the test files.
    pub recording: Recording,
    /// Samples of the test files, if there are any.
    pub test_recording: Option<Recording>,
    /// Training and validation samples.
    pub split: Split,
    /// Test samples.
    pub test: Dataset,
}

impl Plan {
    /// Imports the files, relative to `folder`, and divides the samples; `seed` is that of the run.
    ///
    /// # Errors
    /// If the files cannot be imported or the samples not be divided.
    pub fn sets(&self, folder: &Path, seed: Seed, watch: Watch<'_>) -> Result<PlannedSets, ImportError> {
        let (recording, test_recording) = self.recordings(folder, watch)?;
        let (split, test) = self.divide(&recording, test_recording.as_ref(), seed)?;
        Ok(PlannedSets {
            recording,
            test_recording,
            split,
            test,
        })
    }

    /// Imports the files, relative to `folder`: all samples but those of the test files, and those of the test files, if there
    /// are any.
    ///
    /// # Errors
    /// If the files cannot be imported.
    pub fn recordings(&self, folder: &Path, watch: Watch<'_>) -> Result<(Recording, Option<Recording>), ImportError> {
        let recording = self.recording(folder, watch)?;
        let test_recording = match &self.test {
            None => None,
            Some(files) => {
                self.check_test_files(folder, files)?;
                Some(self.import.of_test(files)?.import(folder, watch)?)
            }
        };
        Ok((recording, test_recording))
    }

    /// Refuses rows for the test that are trained on. A file joined to both may be the same: its times tell its rows apart.
    fn check_test_files(&self, folder: &Path, tests: &TestFiles) -> Result<(), ImportError> {
        let real = |path: &PathBuf| folder.join(path).canonicalize().ok();
        match (real(&self.import.data), real(&tests.data)) {
            (Some(trained), Some(tested)) if trained == tested => Err(ImportError::TrainedOn(tests.data.clone())),
            _ => Ok(()),
        }
    }

    /// Divides samples that were imported before; `seed` is that of the run.
    ///
    /// # Errors
    /// If the samples cannot be divided.
    pub fn divide(
        &self,
        recording: &Recording,
        test_recording: Option<&Recording>,
        seed: Seed,
    ) -> Result<(Split, Dataset), ImportError> {
        let test = test_recording.map(|recording| &recording.set);
        Ok(self.division.sets(&recording.set, test, seed)?)
    }

    /// Imports the samples without those of the test files.
    ///
    /// # Errors
    /// If the files cannot be imported, or a division by group has no groups.
    pub fn recording(&self, folder: &Path, watch: Watch<'_>) -> Result<Recording, ImportError> {
        if self.division.by == SplitBy::Group && self.import.group.is_none() {
            return Err(ImportError::NoColumns("the group, by which the samples are divided"));
        }
        self.import.import(folder, watch)
    }

    /// This plan, whose paths are relative to the working folder, with paths for a file in `folder`: relative to that
    /// folder; the name alone for a recording in the user's home if the folder lies elsewhere.
    #[must_use]
    pub fn relative_to(&self, folder: &Path) -> Self {
        self.with_paths(|path| stored(path, folder))
    }

    /// This plan, read from a file in `folder`, with paths relative to the working folder. A recording that is not where it
    /// was may lie next to the file.
    #[must_use]
    pub fn restored(&self, folder: &Path) -> Self {
        self.with_paths(|path| restored(path, folder))
    }

    /// Returns `true` if the test samples are random ones of the recording: errors on them are optimistic where neighbouring
    /// rows are similar.
    pub fn is_optimistic(&self) -> bool {
        self.division.by == SplitBy::Random && self.test.is_none()
    }

    /// All files that it reads.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        let import = &self.import;
        let joined = import.join.iter().map(|joined| &joined.file);
        let tests = self
            .test
            .iter()
            .flat_map(|test| std::iter::once(&test.data).chain(&test.join));
        std::iter::once(&import.data)
            .chain(joined)
            .chain(&import.positions)
            .chain(tests)
    }

    /// This plan with absolute paths.
    #[must_use]
    pub fn absolute(&self) -> Self {
        self.with_paths(|path| std::path::absolute(path).unwrap_or_else(|_| path.clone()))
    }

    /// This plan with the paths in `folder`.
    #[must_use]
    pub fn within(&self, folder: &Path) -> Self {
        self.with_paths(|path| folder.join(path))
    }

    /// This plan with the names of its files in the place of their paths.
    #[must_use]
    pub fn named(&self) -> Self {
        self.with_paths(|path| path.file_name().map_or_else(|| path.clone(), PathBuf::from))
    }

    pub(super) fn with_paths(&self, of: impl Fn(&PathBuf) -> PathBuf) -> Self {
        let mut plan = self.clone();
        plan.import.data = of(&plan.import.data);
        plan.import
            .join
            .iter_mut()
            .for_each(|joined| joined.file = of(&joined.file));
        plan.import.positions.iter_mut().for_each(|file| *file = of(file));
        if let Some(test) = &mut plan.test {
            test.data = of(&test.data);
            test.join.iter_mut().for_each(|file| *file = of(file));
        }
        plan
    }
}

impl Recipe {
    /// This recipe with other files; the names of the columns stay.
    fn of_test(&self, files: &TestFiles) -> Result<Self, ImportError> {
        if files.join.len() != self.join.len() {
            return Err(ImportError::Join {
                path: files.data.clone(),
                reason: format!(
                    "the test data need {} joined files and have {}",
                    self.join.len(),
                    files.join.len()
                ),
                cure: Cure::GiveTestFiles,
            });
        }
        let joined = self.join.iter().zip(&files.join).zip(self.stems());
        let join = joined.map(|((joined, file), stem)| Joined {
            file: file.clone(),
            stem: Some(stem),
            ..joined.clone()
        });
        Ok(Self {
            data: files.data.clone(),
            join: join.collect(),
            ..self.clone()
        })
    }
}
