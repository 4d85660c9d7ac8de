use std::{
    fs::File,
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{
    ImportError, Plan, PlannedSets,
    recipe::{restored, stored},
};
use decoupler_core::dataset::Dataset;

/// Origin of recorded samples: the plan that reads them, and checksums by which its files and samples are recognised.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recorded {
    /// Files, meanings of their columns, and division of their samples.
    pub plan: Plan,
    /// Checksums of the files.
    pub files: Vec<FileChecksum>,
    /// CRC-32 of the bits of all readings and targets, as hexadecimal digits.
    pub samples_crc32: String,
}

/// Checksum of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileChecksum {
    /// Path of the file, as in the plan.
    pub path: PathBuf,
    /// CRC-32 of its bytes, as hexadecimal digits.
    pub crc32: String,
}

impl Recorded {
    /// Describes the samples that `plan`, whose paths do not depend on the working folder, has given.
    pub(super) fn of(plan: Plan, sets: &PlannedSets) -> Result<Self, ImportError> {
        let checksum = |path: &PathBuf| {
            // A pipe has been read once and is empty now.
            let is_file = path.is_file();
            let crc32 = if is_file { file_crc32(path) } else { Ok(String::new()) };
            let crc32 = crc32.map_err(|source| ImportError::Read {
                path: path.clone(),
                source,
            })?;
            Ok(FileChecksum {
                path: path.clone(),
                crc32,
            })
        };
        let files = plan.files().map(checksum).collect::<Result<_, ImportError>>()?;
        Ok(Self {
            files,
            samples_crc32: samples_crc32([&sets.recording.set, &sets.test]),
            plan,
        })
    }

    /// Returns it with paths for a file in `folder`: relative to the folder; the name alone for a file in the user's home
    /// that the folder is not in, so that no file names the home of its author.
    #[must_use]
    pub fn relative_to(&self, folder: &Path) -> Self {
        self.with_paths(|path| stored(path, folder))
    }

    /// Returns it with the paths of a file in `folder`: a recording that is missing where it was may lie next to the file.
    #[must_use]
    pub fn within(&self, folder: &Path) -> Self {
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        self.with_paths(|path| restored(path, &folder))
    }

    /// Returns it with another path of a recording.
    #[must_use]
    pub fn relocated(&self, from: &Path, to: &Path) -> Self {
        self.with_paths(|path| if path == from { to.to_owned() } else { path.to_owned() })
    }

    /// Paths of recordings that are not where they were.
    pub fn missing(&self) -> Vec<&Path> {
        let files = self.files.iter().map(|file| file.path.as_path());
        files.filter(|path| !path.exists()).collect()
    }

    fn with_paths(&self, of: impl Fn(&Path) -> PathBuf) -> Self {
        let file = |file: &FileChecksum| FileChecksum {
            path: of(&file.path),
            crc32: file.crc32.clone(),
        };
        Self {
            files: self.files.iter().map(file).collect(),
            plan: self.plan.with_paths(|path| of(path)),
            samples_crc32: self.samples_crc32.clone(),
        }
    }
}

/// Returns the CRC-32 of the bytes of a file, as hexadecimal digits.
///
/// # Errors
/// If the file cannot be read.
pub fn file_crc32(path: &Path) -> io::Result<String> {
    let mut hasher = crc32fast::Hasher::new();
    let mut file = File::open(path)?;
    let mut block = vec![0; 1 << 16];
    loop {
        match file.read(&mut block)? {
            0 => return Ok(format!("{:08x}", hasher.finalize())),
            read => hasher.update(&block[..read]),
        }
    }
}

fn samples_crc32(sets: [&Dataset; 2]) -> String {
    let mut hasher = crc32fast::Hasher::new();
    for values in sets.iter().flat_map(|set| [set.readings(), set.targets()]) {
        values.iter().for_each(|value| hasher.update(&value.to_le_bytes()));
    }
    format!("{:08x}", hasher.finalize())
}
