use std::{
    collections::BTreeSet,
    ffi::OsStr,
    io::{self, Write},
    path::Path,
};

use super::merging::MergedSweep;
use decoupler_core::text::inert;

/// Layout of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SweepTableFormat {
    /// A line for each trial.
    Csv,
    /// One object with every field of the results, and the missing and conflicting trials.
    Json,
}

impl SweepTableFormat {
    /// The format that belongs to the ending of `path`.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension().and_then(OsStr::to_str)?;
        match ending.to_ascii_lowercase().as_str() {
            "csv" => Some(Self::Csv),
            "json" => Some(Self::Json),
            _ => None,
        }
    }

    /// Writes the rows of a sweep as a table.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write(self, merged: &MergedSweep, writer: &mut dyn Write) -> io::Result<()> {
        match self {
            Self::Csv => write_csv(merged, writer),
            Self::Json => {
                serde_json::to_writer_pretty(&mut *writer, merged)?;
                writeln!(writer)
            }
        }
    }
}

fn write_csv(merged: &MergedSweep, writer: &mut dyn Write) -> io::Result<()> {
    let rows: Vec<_> = merged.trials.iter().map(|row| row.cells()).collect();
    let columns: BTreeSet<_> = rows.iter().flat_map(|cells| cells.keys()).collect();
    let mut table = csv::Writer::from_writer(writer);
    table.write_record(columns.iter().map(|column| column.heading()))?;
    for cells in &rows {
        let cell = |column| cells.get(column).map_or("", String::as_str);
        table.write_record(columns.iter().map(|&column| inert(cell(column))))?;
    }
    table.flush()
}
