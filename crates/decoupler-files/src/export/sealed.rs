use std::{io::Write as _, path::Path};

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use super::{
    AtomicFile, DocumentKind, WriteError,
    limited::{LARGEST_BYTES, too_large},
};

/// Layout of a file with a checksum: a heading and the record of a run. A change anywhere in the record is noticed.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sealed<'a> {
    format: String,
    pub(super) version: u64,
    pub(super) program: String,
    /// CRC-32 of the text of `run`, as hexadecimal digits.
    crc32: String,
    #[serde(borrow)]
    pub(super) run: &'a RawValue,
}

impl<'a> Sealed<'a> {
    pub(super) fn new(kind: DocumentKind, program: &str, run: &'a RawValue) -> Self {
        Self {
            format: kind.format().to_owned(),
            version: kind.version(),
            program: program.to_owned(),
            crc32: checksum(run),
            run,
        }
    }

    /// Reads a file and checks its checksum.
    ///
    /// # Errors
    /// A description of the damage.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, String> {
        let sealed: Self = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        if sealed.crc32 == checksum(sealed.run) {
            Ok(sealed)
        } else {
            Err("its checksum shows that something in it has changed".to_owned())
        }
    }

    /// Writes the file at `path`, whole or not at all; `commit` puts it in its place.
    ///
    /// # Errors
    /// The path cannot be written, or the file would be too large to be read again.
    pub(super) fn save(&self, path: &Path, commit: Commit) -> Result<(), WriteError> {
        /// More than the heading takes.
        const HEADING: u64 = 1 << 10;
        let error = |source| WriteError::io(path, source);
        if self.run.get().len() as u64 + HEADING > LARGEST_BYTES {
            return Err(error(too_large()));
        }
        let mut file = AtomicFile::create(path)?;
        serde_json::to_writer(&mut file, self).map_err(|source| error(source.into()))?;
        writeln!(file).map_err(error)?;
        commit(file)
    }
}

/// Puts a written file in its place: [`AtomicFile::commit`] or [`AtomicFile::commit_new`].
pub(super) type Commit = fn(AtomicFile) -> Result<(), WriteError>;

fn checksum(run: &RawValue) -> String {
    format!("{:08x}", crc32fast::hash(run.get().as_bytes()))
}
