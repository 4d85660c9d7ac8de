use std::path::Path;

use super::{Column, Dialect, Format};
use decoupler_core::text::clean_name;

/// A file as columns of equal lengths.
#[derive(Clone, Debug)]
pub struct Table {
    /// Name of the file without its folder and ending.
    pub stem: String,
    /// Columns.
    pub columns: Vec<Column>,
    /// Number of rows.
    pub rows: usize,
    /// Kind of the file.
    pub format: Format,
    /// Notes for a reader of the table: rows of other lengths, arrays left out.
    pub notes: Vec<String>,
    /// Rows of the file that are not in the table, because they have more cells than there are columns.
    pub too_long: Excess,
    /// Rows that end before the last column; the cells they lack are missing.
    pub too_short: Excess,
    pub(super) lines: Lines,
}

/// Rows of an unusual length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Excess {
    /// Number of such rows.
    pub rows: usize,
    /// Line of the first, from 1.
    pub first_line: Option<u64>,
}

impl Excess {
    pub(super) fn add(&mut self, line: u64) {
        self.rows += 1;
        self.first_line.get_or_insert(line);
    }
}

/// Line of each row, which mostly follow each other.
#[derive(Clone, Debug, Default)]
pub(super) struct Lines {
    /// Rows that do not begin on the line after the row before, with their line.
    jumps: Vec<(usize, u64)>,
    next: u64,
}

impl Lines {
    pub(super) fn push(&mut self, row: usize, line: u64) {
        if row == 0 || line != self.next {
            self.jumps.push((row, line));
        }
        self.next = line + 1;
    }

    /// Line of a row, or its number if the file has no lines; from 1.
    pub(super) fn of(&self, row: usize) -> u64 {
        let after = self.jumps.partition_point(|(first, _)| *first <= row);
        match after.checked_sub(1).map(|index| self.jumps[index]) {
            Some((first, line)) => line + (row - first) as u64,
            None => row as u64 + 1,
        }
    }
}

impl Table {
    /// Line of a row of a file of text, else the number of the row; from 1.
    pub fn line(&self, row: usize) -> u64 {
        self.lines.of(row)
    }

    /// Layout of a file of text.
    pub fn dialect(&self) -> Option<&Dialect> {
        match &self.format {
            Format::Text(dialect) => Some(dialect),
            _ => None,
        }
    }
}

/// Name of a file without its folder and ending.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or_else(|| "data".to_owned(), |stem| clean_name(&stem.to_string_lossy()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_found_over_gaps() {
        let mut lines = Lines::default();
        let known = [2, 3, 4, 7, 8, 12];
        for (row, line) in known.into_iter().enumerate() {
            lines.push(row, line);
        }
        assert_eq!(lines.jumps.len(), 3);
        for (row, line) in known.into_iter().enumerate() {
            assert_eq!(lines.of(row), line);
        }
        assert_eq!(Lines::default().of(4), 5);
    }
}
