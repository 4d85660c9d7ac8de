use std::{
    fs::File,
    io::{Read, Seek},
    path::{Path, PathBuf},
};

use decoupler_core::{
    dataset::Dataset,
    evaluation::{Channel, Problem, TargetPosition},
};
use serde::Serialize;

use super::{
    DialectChoice, Excess, Format, ImportError, Table, TableError, Watch,
    csv_table::{self, Reading},
    input_lines::Watched,
    numpy,
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
            numpy::table(path, found, format, left_out, reading)
        }
        None => csv_table::read(path, Watched::new(file, size, watch), reading),
    }
}

/// Measured samples with the meaning of their columns.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Samples in the order of their times, or of the file; readings and targets in the order of [`Self::inputs`] and
    /// [`Self::targets`]. Without a column of groups each sample is a group of its own.
    pub set: Dataset,
    /// Names and units of the readings.
    pub inputs: Vec<Channel>,
    /// Names and units of the targets.
    pub targets: Vec<Channel>,
    /// Positions of targets on the skin, for those that have one.
    pub positions: Vec<TargetPosition>,
    /// Line of each sample in the first file, from 1.
    pub lines: Vec<u64>,
    /// Time of each sample, if there is a column of times.
    pub times: Option<Vec<f64>>,
    /// `true` if the samples are grouped by a column.
    pub has_groups: bool,
    /// Number of rows in the file, dropped ones included.
    pub rows: usize,
    /// Rows that are no samples, by reason.
    pub dropped: Vec<Dropped>,
    /// The files read: the first, then those joined.
    pub files: Vec<FileReport>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Rows that are no samples for one reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Dropped {
    /// The reason.
    pub reason: String,
    /// Number of rows.
    pub rows: usize,
    /// Line of the first, from 1.
    pub first_line: u64,
}

/// A file as it was read.
#[derive(Clone, Debug)]
pub struct FileReport {
    /// The file.
    pub path: PathBuf,
    /// Kind of the file, and its layout.
    pub format: Format,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Rows that end before the last column.
    pub too_short: Excess,
    /// The join by time; `None` for the first file and for files joined row by row.
    pub join: Option<JoinReport>,
}

/// Outcome of a join by time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct JoinReport {
    /// Largest time between partners, in the unit of the times.
    pub limit: f64,
    /// Number of rows without a partner in the joined file.
    pub without_partner: usize,
    /// Number of rows of the joined file that are no row's partner.
    pub unused: usize,
    /// Median of the time of a row minus that of its partner.
    pub median_offset: Option<f64>,
}

impl Recording {
    /// Returns the description of the channels.
    pub fn problem(&self) -> Problem {
        Problem {
            inputs: self.inputs.clone(),
            targets: self.targets.clone(),
            positions: self.positions.clone(),
            has_nodes: false,
        }
    }
}
