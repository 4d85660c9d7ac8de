use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{DocumentError, DocumentKind, WriteError, atomic_write, document::PROGRAM};
use crate::import::Plan;

const KIND: DocumentKind = DocumentKind::Recipe;

/// A recipe: how measured samples are made of files and divided. The file is JSON to be read and changed by hand; paths in it are
/// relative to its folder.
#[derive(Clone, Debug, PartialEq)]
pub struct RecipeFile;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    version: u64,
    program: String,
    plan: Plan,
}

impl RecipeFile {
    /// Writes `plan`, whose paths are relative to the working folder, whole or not at all.
    ///
    /// # Errors
    /// The path cannot be written.
    pub fn save(plan: &Plan, path: &Path) -> Result<(), WriteError> {
        let document = Document {
            format: KIND.format().to_owned(),
            version: KIND.version(),
            program: PROGRAM.to_owned(),
            plan: plan.relative_to(folder(path)),
        };
        atomic_write(path, |writer| {
            serde_json::to_writer_pretty(&mut *writer, &document)?;
            writeln!(writer)
        })
    }

    /// Reads the plan in the file at `path`, with paths relative to the working folder.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or has a field that is missing, unknown or wrong.
    pub fn load(path: &Path) -> Result<Plan, DocumentError> {
        let bytes = KIND.read(path)?;
        let document: Document =
            serde_json::from_slice(&bytes).map_err(|error| KIND.damaged(path, error.to_string()))?;
        Ok(document.plan.within(folder(path)))
    }
}

fn folder(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new(""))
}
