//! Memory that the sheets of an Excel file up to 2003 will take, found before they are read: [MS-XLS], the records of its
//! workbook stream. The reader of spreadsheets allocates the rectangle between the first and the last cell, and follows a
//! container whose sectors form a cycle without end; opening it here first refuses such a container.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufReader, Read},
};

use cfb::CompoundFile;

use super::{TableError, sheet_claims::Rectangle};
use crate::machine::ReadingBudget;

/// Memory of a byte of the stream: short texts, in a vector that has just doubled.
const OF_BYTE: u64 = 16;
/// Memory of a cell that has a value.
const OF_CELL: u64 = 128;

const BOUND_SHEET: u16 = 0x0085;
const END: u16 = 0x000a;
const BEGIN: u16 = 0x0809;
const DIMENSIONS: u16 = 0x0200;
const SEVERAL_NUMBERS: u16 = 0x00bd;
/// Records of one cell: number, label, rich text, truth value, integer, shared text, formula.
const CELLS: [u16; 7] = [0x0203, 0x0204, 0x00d6, 0x0205, 0x027e, 0x00fd, 0x0006];

/// Claims the memory of all sheets.
///
/// # Errors
/// If it exceeds the budget, or the file is damaged.
pub(super) fn claim(file: &File, budget: &mut ReadingBudget) -> Result<(), TableError> {
    let damaged =
        |error: std::io::Error| TableError::array("spreadsheet", format!("{error}; save it again, or as CSV"));
    budget.claim(file.metadata()?.len())?;
    let mut container = CompoundFile::open(BufReader::new(file)).map_err(damaged)?;
    let name = ["Workbook", "Book"].into_iter().find(|name| container.is_stream(name));
    let mut stream = container.open_stream(name.unwrap_or("Workbook")).map_err(damaged)?;
    budget.claim(stream.len().saturating_mul(OF_BYTE))?;
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).map_err(damaged)?;
    // Several sheets may have the same place, whose cells are then read as often.
    let mut sheets: BTreeMap<usize, u64> = BTreeMap::new();
    for (kind, data) in Records(&bytes) {
        if kind == BOUND_SHEET
            && let Some(place) = data.first_chunk()
        {
            *sheets.entry(u32::from_le_bytes(*place) as usize).or_default() += 1;
        }
    }
    for (place, times) in sheets {
        let claimed = of_sheet(bytes.get(place..).unwrap_or_default());
        budget.claim(claimed.saturating_mul(times))?;
    }
    Ok(())
}

/// Returns the memory of the sheet that begins the stream.
fn of_sheet(stream: &[u8]) -> u64 {
    let mut rectangle = Rectangle::default();
    let (mut cells, mut reserved, mut depth) = (0_u64, 0_u64, 0);
    for (kind, data) in Records(stream) {
        let number = |place: usize| match data.get(place..place + 2) {
            Some(bytes) => u64::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            None => 0,
        };
        match kind {
            BEGIN => depth += 1,
            END if depth <= 1 => break,
            END => depth -= 1,
            DIMENSIONS if data.len() >= 14 => {
                let wide = |place: usize| number(place) + (number(place + 2) << 16);
                let columns = number(10).max(number(8)) + 1;
                reserved = reserved.max((wide(4).max(wide(0)) + 1).saturating_mul(columns));
            }
            DIMENSIONS => {
                let (rows, columns) = (number(2).max(number(0)) + 1, number(6).max(number(4)) + 1);
                reserved = reserved.max(rows * columns);
            }
            SEVERAL_NUMBERS if data.len() >= 6 => {
                let last = number(data.len() - 2).max(number(2));
                rectangle.include([number(0), number(2)], [1, last - number(2) + 1]);
                cells += last - number(2) + 1;
            }
            kind if CELLS.contains(&kind) => {
                rectangle.include([number(0), number(2)], [1, 1]);
                cells += 1;
            }
            _ => {}
        }
    }
    let cells = cells.max(reserved).saturating_mul(OF_CELL);
    cells.saturating_add(rectangle.memory())
}

