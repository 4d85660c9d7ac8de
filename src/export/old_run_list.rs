//! The single file in which earlier versions kept all runs.

use std::path::Path;

use serde::Deserialize;
use serde_json::value::RawValue;

use super::{DocumentKind, NetworkFile, limited::read_limited};
use crate::dataset::system_cause;

/// Runs of the file by position, with their names, and the positions of the two that are compared.
pub(super) struct OldRunList {
    pub(super) runs: Vec<(String, Result<NetworkFile, String>)>,
    pub(super) pinned: [Option<usize>; 2],
}

#[derive(Deserialize)]
struct Document {
    format: String,
    version: u64,
    runs: Vec<RunDocument>,
    pinned: [Option<u64>; 2],
}

#[derive(Deserialize)]
struct RunDocument {
    id: u64,
    name: String,
    network: Box<RawValue>,
}

impl OldRunList {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// A description of the damage.
    pub(super) fn read(path: &Path) -> Result<Self, String> {
        let bytes = read_limited(path).map_err(|error| system_cause(&error))?;
        let document: Document = serde_json::from_slice(&bytes).map_err(|error| error.to_string())?;
        if (document.format.as_str(), document.version) != ("decoupler workspace", 1) {
            return Err("it is not a run list of an earlier version".to_owned());
        }
        let position = |id| document.runs.iter().position(|run| run.id == id);
        let pinned = document.pinned.map(|id| id.and_then(position));
        let runs = document.runs.into_iter().map(|run| {
            let bytes = run.network.get().as_bytes();
            let heading = DocumentKind::Network.heading(path, bytes);
            let file = heading.and_then(|heading| NetworkFile::parse(path, &heading, bytes));
            (run.name, file.map_err(|error| error.to_string()))
        });
        Ok(Self {
            runs: runs.collect(),
            pinned,
        })
    }
}
