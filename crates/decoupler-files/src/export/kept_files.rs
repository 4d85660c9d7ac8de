//! Files of the folder in which runs are kept: `run-N.json`, the network file of run N, written once; `run-N.name.json`,
//! its name; `pinned.json`, the two runs that are compared.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use serde::{Serialize, de::DeserializeOwned};
use serde_json::value::to_raw_value;

use super::{AtomicFile, DocumentError, DocumentKind, WriteError, document::PROGRAM, sealed::Sealed};

const KIND: DocumentKind = DocumentKind::RunList;

/// Network file of run `id`.
pub(super) fn run_path(folder: &Path, id: u64) -> PathBuf {
    folder.join(format!("run-{id}.json"))
}

/// File with the name of run `id`.
pub(super) fn name_path(folder: &Path, id: u64) -> PathBuf {
    folder.join(format!("run-{id}.name.json"))
}

/// File with the ids of the two runs that are compared.
pub(super) fn pinned_path(folder: &Path) -> PathBuf {
    folder.join("pinned.json")
}

/// Returns the ids of all runs in `folder`, in ascending order.
pub(super) fn ids(folder: &Path) -> io::Result<Vec<u64>> {
    let mut ids = Vec::new();
    for entry in fs::read_dir(folder)? {
        let name = entry?.file_name();
        let id = name.to_str().and_then(|name| {
            let id = name.strip_prefix("run-")?.strip_suffix(".json")?.parse().ok()?;
            // Not "run-007.json", which is no one's.
            (run_path(Path::new(""), id) == Path::new(name)).then_some(id)
        });
        ids.extend(id);
    }
    ids.sort_unstable();
    Ok(ids)
}

/// Writes a small value, sealed with a checksum.
pub(super) fn write(path: &Path, value: &impl Serialize) -> Result<(), WriteError> {
    let value = to_raw_value(value).map_err(|error| WriteError::io(path, error.into()))?;
    Sealed::new(KIND, PROGRAM, &value).save(path, AtomicFile::commit)
}

/// Reads what [`write`] has written; `None` if there is no file.
///
/// # Errors
/// The file cannot be read, is of another kind or version, or is damaged.
pub(super) fn read<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, DocumentError> {
    let bytes = match KIND.read(path) {
        Ok(bytes) => bytes,
        Err(DocumentError::Read { source, .. }) if source.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error),
    };
    let read = Sealed::read(&bytes).and_then(|sealed| {
        let value = serde_json::from_str(sealed.run.get());
        value.map_err(|error| error.to_string())
    });
    read.map(Some).map_err(|defect| KIND.damaged(path, defect))
}