/// Records of a stream: kind and data.
struct Records<'a>(&'a [u8]);

impl<'a> Iterator for Records<'a> {
    type Item = (u16, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let ([kind, kind_high, length, length_high], rest) = self.0.split_first_chunk()?;
        let length = usize::from(u16::from_le_bytes([*length, *length_high]));
        let (data, rest) = rest.split_at_checked(length)?;
        self.0 = rest;
        Some((u16::from_le_bytes([*kind, *kind_high]), data))
    }
}

/// Writes an Excel file with one sheet of these records, each with a kind and data.
#[cfg(test)]
pub(super) fn written(records: &[(u16, &[u8])]) -> Vec<u8> {
    use std::io::{Cursor, Write};
    let record = |kind: u16, data: &[u8]| {
        let head = [kind.to_le_bytes(), (data.len() as u16).to_le_bytes()].concat();
        [&head[..], data].concat()
    };
    let begin = record(BEGIN, &[0, 6, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    let bound = |place: u32| record(BOUND_SHEET, &[&place.to_le_bytes()[..], &[0, 0, 1, 0, b'a']].concat());
    let place = (begin.len() + bound(0).len() + record(END, &[]).len()) as u32;
    let mut stream = [begin.clone(), bound(place), record(END, &[]), begin].concat();
    for (kind, data) in records {
        stream.extend(record(*kind, data));
    }
    stream.extend(record(END, &[]));
    let mut container = CompoundFile::create_with_version(cfb::Version::V3, Cursor::new(Vec::new())).unwrap();
    container.create_stream("Workbook").unwrap().write_all(&stream).unwrap();
    container.into_inner().into_inner()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn claimed(bytes: &[u8], limit: u64) -> Result<(), TableError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.xls");
        fs::write(&path, bytes).unwrap();
        claim(&File::open(path).unwrap(), &mut ReadingBudget::of(limit, true))
    }

    #[test]
    fn far_cells_large_dimensions_and_cycles_of_sectors_are_refused() {
        let cell = |row: u16, column: u16| {
            let place = [row.to_le_bytes(), column.to_le_bytes(), [0; 2]].concat();
            [place, 1.5_f64.to_le_bytes().to_vec()].concat()
        };
        let limit = 1_000_000_000;
        let near = written(&[(0x0203, &cell(0, 0)), (0x0203, &cell(99, 9))]);
        assert!(claimed(&near, limit).is_ok());
        let far = written(&[(0x0203, &cell(0, 0)), (0x0203, &cell(65_535, 65_535))]);
        assert!(matches!(claimed(&far, limit), Err(TableError::OverBudget(_))));
        let dimensions = [0, 0, 0, 0, 0xff, 0xff, 0xff, 0xff, 0, 0, 0xff, 0, 0, 0];
        let large = written(&[(DIMENSIONS, &dimensions)]);
        assert!(matches!(claimed(&large, limit), Err(TableError::OverBudget(_))));
        let several = [&[0, 0, 0, 0][..], &[0; 6], &[0xff, 0xff]].concat();
        assert!(claimed(&written(&[(SEVERAL_NUMBERS, &several)]), 100_000).is_err());
        // The directory, whose first sector follows itself.
        let mut cycle = near;
        let directory = u32::from_le_bytes([cycle[48], cycle[49], cycle[50], cycle[51]]);
        let table = u32::from_le_bytes([cycle[76], cycle[77], cycle[78], cycle[79]]) as usize;
        let entry = 512 * (table + 1) + 4 * directory as usize;
        cycle[entry..entry + 4].copy_from_slice(&directory.to_le_bytes());
        let error = claimed(&cycle, limit).unwrap_err().to_string();
        assert!(error.contains("save it again"), "{error}");
    }
}
