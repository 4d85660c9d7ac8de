//! Files of the folder that a sweep fills: `TRIAL.json`, the result of a trial, named by a hash of its options. It never
//! changes, so any number of programs may write to one folder. `TRIAL.claim` is locked by the program that trains the trial.

mod options;
mod row;

use std::{
    collections::{BTreeMap, BTreeSet},
    ffi::OsStr,
    fmt, fs, io,
    path::{Path, PathBuf},
    str::FromStr,
};

use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;
use siphasher::sip128::SipHasher24;

use super::{AtomicFile, DocumentError, DocumentKind, WriteError, document::PROGRAM};
use crate::machine::system_cause;

pub(super) use self::row::flatten;
pub use self::{
    options::{decoders_in_order, recording_options, sweep_specification, train_options},
    row::{MergedSweep, SweepFolderError, SweepRow, SweepTableFormat},
};

/// Files of the trials in a folder.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct SweepFiles {
    pub(crate) trials: BTreeSet<PathBuf>,
    /// Trials that are claimed, without a result.
    pub(crate) unfinished: BTreeSet<TrialId>,
}

impl SweepFiles {
    /// Lists the files of `folder`, in the order of their names.
    pub fn list(folder: &Path) -> Result<Self, DocumentError> {
        let error = |source: io::Error| {
            let cause = io::Error::other(system_cause(&source));
            DocumentError::Read(folder.to_owned(), cause)
        };
        let mut files = Self::default();
        for entry in fs::read_dir(folder).map_err(error)? {
            let path = entry.map_err(error)?.path();
            let [name, extension] = [path.file_stem(), path.extension()].map(|part| part.and_then(OsStr::to_str));
            let Some(Ok(id)) = name.map(str::parse) else { continue };
            match extension {
                Some("json") => _ = files.trials.insert(path),
                // A program that was killed after its result leaves its claim next to it.
                Some("claim") if !path.with_extension("json").exists() => _ = files.unfinished.insert(id),
                _ => {}
            }
        }
        Ok(files)
    }
}

const KIND: DocumentKind = DocumentKind::Trial;

/// Options of `decoupler train` with their values, each option once and every default written out.
pub type TrialOptions = BTreeMap<String, Value>;

/// A finished trial of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trial {
    /// Program and version that trained it.
    #[serde(skip)]
    pub(crate) program: String,
    /// Options that determine the result.
    pub(crate) options: TrialOptions,
    /// The object that `decoupler train --json` prints for these options.
    pub(crate) report: Value,
    /// Time for the trial in seconds: drawing, training and measuring, on one thread.
    pub(crate) seconds: f64,
}

impl Trial {
    /// Creates the result of a trial run by this program.
    pub fn new(options: TrialOptions, report: Value, seconds: f64) -> Self {
        Self {
            program: PROGRAM.to_owned(),
            options,
            report,
            seconds,
        }
    }

    /// Returns the identifier of a trial with these options run by this program.
    pub fn id_of(options: &TrialOptions) -> TrialId {
        Self::id_by(PROGRAM, options)
    }

    /// Identifier of this trial.
    pub(crate) fn id(&self) -> TrialId {
        Self::id_by(&self.program, &self.options)
    }

    fn id_by(program: &str, options: &TrialOptions) -> TrialId {
        TrialId::of(&format!("{program}\n{}", options_text(options)))
    }

    /// File of the trial `id` in `folder`.
    pub fn path(folder: &Path, id: TrialId) -> PathBuf {
        folder.join(format!("{id}.json"))
    }

    /// Writes the trial to its file in `folder`, whole or not at all. A file that another program has written in the
    /// meantime is kept.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_in(&self, folder: &Path) -> Result<(), WriteError> {
        let path = Self::path(folder, self.id());
        KIND.save(&self.program, self, &path, AtomicFile::commit_new).map(drop)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, is damaged, or has the name of another trial.
    pub(crate) fn load(path: &Path) -> Result<Self, DocumentError> {
        let (program, trial) = KIND.load(path)?;
        let trial = Self { program, ..trial };
        if path.file_stem() == Some(trial.id().to_string().as_ref()) {
            return Ok(trial);
        }
        let id = trial.id();
        let defect = format!("its name belongs to another trial: its options are those of trial {id}");
        Err(KIND.damaged(path, defect))
    }
}

/// The options as one text: the same for the same options.
pub(super) fn options_text(options: &TrialOptions) -> String {
    let pairs = options.iter().map(|(option, value)| format!("{option}={value}"));
    Vec::from_iter(pairs).join("\n")
}

/// Number of digits of a written identifier.
const DIGITS: usize = 32;

/// 128-bit hash of what determines the result of a trial; names its files. SipHash-2-4 (Aumasson and Bernstein 2012) with
/// the key 0, which is the same in every version and on every machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TrialId(u128);

impl TrialId {
    /// Hash of a text.
    pub(crate) fn of(text: &str) -> Self {
        Self(u128::from_le_bytes(SipHasher24::new().hash(text.as_bytes()).as_bytes()))
    }
}

impl fmt::Display for TrialId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:0DIGITS$x}", self.0)
    }
}

impl Serialize for TrialId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl FromStr for TrialId {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let id = u128::from_str_radix(text, 16).ok().map(Self);
        let id = id.filter(|id| id.to_string() == text);
        id.ok_or_else(|| format!("'{text}' does not identify a trial"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected values are from a program that reproduces the authors' test vector for the empty message with the key
    /// 00 01 … 0f, with its bytes in reverse order.
    #[test]
    fn the_hash_is_that_of_the_published_algorithm() {
        for (text, id) in [
            ("", "f4f2ced447ab02427de0a38047d74950"),
            ("decoupler", "febf96383e2304c86ff7530a7ee5452c"),
        ] {
            assert_eq!(TrialId::of(text).to_string(), id);
            assert_eq!(id.parse(), Ok(TrialId::of(text)));
        }
        for other in ["", "1f", "xx", &"0".repeat(33), &"F".repeat(32)] {
            assert!(other.parse::<TrialId>().is_err(), "{other}");
        }
    }
}
