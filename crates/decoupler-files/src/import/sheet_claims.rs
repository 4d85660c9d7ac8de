//! Memory of the parts of a zip archive with sheets, before they are read: the reader of spreadsheets allocates the whole
//! rectangle up to the last cell of an OpenDocument file, which a few hundred bytes can make larger than any memory.

use std::io::BufRead;

use quick_xml::{
    Reader,
    events::{BytesStart, Event},
};

use super::TableError;
use crate::machine::ReadingBudget;

/// Memory of a byte of XML: strings of one letter, in a vector that has just doubled.
const OF_BYTE: u64 = 4;
/// Memory of a cell that has a value, with its text.
pub(super) const OF_CELL: u64 = 128;
/// Memory of a cell of the rectangle up to the last cell, empty or not, as it is copied.
const OF_PLACE: u64 = 72;
/// Memory of a text without its letters.
const OF_TEXT: u64 = size_of::<String>() as u64;
/// Maximum number of rows and columns of a sheet.
pub(super) const LARGEST: [u64; 2] = [1 << 20, 1 << 14];

/// Claims the memory of a part of the archive with `size` bytes, up to its end or its first error, except the cells of Excel
/// files. With `is_strict`, its elements must end: the reader of OpenDocument files waits for their ends for ever.
///
/// # Errors
/// If it exceeds the budget, or an element does not end.
pub(super) fn claim(
    xml: impl BufRead,
    size: u64,
    is_strict: bool,
    budget: &mut ReadingBudget,
) -> Result<(), TableError> {
    budget.claim(size.saturating_mul(OF_BYTE))?;
    let mut reader = Reader::from_reader(xml);
    // As the reader of the sheets.
    let config = reader.config_mut();
    config.check_end_names = is_strict;
    config.check_comments = false;
    config.expand_empty_elements = true;
    let (mut sheet, mut buffer, mut open) = (Sheet::default(), Vec::new(), 0);
    loop {
        buffer.clear();
        match reader.read_event_into(&mut buffer) {
            Ok(Event::Start(element)) => {
                open += 1;
                sheet.take(&element, budget)?;
            }
            Ok(Event::End(_)) => open -= 1,
            Ok(Event::Eof) if !is_strict || open == 0 => break,
            Err(_) if !is_strict => break,
            Ok(Event::Eof) | Err(_) => {
                let reason = "an element of its contents has no end; save it again, or as CSV";
                return Err(TableError::damaged("the spreadsheet", reason));
            }
            Ok(_) => {}
        }
    }
    Ok(budget.claim(rectangle(sheet.extent))?)
}

/// A sheet, or one table of an OpenDocument file.
#[derive(Default)]
struct Sheet {
    /// Number of rows and columns up to the last cell with a value.
    extent: [u64; 2],
    /// Number of rows up to the current one, and of columns up to the current cell.
    end: [u64; 2],
    /// Number of cells of the current row whose memory is claimed.
    claimed: u64,
}

fn number(element: &BytesStart<'_>, name: &str) -> Option<u64> {
    element.try_get_attribute(name).ok()??.value.trim().parse().ok()
}

/// Refuses an element whose attributes the reader of spreadsheets may read in another way, or whose reference is to no cell.
fn check_attributes(element: &BytesStart<'_>) -> Result<(), TableError> {
    for attribute in element.attributes().with_checks(false) {
        match attribute {
            Ok(found) if found.key.as_ref() == "r" && !is_inside(&found.value) => return Err(outside(&found.value)),
            Ok(_) => {}
            Err(error) => {
                let reason = format!("{error}; save it again, or as CSV");
                return Err(TableError::damaged("the spreadsheet", reason));
            }
        }
    }
    Ok(())
}

/// Returns `true` for a reference to a row or a cell that a sheet can have, such as 12 or B12. The reader of spreadsheets takes
/// larger numbers for others.
fn is_inside(reference: &str) -> bool {
    let letters = reference.bytes().take_while(u8::is_ascii_alphabetic).count();
    let (letters, digits) = reference.split_at(letters);
    let column = letters.bytes().fold(0_u64, |column, letter| {
        column
            .saturating_mul(26)
            .saturating_add(u64::from(letter.to_ascii_uppercase() - b'A') + 1)
    });
    column <= LARGEST[1] && digits.parse().is_ok_and(|row: u64| (1..=LARGEST[0]).contains(&row))
}

