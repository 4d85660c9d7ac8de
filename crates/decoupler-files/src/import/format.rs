//! Formats of recordings. A further format is a variant of [`Format`] here, and a module that reads its arrays.

use std::{fmt, fs::File, io::BufReader, path::Path};

use super::{Dialect, TableError, Watch, element::Array, matlab, npz, numpy, watch::Watched};

/// Kind of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text in this layout.
    Text(Dialect),
    /// A `.npy` file.
    Npy,
    /// A `.npz` archive.
    Npz,
    /// A `.mat` file of versions 5 to 7.
    Matlab,
}

/// Reads the arrays of a file of this size, and names what is in it that is no array of numbers.
type ReadArrays = fn(File, Option<u64>, Watch<'_>) -> Result<(Vec<Array>, Vec<String>), TableError>;

impl Format {
    /// All formats in words, for messages and help.
    pub const NAMES: &str = "CSV, .npy, .npz or .mat";

    /// Usual extensions of the files, those of text first.
    pub const EXTENSIONS: [&str; 7] = ["csv", "txt", "tsv", "dat", "npy", "npz", "mat"];

    /// Number of bytes by which a format is recognised.
    pub(super) const BEGINNING: u64 = 10;

    /// Returns the format of arrays that the file at `path` has, by its `beginning`, with the function that reads it;
    /// `None` for text.
    pub(super) fn of_arrays(path: &Path, beginning: &[u8]) -> Option<(Self, ReadArrays)> {
        let has_extension = |extension: &str| {
            path.extension()
                .is_some_and(|found| found.eq_ignore_ascii_case(extension))
        };
        match beginning {
            [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => Some((Self::Npy, |file, size, watch| {
                let array = numpy::read("", BufReader::new(Watched::new(file, size, watch)));
                let array = array.map_err(|error| match error {
                    TableError::Array { reason, .. } => TableError::array("NumPy array", reason),
                    error => error,
                })?;
                Ok((vec![array], Vec::new()))
            })),
            [b'P', b'K', 3 | 5, ..] => Some((Self::Npz, |file, _, watch| npz::read(BufReader::new(file), watch))),
            _ if has_extension("mat") || beginning.starts_with(b"MATLAB") => {
                Some((Self::Matlab, |file, size, watch| {
                    matlab::read(BufReader::new(Watched::new(file, size, watch)))
                }))
            }
            _ => None,
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(dialect) => write!(f, "text: {dialect}"),
            Self::Npy => f.write_str("NumPy array"),
            Self::Npz => f.write_str("archive of NumPy arrays"),
            Self::Matlab => f.write_str("MATLAB file"),
        }
    }
}
