use std::{
    fs::File,
    io::{Read, Seek},
    path::Path,
};

use super::{
    DialectChoice, Format, ImportError, Table, TableError, Watch, arrays, csv_table, csv_table::Reading, watch::Watched,
};

/// Reads the table in the file at `path`: arrays by the beginning of the file, all others as text.
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
    (&file).take(Format::BEGINNING).read_to_end(&mut start)?;
    file.rewind()?;
    match Format::of_arrays(path, &start) {
        Some((format, read_arrays)) => {
            let (found, left_out) = read_arrays(file, size, watch)?;
            arrays::table(path, found, format, left_out, reading)
        }
        None => csv_table::read(path, Watched::new(file, size, watch), reading),
    }
}