pub(super) fn outside(cell: &str) -> TableError {
    let [rows, columns] = LARGEST;
    let reason = format!(
        "cell {cell} is outside of a sheet, which has {rows} rows and {columns} columns; save it again, or as CSV"
    );
    TableError::array("spreadsheet", reason)
}

impl Sheet {
    fn take(&mut self, element: &BytesStart<'_>, budget: &mut ReadingBudget) -> Result<(), TableError> {
        match element.local_name().as_ref() {
            "sst" => {
                let texts = number(element, "uniqueCount").unwrap_or(0);
                budget.claim(texts.saturating_mul(OF_TEXT))?;
            }
            "row" | "c" => check_attributes(element)?,
            "table" => {
                budget.claim(rectangle(self.extent))?;
                *self = Self::default();
            }
            "table-row" => {
                check_attributes(element)?;
                let repeats = number(element, "table:number-rows-repeated").unwrap_or(1);
                self.end = [self.end[0] + repeats.min(LARGEST[0]), 0];
                self.claimed = 0;
            }
            "table-cell" | "covered-table-cell" => {
                check_attributes(element)?;
                let repeats = number(element, "table:number-columns-repeated").unwrap_or(1);
                self.end[1] += repeats.min(LARGEST[1]);
                let mut names = element.attributes().flatten().map(|attribute| attribute.key);
                if names.any(|name| name.as_ref().starts_with("office:") || name.as_ref() == "table:formula") {
                    extend(&mut self.extent, self.end);
                    let width = self.end[1].min(LARGEST[1]);
                    budget.claim(OF_CELL.saturating_mul(width.saturating_sub(self.claimed)))?;
                    self.claimed = self.claimed.max(width);
                }
            }
            _ => {}
        }
        Ok(())
    }
}

/// Extends a rectangle to one with these numbers of rows and columns.
pub(super) fn extend(extent: &mut [u64; 2], end: [u64; 2]) {
    *extent = [extent[0].max(end[0]), extent[1].max(end[1])];
}

/// Returns the memory of a rectangle of cells in bytes.
pub(super) fn rectangle([rows, columns]: [u64; 2]) -> u64 {
    rows.saturating_mul(columns).saturating_mul(OF_PLACE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claimed(xml: &str) -> u64 {
        let claims = |limit| claim(xml.as_bytes(), 0, false, &mut ReadingBudget::of(limit, true)).is_ok();
        // Bisection: the smallest budget that suffices.
        let (mut low, mut high) = (0, u64::MAX);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if claims(middle) { high = middle } else { low = middle }
        }
        high
    }

    #[test]
    fn references_beyond_the_last_row_or_column_are_refused() {
        for (reference, expected) in [
            ("XFD1048576", true),
            ("12", true),
            ("XFE1", false),
            ("A1048577", false),
            // In 32 bits, the first row.
            ("A4294967297", false),
            ("A99999999999999999999", false),
            ("A0", false),
            ("A", false),
        ] {
            assert_eq!(is_inside(reference), expected, "{reference}");
        }
        for malformed in [
            "<c r r=\"A1\"/>",
            "<c r=\"A1\" r=\"A0\"/>",
            "<table:table-cell x table:y=\"1\"/>",
        ] {
            assert_eq!(claimed(malformed), u64::MAX, "{malformed}");
        }
        assert_eq!(claimed("<sst uniqueCount=\"1000000\"><si/></sst>"), 1_000_000 * OF_TEXT);
    }

    #[test]
    fn repeated_cells_of_open_document_files_count_unless_they_are_empty() {
        let table = |rows: &str| format!("<table:table>{rows}</table:table>");
        let valued = "<table:table-cell table:number-columns-repeated=\"10\" office:value-type=\"float\"/>";
        let row =
            |cells: &str| format!("<table:table-row table:number-rows-repeated=\"1000\">{cells}</table:table-row>");
        assert_eq!(claimed(&table(&row(valued))), 10_000 * OF_PLACE + 10 * OF_CELL);
        // The empty rest of a sheet, as every program writes it.
        let empty = row("<table:table-cell table:number-columns-repeated=\"16384\"/>");
        assert_eq!(
            claimed(&table(&format!("{}{empty}", row(valued)))),
            10_000 * OF_PLACE + 10 * OF_CELL
        );
        let two = format!("{}{}", table(&row(valued)), table(&row(valued)));
        assert_eq!(claimed(&two), 2 * (10_000 * OF_PLACE + 10 * OF_CELL));
    }
}
