//! Cells and rows of CSV, as every file of it is written.

use std::{
    borrow::Cow,
    io::{self, Write},
};

/// Returns a cell of CSV: quoted if necessary (RFC 4180).
pub fn csv_cell(text: &str) -> Cow<'_, str> {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\"")).into()
    } else {
        text.into()
    }
}

/// Writes a row of CSV.
///
/// # Errors
/// Any error of `writer`.
pub fn write_csv_row<T: AsRef<str>>(cells: impl IntoIterator<Item = T>, writer: &mut dyn Write) -> io::Result<()> {
    for (place, cell) in cells.into_iter().enumerate() {
        let comma = if place == 0 { "" } else { "," };
        write!(writer, "{comma}{}", csv_cell(cell.as_ref()))?;
    }
    writeln!(writer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_read_back_by_the_csv_crate() {
        let row = [
            "",
            "plain",
            "with, comma",
            "with \"quotes\"",
            "with\nbreak",
            "with\r",
            " spaces ",
            "=1",
        ];
        let mut text = Vec::new();
        write_csv_row(row, &mut text).unwrap();
        let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(&text[..]);
        let read = reader.records().next().unwrap().unwrap();
        assert_eq!(Vec::from_iter(&read), row);
    }
}
