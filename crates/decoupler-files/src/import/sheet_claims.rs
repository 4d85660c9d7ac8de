//! Checksums and memory of the parts of a zip archive with sheets, before they are read: the reader of spreadsheets does not
//! read parts to their end, where their checksum is, and allocates the whole rectangle between the first and the last cell of
//! an OpenDocument file, which a few hundred bytes can make larger than any memory.

use std::io::{self, BufRead, BufReader, Read, Seek};

use quick_xml::{
    Reader,
    events::{BytesStart, Event},
};
use zip::ZipArchive;

use super::{TableError, Watch, numpy::damage, progress::Watched};
use crate::machine::ReadingBudget;

/// Memory of a byte of XML: strings of one letter, in a vector that has just doubled.
const OF_BYTE: u64 = 4;
/// Memory of a cell that has a value, with its text.
pub(super) const OF_CELL: u64 = 128;
/// Memory of a cell of the rectangle, empty or not, as it is copied.
const OF_PLACE: u64 = 72;
/// Memory of a text without its letters.
const OF_TEXT: u64 = size_of::<String>() as u64;
/// Maximum number of rows and columns of a sheet.
pub(super) const LARGEST: [u64; 2] = [1 << 20, 1 << 14];

/// Claims the memory of all parts of the archive, except the cells of Excel files, and verifies their checksums. With
/// `is_strict`, elements of its sheets must end: the reader of OpenDocument files waits for their ends for ever.
///
/// # Errors
/// If it exceeds the budget, a part is damaged, or an element does not end.
pub(super) fn claim(
    source: impl Read + Seek,
    is_strict: bool,
    budget: &mut ReadingBudget,
    watch: Watch<'_>,
) -> Result<(), TableError> {
    let Ok(mut archive) = ZipArchive::new(source) else {
        // Reported by the reader of the sheets.
        return Ok(());
    };
    for index in 0..archive.len() {
        let entry = archive
            .by_index(index)
            .map_err(|error| TableError::damaged("the archive", format_args!("{error}; copy it again")))?;
        let size = entry.size();
        let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
        let is_strict = is_strict && name == "content.xml";
        budget.claim(size.saturating_mul(OF_BYTE))?;
        let mut xml = BufReader::new(Watched::new(entry, Some(size), watch));
        let claimed = claim_part(&mut xml, is_strict, budget);
        // Without its end, a part may be larger than memory or endless.
        let ended = match claimed {
            Err(TableError::OverBudget(_)) => Ok(0),
            _ => io::copy(&mut xml, &mut io::sink()),
        };
        ended.map_err(|error| damage(&name, error))?;
        claimed?;
    }
    Ok(())
}

/// Claims the memory of one part of the archive, up to its end or its first error.
fn claim_part(xml: impl BufRead, is_strict: bool, budget: &mut ReadingBudget) -> Result<(), TableError> {
    let mut reader = Reader::from_reader(xml);
    // As the reader of the sheets.
    let config = reader.config_mut();
    config.check_end_names = is_strict;
    config.check_comments = false;
    let (mut sheet, mut buffer, mut open) = (Sheet::default(), Vec::new(), 0);
    loop {
        buffer.clear();
        match reader.read_event_into(&mut buffer) {
            Ok(Event::Start(element)) => {
                open += 1;
                sheet.take(&element, budget)?;
            }
            Ok(Event::Empty(element)) => sheet.take(&element, budget)?,
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
    sheet.end(budget)
}

/// Rectangle of a sheet, or of one table of an OpenDocument file.
#[derive(Default)]
struct Sheet {
    rectangle: Rectangle,
    /// Row and column after the last cell.
    next: [u64; 2],
    /// Number of rows that the current row repeats.
    row_repeats: u64,
    /// Number of cells that the current cell repeats.
    repeats: u64,
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
                self.end(budget)?;
                *self = Self::default();
            }
            "table-row" => {
                check_attributes(element)?;
                self.next = [self.next[0] + self.row_repeats, 0];
                let repeats = number(element, "table:number-rows-repeated");
                self.row_repeats = repeats.unwrap_or(1).min(LARGEST[0]);
                (self.repeats, self.claimed) = (0, 0);
            }
            "table-cell" | "covered-table-cell" => {
                check_attributes(element)?;
                self.next[1] += self.repeats;
                let repeats = number(element, "table:number-columns-repeated");
                self.repeats = repeats.unwrap_or(1).min(LARGEST[1]);
                let values = ["office:value-type", "office:value", "table:formula"];
                if values
                    .iter()
                    .any(|name| matches!(element.try_get_attribute(name), Ok(Some(_))))
                {
                    self.rectangle.include(self.next, [self.row_repeats, self.repeats]);
                    let width = (self.next[1] + self.repeats).min(LARGEST[1]);
                    budget.claim(OF_CELL.saturating_mul(width.saturating_sub(self.claimed)))?;
                    self.claimed = self.claimed.max(width);
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Claims the rectangle.
    fn end(&self, budget: &mut ReadingBudget) -> Result<(), TableError> {
        Ok(budget.claim(self.rectangle.memory())?)
    }
}

/// Rectangle between the first and the last cell with a value.
#[derive(Default)]
pub(super) struct Rectangle {
    /// First and last row and column.
    bounds: Option<[[u64; 2]; 2]>,
}

impl Rectangle {
    /// Includes a number of rows and columns from `first`.
    pub(super) fn include(&mut self, first: [u64; 2], counts: [u64; 2]) {
        let last = [0, 1].map(|axis| first[axis].saturating_add(counts[axis].saturating_sub(1)));
        let [before, after] = self.bounds.unwrap_or([first, last]);
        self.bounds = Some([
            [0, 1].map(|axis| before[axis].min(first[axis])),
            [0, 1].map(|axis| after[axis].max(last[axis])),
        ]);
    }

    /// Returns its memory in bytes.
    pub(super) fn memory(&self) -> u64 {
        let Some([first, last]) = self.bounds else { return 0 };
        let [rows, columns] = [0, 1].map(|axis| last[axis] - first[axis] + 1);
        rows.saturating_mul(columns).saturating_mul(OF_PLACE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn claimed(xml: &str) -> u64 {
        let claims = |limit| claim_part(xml.as_bytes(), false, &mut ReadingBudget::of(limit, true)).is_ok();
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
