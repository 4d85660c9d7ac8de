use std::{
    fs,
    path::{Path, PathBuf},
};

use decoupler_files::export::atomic_write;

/// Name and contents of the sample: made by `examples/soft_skin.rs`.
const NAME: &str = "soft_skin.csv";
const TEXT: &str = include_str!("../../../../../assets/samples/soft_skin.csv");

/// Writes the sample recording into `folder`, and returns its path.
///
/// # Errors
/// If it cannot be written.
pub(super) fn write_sample(folder: &Path) -> Result<PathBuf, String> {
    let path = folder.join(NAME);
    let refused = |error: &dyn std::fmt::Display| format!("the sample recording cannot be written: {error}");
    fs::create_dir_all(folder).map_err(|error| refused(&error))?;
    // The same file keeps its time of change.
    if fs::read(&path).is_ok_and(|written| written == TEXT.as_bytes()) {
        return Ok(path);
    }
    atomic_write(&path, |file| file.write_all(TEXT.as_bytes())).map_err(|error| refused(&error))?;
    Ok(path)
}
