use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{TrialId, load, save_new};
use crate::export::{DocumentError, DocumentKind, WriteError, document::PROGRAM};

const KIND: DocumentKind = DocumentKind::Trial;

/// Options of `decoupler train` with their values, each option once and every default written out.
pub type TrialOptions = BTreeMap<String, Value>;

/// A finished trial of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Program and version that trained it.
    pub(crate) program: String,
    /// Options that determine the result.
    pub(crate) options: TrialOptions,
    /// The object that `decoupler train --json` prints for these options.
    pub(crate) report: Value,
    /// Time for the trial in seconds: drawing, training and measuring, on one thread.
    pub(crate) seconds: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TrialDocument {
    options: TrialOptions,
    report: Value,
    seconds: f64,
}

impl Trial {
    /// The result of a trial by this program.
    pub fn new(options: TrialOptions, report: Value, seconds: f64) -> Self {
        Self {
            program: PROGRAM.to_owned(),
            options,
            report,
            seconds,
        }
    }

    /// Identifier of a trial with these options by this program.
    pub fn id_of(options: &TrialOptions) -> TrialId {
        Self::id_by(PROGRAM, options)
    }

    /// Identifier of this trial.
    pub(crate) fn id(&self) -> TrialId {
        Self::id_by(&self.program, &self.options)
    }

    fn id_by(program: &str, options: &TrialOptions) -> TrialId {
        let pairs: Vec<String> = options
            .iter()
            .map(|(option, value)| format!("{option}={value}"))
            .collect();
        TrialId::of(&format!("{program}\n{}", pairs.join("\n")))
    }

    /// File of the trial `id` in `folder`.
    pub fn path(folder: &Path, id: TrialId) -> PathBuf {
        folder.join(format!("{id}.json"))
    }

    /// Writes the trial to its file in `folder`, whole or not at all. A file that another program has written meanwhile
    /// stays.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save_in(&self, folder: &Path) -> Result<(), WriteError> {
        let document = TrialDocument {
            options: self.options.clone(),
            report: self.report.clone(),
            seconds: self.seconds,
        };
        save_new(KIND, &self.program, &document, &Self::path(folder, self.id())).map(drop)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, is damaged, or has the name of another trial.
    pub(crate) fn load(path: &Path) -> Result<Self, DocumentError> {
        let (program, document) = load(KIND, path)?;
        let TrialDocument {
            options,
            report,
            seconds,
        } = document;
        let trial = Self {
            program,
            options,
            report,
            seconds,
        };
        if path.file_stem() == Some(trial.id().to_string().as_ref()) {
            Ok(trial)
        } else {
            let defect = format!(
                "its name belongs to another trial than its options, which are of {}",
                trial.id()
            );
            Err(KIND.damaged(path, defect))
        }
    }
}
