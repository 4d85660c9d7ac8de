//! Files of own data as they were found.

use std::{
    io::{self, Write},
    path::PathBuf,
};

use serde::Serialize;

use crate::{
    export::format_number,
    import::{Dropped, FileReport, JoinReport, Recording},
};

/// A file as it was found.
#[derive(Serialize)]
pub(super) struct FileFound {
    path: PathBuf,
    format: String,
    rows: usize,
    columns: usize,
    join: Option<JoinReport>,
}

impl FileFound {
    fn of(report: &FileReport) -> Self {
        Self {
            path: report.path.clone(),
            format: report.format.to_string(),
            rows: report.rows,
            columns: report.columns,
            join: report.join,
        }
    }
}

pub(super) fn files<'a>(recordings: impl Iterator<Item = &'a Recording>) -> Vec<FileFound> {
    recordings
        .flat_map(|recording| recording.files.iter().map(FileFound::of))
        .collect()
}

pub(super) fn write_files(
    files: &[FileFound],
    rows: usize,
    dropped: &[Dropped],
    out: &mut impl Write,
) -> io::Result<()> {
    for file in files {
        writeln!(
            out,
            "{}: {} rows × {} columns, {}",
            file.path.display(),
            file.rows,
            file.columns,
            file.format
        )?;
        if let Some(join) = file.join {
            let offset = join.median_offset.map_or_else(String::new, |offset| {
                format!(", median {} apart", format_number(offset.abs()))
            });
            writeln!(
                out,
                "  joined by time within {}{offset}; {} rows without partner, {} of its rows unused",
                format_number(join.limit),
                join.without_partner,
                join.unused
            )?;
        }
    }
    for Dropped {
        reason,
        rows: count,
        first_line,
    } in dropped
    {
        writeln!(
            out,
            "{count} of {rows} rows dropped: {reason} (first on line {first_line})"
        )?;
    }
    Ok(())
}
