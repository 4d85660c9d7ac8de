//! Tables for a terminal: columns padded with spaces, names to the left and numbers to the right.

use super::Table;

impl Table {
    /// Returns the table as lines of text with aligned columns, numbers rounded for readers.
    pub fn aligned(&self) -> String {
        let titles = self.columns.iter().map(|column| column.title()).collect();
        let rows = self
            .rows
            .iter()
            .map(|row| row.iter().map(|cell| cell.rounded()).collect());
        let lines = Vec::from_iter(std::iter::once(titles).chain(rows));
        let width = |column: usize| {
            let cells = lines.iter().filter_map(|line: &Vec<String>| line.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths = Vec::from_iter((0..self.columns.len()).map(width));
        let padded = |(column, cell): (usize, &String)| {
            let width = widths[column];
            if self.is_numeric(column) {
                format!("{cell:>width$}")
            } else {
                format!("{cell:<width$}")
            }
        };
        let line = |cells: &Vec<String>| {
            let cells = Vec::from_iter(cells.iter().enumerate().map(padded));
            cells.join("  ").trim_end().to_owned() + "\n"
        };
        lines.iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Cell, TableColumn};
    use super::*;

    #[test]
    fn numbers_end_and_names_begin_in_the_same_column() {
        let table = Table {
            columns: vec![TableColumn::new("name", "Decoder", ""), TableColumn::new("z", "Z", "%")],
            rows: vec![
                vec!["ridge µ".into(), 12.5.into()],
                vec!["a longer name".into(), Cell::Number(None)],
            ],
        };
        let expected = "Decoder        Z (%)\nridge µ         12.5\na longer name      –\n";
        assert_eq!(table.aligned(), expected);
    }
}
