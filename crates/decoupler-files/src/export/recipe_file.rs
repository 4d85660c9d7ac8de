use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{DocumentError, DocumentKind, WriteError, atomic_write, document::PROGRAM, unfinished::folder_of};
use crate::import::{Plan, Setup};
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
#[derive(Clone, Debug, PartialEq)]
pub struct RecipeFile;

/// Source of samples in a recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
pub enum RecipeSource {
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
    source: RecipeSource,
}

impl From<Simulation> for RecipeSource {
    fn from(simulation: Simulation) -> Self {
        Self::Simulated(simulation)
    }
}

impl From<&Plan> for RecipeSource {
    fn from(plan: &Plan) -> Self {
        Self::Recording(plan.clone())
    }
}

impl From<&Setup> for RecipeSource {
    fn from(setup: &Setup) -> Self {
        match (setup.plan(), setup.settings().simulation()) {
            (Some(plan), _) => {
                let mut plan = plan.clone();
                // So that another method holds out what it needs.
                let division = &mut plan.division;
                let usual = setup.settings().validation_fraction();
                division.validation_fraction = division.validation_fraction.filter(|share| *share != usual);
                Self::Recording(plan)
            }
            (None, Some(simulation)) => (*simulation).into(),
            (None, None) => unreachable!("the setup of a recording has a plan"),
        }
    }
}

impl RecipeFile {
    /// Writes `source`, whose paths are relative to the working folder, whole or not at all.
    ///
    /// # Errors
    /// The path cannot be written.
    pub fn save(source: impl Into<RecipeSource>, path: &Path) -> Result<(), WriteError> {
        let document = Document {
            format: KIND.format().to_owned(),
            version: KIND.version(),
            program: PROGRAM.to_owned(),
            source: match source.into() {
                RecipeSource::Recording(plan) => RecipeSource::Recording(plan.relative_to(folder_of(path))),
                simulated @ RecipeSource::Simulated(_) => simulated,
            },
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
    pub fn load(path: &Path) -> Result<RecipeSource, DocumentError> {
        let bytes = KIND.read(path)?;
        let document: Document =
            serde_json::from_slice(&bytes).map_err(|error| KIND.damaged(path, error.to_string()))?;
        match document.source {
            RecipeSource::Recording(plan) => {
                let plan = plan.restored(folder_of(path));
                match plan.irregular() {
                    None => Ok(RecipeSource::Recording(plan)),
                    Some(file) => {
                        let defect = format!("'{}' is a pipe or device, not a file", file.display());
                        Err(KIND.damaged(path, defect))
                    }
                }
            }
            RecipeSource::Simulated(simulation) => {
                check(simulation).map_err(|error| KIND.damaged(path, error))?;
                Ok(RecipeSource::Simulated(simulation))
            }
        }
    }

    /// As [`Self::load`], for callers that need a recording.
    ///
    /// # Errors
    /// As [`Self::load`], or the source is a simulated array.
    pub fn load_recording(path: &Path) -> Result<Plan, DocumentError> {
        match Self::load(path)? {
            RecipeSource::Recording(plan) => Ok(plan),
            RecipeSource::Simulated(_) => Err(DocumentError::SimulatedRecipe(path.to_owned())),
        }
    }
}

/// Describes the first invalid value of a simulation.
fn check(source: Simulation) -> Result<(), String> {
    source.sensor.check().map_err(|error| error.to_string())?;
    source.scene.check().map_err(|error| error.to_string())?;
    RunSettings::from(source)
        .check_counts()
        .map_err(|error| error.to_string())
}
