use std::{
    fs::File,
    io::{BufReader, Read, Seek},
    path::Path,
};

use super::{
    DialectChoice, Format, ImportError, Table, TableError, Watch, arrays, csv_table, csv_table::Reading, matlab, npz,
    numpy, watch::Watched,
};

/// Reads the table in the file at `path`: `.npy`, `.npz` and `.mat` by their contents, all others as text.
///
/// # Errors
/// If the file cannot be read or holds no table, or `watch` breaks.
pub fn read_table(path: &Path, choice: DialectChoice, watch: Watch<'_>) -> Result<Table, ImportError> {
    let reading = Reading {
        choice,
        ..Reading::default()
    };
    read(path, &reading, watch)
}

pub(super) fn read(path: &Path, reading: &Reading<'_>, watch: Watch<'_>) -> Result<Table, ImportError> {
    let refused = |source| ImportError::Read {
        path: path.to_owned(),
        source,
    };
    let file = File::open(path).map_err(refused)?;
    let metadata = file.metadata().map_err(refused)?;
    if metadata.is_dir() {
        return Err(refused(std::io::ErrorKind::IsADirectory.into()));
    }
    let size = metadata.is_file().then_some(metadata.len());
    read_file(path, file, size, reading, watch).map_err(|source| match source {
        TableError::Io(source) => refused(source),
        TableError::Cancelled => ImportError::Cancelled,
        source => ImportError::File {
            path: path.to_owned(),
            source,
        },
    })
}

fn read_file(
    path: &Path,
    mut file: File,
    size: Option<u64>,
    reading: &Reading<'_>,
    watch: Watch<'_>,
) -> Result<Table, TableError> {
    let mut start = Vec::new();
    if size.is_none() {
        // A pipe cannot be looked into and read again.
        return csv_table::read(path, Watched::new(file, None, watch), reading);
    }
    (&file).take(10).read_to_end(&mut start)?;
    file.rewind()?;
    let is_mat = path
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("mat"));
    match &start[..] {
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => {
            let array = numpy::read("", BufReader::new(Watched::new(file, size, watch)));
            let array = array.map_err(|error| match error {
                TableError::Array { reason, .. } => TableError::array("NumPy array", reason),
                error => error,
            })?;
            arrays::table(path, vec![array], Format::Npy, Vec::new(), reading)
        }
        [b'P', b'K', 3 | 5, ..] => {
            let (found, left_out) = npz::read(BufReader::new(file), watch)?;
            arrays::table(path, found, Format::Npz, left_out, reading)
        }
        _ if is_mat || start.starts_with(b"MATLAB") => {
            let (found, left_out) = matlab::read(BufReader::new(Watched::new(file, size, watch)))?;
            arrays::table(path, found, Format::Matlab, left_out, reading)
        }
        _ => csv_table::read(path, Watched::new(file, size, watch), reading),
    }
}
