//! Recipes for importing recordings, and their paths: a stored file names recordings relative to its own folder.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::Read as _,
    path::{Path, PathBuf},
};

use decoupler_core::{
    dataset::{Dataset, Memory},
    decoupling::Combined,
    evaluation::{Intervals, auto::AutoRecord},
};
use path_clean::clean;
use pathdiff::diff_paths;
use serde::{Deserialize, Serialize};

use super::{
    Condition, Derived, DialectChoice, ImportError, Missing, Plan, TableError, Watch, expression::texts,
    progress::Watched, table::name_and_unit,
};

/// Recipe for importing samples: the files to read and to join, and the meaning of each column.
///
/// A column is named as in the header, or c1, c2, … if there is none; `c2..c16` is a range; the columns of a joined
/// file are prefixed with its stem, as in `states.c2`. Columns that are not named are not used.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The file, relative to the folder of the recipe.
    pub data: PathBuf,
    /// Files whose rows are joined to those of `data`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub join: Vec<Joined>,
    /// Further files of the same experiment, whose rows follow those of `data`. They have the same columns; without a group
    /// column, each file is a group.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub append: Vec<FileSet>,
    /// Layout of text files, where it should not be detected.
    #[serde(default)]
    pub dialect: DialectChoice,
    /// Readings of the sensor.
    pub inputs: Vec<String>,
    /// Columns predicted from the readings.
    pub targets: Vec<String>,
    /// Time column of `data`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// Group column: rows with equal values belong together, such as one press or one session.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// Column with the number of the row-wire, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row_wire: Option<String>,
    /// Inputs from the past: lags and averages of the readings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<Memory>,
    /// Conditions that every used row must meet.
    #[serde(default, rename = "where", skip_serializing_if = "Vec::is_empty", with = "texts")]
    pub conditions: Vec<Condition>,
    /// Columns computed from others of the same file.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "texts")]
    pub derive: Vec<Derived>,
    /// Markers of missing values, in addition to empty cells.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "texts")]
    pub missing: Vec<Missing>,
    /// True if files that cannot be read are left out where there are several.
    #[serde(default, skip_serializing_if = "is_off")]
    pub skip_damaged: bool,
    /// True if files that are joined row by row may differ in length: rows beyond the shortest are left out.
    #[serde(default, skip_serializing_if = "is_off")]
    pub truncate: bool,
    /// Units of columns that the header does not give.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub units: BTreeMap<String, String>,
    /// File with the positions of targets on the skin, relative to the folder of the recipe: a table with the columns
    /// target, x and y (mm).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub positions: Option<PathBuf>,
}

/// Recipes leave out what is off.
fn is_off(value: &bool) -> bool {
    !value
}

/// File joined to the first, row by row or by time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joined {
    /// The file, relative to the folder of the recipe.
    pub file: PathBuf,
    /// Prefix of the names of its columns; the stem of the file if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stem: Option<String>,
    /// Name of its time column, without the stem; that of `data` if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// Maximum time difference between joined rows; half the median interval of this file if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
}

impl Recipe {
    /// Returns the files whose rows become samples, without those joined to them.
    pub fn data_files(&self) -> impl Iterator<Item = &PathBuf> {
        std::iter::once(&self.data).chain(self.append.iter().map(|set| &set.data))
    }

    /// Returns the files whose rows become samples, with those joined to them.
    pub(crate) fn files(&self) -> FileSet {
        FileSet {
            data: self.data.clone(),
            join: self.join.iter().map(|joined| joined.file.clone()).collect(),
            append: self.append.clone(),
        }
    }

    /// Returns `true` if samples belong to groups: the values of the group column, or else the files.
    pub fn has_groups(&self) -> bool {
        self.group.is_some() || !self.append.is_empty()
    }

    /// Returns the unit given for a column, which either may name with its unit.
    pub(super) fn unit_of(&self, column: &str) -> Option<&str> {
        let bare = |name| name_and_unit(name).0;
        let found = self.units.iter().find(|(name, _)| bare(name) == bare(column));
        found.map(|(_, unit)| unit.as_str())
    }
}

/// Files that replace or follow the files of a recipe, with the same columns.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileSet {
    /// Takes the place of the first file.
    pub data: PathBuf,
    /// Take the places of the joined files, in the same order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub join: Vec<PathBuf>,
    /// Further files, whose rows follow.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub append: Vec<FileSet>,
}

impl FileSet {
    /// Returns the first file with those joined to it, then those whose rows follow.
    pub(crate) fn flat(&self) -> Vec<Self> {
        let first = Self {
            append: Vec::new(),
            ..self.clone()
        };
        let following = self.append.iter().flat_map(Self::flat);
        std::iter::once(first).chain(following).collect()
    }

    /// Returns the first file and those joined to it.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        std::iter::once(&self.data).chain(&self.join)
    }

    pub(super) fn files_mut(&mut self) -> Vec<&mut PathBuf> {
        let first = std::iter::once(&mut self.data).chain(&mut self.join);
        first.chain(self.append.iter_mut().flat_map(Self::files_mut)).collect()
    }
}

pub(super) fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// Returns the path of a recording as stored in a file in `folder`: relative to the folder. A recording in the user's home
/// is stored by name only if the folder is not in the home, so that no file reveals the home folder of its author.
pub(crate) fn stored(path: &Path, folder: &Path) -> PathBuf {
    let [path, folder] = [path, folder].map(|path| clean(absolute(path)));
    relative(&path, &folder, std::env::home_dir().as_deref())
}

