use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{DocumentError, DocumentKind, WriteError, atomic_write, document::PROGRAM, unfinished::folder_of};
use crate::import::{Plan, Setup, restored, stored};
use decoupler_core::{dataset::Simulation, evaluation::RunSettings};

const KIND: DocumentKind = DocumentKind::Recipe;

/// A recipe: the source of the samples of a run. The file is JSON to be read and changed by hand.
///
/// It has the field `format`, "decoupler recipe", its `version`, the `program` that wrote it, and the `source`:
///
/// ```json
/// {"format": "decoupler recipe", "version": 1, "program": "by hand",
///  "source": {"simulated": {"sensor": {"scale": "10x6_3x18"}, "samples": 500}}}
/// ```
///
/// describes a simulated array; omitted fields have the values of the paper's main experiment. With
/// `"source": {"recording": {"import": {"data": "press.csv", "inputs": ["c1..c8"], "targets": ["force"]}}}` the samples are
/// those of files, whose paths are relative to the folder of the recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
pub enum RecipeFile {
    /// Simulated array: its sensor, the scene, and the numbers of samples.
    Simulated(Simulation),
    /// Recording: its files, the meanings of their columns, and the division of the samples.
    Recording(Plan),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    version: u64,
    program: String,
    source: RecipeFile,
}

impl From<&Setup> for RecipeFile {
    fn from(setup: &Setup) -> Self {
        match (setup.plan().cloned(), setup.settings().simulation()) {
            (Some(mut plan), _) => {
                // So that another method holds out what it needs.
                let usual = setup.settings().validation_fraction();
                plan.division.validation_fraction.take_if(|share| *share == usual);
                Self::Recording(plan)
            }
            (None, Some(simulation)) => Self::Simulated(*simulation),
            (None, None) => unreachable!("the setup of a recording has a plan"),
        }
    }
}

impl RecipeFile {
    /// Writes the source, whose paths are relative to the working folder, whole or not at all.
    ///
    /// # Errors
    /// The path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), WriteError> {
        let document = Document {
            format: KIND.format().to_owned(),
            version: KIND.version(),
            program: PROGRAM.to_owned(),
            source: self.with_paths(|file| stored(file, folder_of(path))),
        };
        atomic_write(path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, &document)?;
            writeln!(writer)
        })
    }

    /// Reads the source in the file at `path`, with paths relative to the working folder.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, has an unknown field, or describes an invalid sensor or
    /// scene.
    pub fn load(path: &Path) -> Result<Self, DocumentError> {
        let bytes = KIND.read(path)?;
        let document: Document = serde_json::from_slice(&bytes).map_err(|error| KIND.damaged(path, error))?;
        let source = document.source.with_paths(|file| restored(file, folder_of(path)));
        source.check().map_err(|defect| KIND.damaged(path, defect))?;
        Ok(source)
    }

    /// As [`Self::load`], for callers that need a recording.
    ///
    /// # Errors
    /// As [`Self::load`], or the source is a simulated array.
    pub fn load_recording(path: &Path) -> Result<Plan, DocumentError> {
        match Self::load(path)? {
            Self::Recording(plan) => Ok(plan),
            Self::Simulated(_) => {
                let defect = "is the recipe of a simulated array: give the recipe of a recording";
                Err(DocumentError::unusable(path, defect))
            }
        }
    }

    fn with_paths(&self, of: impl Fn(&Path) -> PathBuf) -> Self {
        match self {
            Self::Recording(plan) => Self::Recording(plan.with_paths(of)),
            Self::Simulated(simulation) => Self::Simulated(*simulation),
        }
    }

    /// Describes the first invalid value.
    fn check(&self) -> Result<(), String> {
        match self {
            Self::Recording(plan) => plan.irregular().map_or(Ok(()), |file| {
                Err(format!("'{}' is a pipe or device, not a file", file.display()))
            }),
            Self::Simulated(simulation) => {
                simulation.sensor.check().map_err(|error| error.to_string())?;
                simulation.scene.check().map_err(|error| error.to_string())?;
                let settings = RunSettings::from(*simulation);
                settings.check_counts().map_err(|error| error.to_string())
            }
        }
    }
}
