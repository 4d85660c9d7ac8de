use std::io::{Read, Seek};

use zip::{ZipArchive, result::ZipError};

use super::{TableError, Watch, format::Array, input_lines::Watched, numpy};

/// Reads the arrays of an archive, and says which entries are none.
pub(super) fn read(source: impl Read + Seek, watch: Watch<'_>) -> Result<(Vec<Array>, Vec<String>), TableError> {
    let mut archive = ZipArchive::new(source).map_err(|error| defect("the archive", error))?;
    let mut arrays = Vec::new();
    let mut left_out = Vec::new();
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(|error| defect("the archive", error))?;
        let file_name = entry.name().map_err(|error| defect("the archive", error))?.into_owned();
        let Some(name) = file_name.strip_suffix(".npy").map(str::to_owned) else {
            left_out.push(format!("{file_name} is no .npy file"));
            continue;
        };
        let size = entry.size();
        match numpy::read(&name, Watched::new(entry, Some(size), watch)) {
            Ok(array) => arrays.push(array),
            // A text or a number next to the arrays is no reason to refuse them.
            Err(TableError::Array { what, reason }) => left_out.push(format!("{what}: {reason}")),
            Err(error) => return Err(error),
        }
    }
    Ok((arrays, left_out))
}

fn defect(what: &str, error: ZipError) -> TableError {
    match error {
        ZipError::Io(error) => super::input_lines::table_error(error),
        error => TableError::array(what, format!("{error}; save it again with numpy.savez")),
    }
}
