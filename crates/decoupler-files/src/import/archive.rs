//! Zip archives: of NumPy arrays, and of the parts of a spreadsheet.

use std::io::{self, Read, Seek, SeekFrom};

use zip::{ZipArchive, result::ZipError};

use super::{TableError, Watch, progress::Watched};

/// Passes the name, the size and the contents of each entry to `read`. Each is read to its end, where its checksum is verified,
/// since damage can make it look like something else.
///
/// # Errors
/// If the archive is damaged, or any error of `read`.
pub(super) fn for_each_entry(
    mut source: impl Read + Seek,
    watch: Watch<'_>,
    mut read: impl FnMut(&str, u64, &mut dyn Read) -> Result<(), TableError>,
) -> Result<(), TableError> {
    check_names(&mut source)?;
    let mut archive = ZipArchive::new(source).map_err(defect)?;
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(defect)?;
        let (name, size) = (entry.name().map_err(defect)?.into_owned(), entry.size());
        let mut entry = Watched::new(entry, Some(size), watch);
        let found = read(&name, size, &mut entry);
        let name = name.strip_suffix(".npy").unwrap_or(&name);
        // Without its end, a part of a damaged entry may be larger than memory or endless.
        if !matches!(found, Err(TableError::Cancelled | TableError::OverBudget(_))) {
            io::copy(&mut entry, &mut io::sink()).map_err(|error| damage(name, error))?;
        }
        match found {
            Err(TableError::Io(error)) => return Err(damage(name, error)),
            found => found?,
        }
    }
    Ok(())
}

/// Checks that the name of each entry is the same at its data and in the directory at the end of the archive, so that a damaged
/// name does not become the name of a column.
fn check_names(source: &mut (impl Read + Seek)) -> Result<(), TableError> {
    /// Length of a header before the name of its entry.
    const HEADER: usize = 30;
    let mut archive = ZipArchive::new(&mut *source).map_err(defect)?;
    let mut entries = Vec::new();
    for index in 0..archive.len() {
        let entry = archive.by_index_raw(index).map_err(defect)?;
        entries.push((entry.header_start(), entry.name_raw().to_vec()));
    }
    drop(archive);
    for (start, name) in entries {
        let mut header = vec![0; HEADER + name.len()];
        source.seek(SeekFrom::Start(start))?;
        source.read_exact(&mut header)?;
        let length = usize::from(u16::from_le_bytes([header[26], header[27]]));
        if length != name.len() || header[HEADER..] != name {
            let reason = "an entry has two names; copy it again";
            return Err(TableError::damaged("the archive", reason));
        }
    }
    source.rewind()?;
    Ok(())
}

/// Returns the error of reading the entry `name`.
fn damage(name: &str, error: io::Error) -> TableError {
    match error.kind() {
        io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput | io::ErrorKind::UnexpectedEof => {
            TableError::damaged(name, "its contents do not match its checksum; copy it again")
        }
        _ => error.into(),
    }
}

fn defect(error: ZipError) -> TableError {
    match error {
        ZipError::Io(error) => error.into(),
        error => TableError::damaged("the archive", format_args!("{error}; copy it again, or save it again")),
    }
}