/// Returns the path of a recording that is `stored` in a file in `folder`. A recording that has been moved is also looked up
/// next to the file.
pub(crate) fn restored(stored: &Path, folder: &Path) -> PathBuf {
    let path = clean(folder.join(stored));
    let neighbour = path.file_name().map(|name| folder.join(name));
    neighbour.filter(|near| !path.exists() && near.exists()).unwrap_or(path)
}

/// Returns the path of a file relative to `folder`, both absolute; only the name if the relative path leaves `home`.
fn relative(path: &Path, folder: &Path, home: Option<&Path>) -> PathBuf {
    let leaves = home.is_some_and(|home| path.starts_with(home) && !folder.starts_with(home));
    let relative = diff_paths(path, folder).filter(|_| !leaves);
    relative.unwrap_or_else(|| path.file_name().unwrap_or(path.as_os_str()).into())
}

/// Origin of recorded samples: the plan that reads them, and checksums that identify its files and samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recorded {
    /// Files, meanings of their columns, and split of their samples.
    pub plan: Plan,
    /// Checksums of the files.
    pub files: Vec<FileChecksum>,
    /// CRC-32 of the bits of all readings and targets, as hexadecimal digits.
    pub samples_crc32: String,
    /// What was tried to choose the settings and the memory, if they were chosen automatically.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<AutoRecord>,
    /// What was found best instead of the network alone, if settings were chosen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub combined: Option<Combined>,
    /// Intervals of the answers with the chosen settings, from the held-out answers of the choice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chosen_intervals: Option<Intervals>,
}

/// Checksum of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileChecksum {
    /// Path of the file, as in the plan.
    pub path: PathBuf,
    /// CRC-32 of its bytes, as hexadecimal digits.
    pub crc32: String,
}

impl Recorded {
    /// Describes the `samples` read by `plan`, whose paths must not depend on the working folder.
    pub(super) fn of(plan: Plan, samples: [&Dataset; 2], watch: Watch<'_>) -> Result<Self, ImportError> {
        let checksum = |path: PathBuf| {
            // A pipe can be read only once, and is empty now.
            let crc32 = path.is_file().then(|| file_crc32(&path, watch)).transpose()?;
            let crc32 = crc32.unwrap_or_default();
            Ok(FileChecksum { path, crc32 })
        };
        let files = plan.files().into_iter().map(checksum);
        Ok(Self {
            files: files.collect::<Result<_, ImportError>>()?,
            samples_crc32: samples_crc32(samples),
            search: None,
            combined: None,
            chosen_intervals: None,
            plan,
        })
    }

    /// Returns it with its paths resolved for a file in `folder`. A recording that has been moved is also looked up next to the
    /// file.
    #[must_use]
    pub fn within(&self, folder: &Path) -> Self {
        let folder = absolute(folder);
        self.with_paths(|path| restored(path, &folder))
    }

    /// Returns it with one path replaced.
    #[must_use]
    pub fn relocated(&self, from: &Path, to: &Path) -> Self {
        self.with_paths(|path| if path == from { to.to_owned() } else { path.to_owned() })
    }

    /// Forgets what was chosen for a network with other settings.
    pub fn forget_choice(&mut self) {
        (self.combined, self.chosen_intervals) = (None, None);
    }

    /// Returns the paths of recordings that no longer exist.
    pub fn missing(&self) -> Vec<&Path> {
        let files = self.files.iter().map(|file| file.path.as_path());
        files.filter(|path| !path.exists()).collect()
    }

    /// Returns it with other paths.
    pub(crate) fn with_paths(&self, of: impl Fn(&Path) -> PathBuf) -> Self {
        let mut recorded = self.clone();
        recorded.files.iter_mut().for_each(|file| file.path = of(&file.path));
        recorded.plan = self.plan.with_paths(of);
        recorded
    }
}

/// Returns `true` for a pipe or device, of which a reader may wait for ever.
pub(super) fn is_irregular(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// Returns the CRC-32 of the bytes of a file, as hexadecimal digits.
///
/// # Errors
/// If the file cannot be read, or `watch` breaks.
pub fn file_crc32(path: &Path, watch: Watch<'_>) -> Result<String, ImportError> {
    let refused = |error| TableError::from(error).in_file(path);
    if is_irregular(path) {
        return Err(ImportError::Irregular(path.to_owned()));
    }
    let mut hasher = crc32fast::Hasher::new();
    let file = File::open(path).map_err(refused)?;
    let size = file.metadata().map_err(refused)?.len();
    let mut file = Watched::new(file, Some(size), watch);
    let mut block = vec![0; 1 << 16];
    loop {
        match file.read(&mut block).map_err(refused)? {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_paths_do_not_reveal_the_home_folder() {
        let home = Some(Path::new("/home/ada"));
        for (path, folder, expected) in [
            ("/home/ada/data/press.csv", "/home/ada/data", "press.csv"),
            (
                "/home/ada/data/press.csv",
                "/home/ada/nets/best",
                "../../data/press.csv",
            ),
            ("/home/ada/data/press.csv", "/media/stick", "press.csv"),
            ("/data/press.csv", "/home/ada", "../../data/press.csv"),
            ("/data/a/press.csv", "/data/b", "../a/press.csv"),
        ] {
            let found = relative(Path::new(path), Path::new(folder), home);
            assert_eq!(found, Path::new(expected), "{path} from {folder}");
        }
        assert_eq!(restored(Path::new("../c/./d"), Path::new("/a/b")), Path::new("/a/c/d"));
    }
}
