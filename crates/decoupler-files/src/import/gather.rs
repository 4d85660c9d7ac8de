use ndarray::Array2;

use super::{Table, column::Cells, names::ColumnId};

/// Number of rows that are moved at once.
const BLOCK: usize = 1 << 14;

/// Rows of a recording, whose columns are given up as they are moved.
pub(super) struct Source<'a> {
    pub(super) tables: &'a mut [Table],
    /// Partners in each joined file; `None` where rows are joined row by row.
    pub(super) partners: &'a [Option<Vec<Option<u32>>>],
    /// Rows of the first file that are samples.
    pub(super) rows: &'a [usize],
}

/// Moves columns into an array of samples × columns; those in `kept` are needed later.
///
/// Works from the last row to the first and shortens the columns on the way, so that the numbers are not in memory
/// twice.
pub(super) fn gather(source: &mut Source<'_>, columns: &[ColumnId], kept: &[ColumnId]) -> Array2<f64> {
    for (file, table) in source.tables.iter_mut().enumerate() {
        for (index, column) in table.columns.iter_mut().enumerate() {
            let id = ColumnId { file, column: index };
            if !columns.contains(&id) && !kept.contains(&id) {
                column.cells = Cells::default();
            }
        }
    }
    let is_ascending = source.rows.is_sorted();
    let mut all = Array2::zeros((source.rows.len(), columns.len()));
    let numbers = all.as_slice_mut().expect("a new array is contiguous");
    let mut end = source.rows.len();
    while end > 0 {
        let start = end.saturating_sub(BLOCK);
        let rows = &source.rows[start..end];
        for (place, id) in columns.iter().enumerate() {
            let partners = id
                .file
                .checked_sub(1)
                .and_then(|joined| source.partners[joined].as_deref());
            let cells = &mut source.tables[id.file].columns[id.column].cells;
            let block = numbers[start * columns.len()..end * columns.len()].chunks_exact_mut(columns.len());
            for (sample, &row) in block.zip(rows) {
                sample[place] = match partners {
                    None => cells.number(row),
                    Some(partners) => partners[row].map_or(f64::NAN, |row| cells.number(row as usize)),
                };
            }
            if let (None, Cells::Numbers(moved), true) = (partners, cells, is_ascending) {
                moved.truncate(rows[0]);
                moved.shrink_to_fit();
            }
        }
        end = start;
    }
    all
}
