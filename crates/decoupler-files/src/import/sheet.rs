//! Sheets of Excel and OpenDocument files. A sheet is read as the text that a spreadsheet program saves as CSV, so that
//! headers, units, missing cells and time stamps mean the same in both.

use std::{
    fs::File,
    io::{BufReader, Cursor, Read, Seek},
    panic::{AssertUnwindSafe, catch_unwind},
    path::Path,
};

use calamine::{Cell, Data, DataRef, Ods, Range, Reader as _, Xlsx, XlsxError, open_workbook_from_rs};
use decoupler_core::text::clean_name;

use super::{
    Decimal, DialectChoice, Encoding, Format, Progress, Separator, Table, TableError, Watch,
    archive::for_each_entry,
    csv_table::{self, Reading},
    progress::Watched,
    sheet_claims::{LARGEST, OF_CELL, claim, extend, outside, rectangle},
};
use crate::{csv_row::csv_cell, machine::ReadingBudget};

/// Reads the sheet with most numbers of an Excel file, or of an OpenDocument file with `is_ods`.
///
/// # Errors
/// If the file is damaged or no sheet has cells.
pub(super) fn read(
    path: &Path,
    file: File,
    is_ods: bool,
    reading: &Reading<'_>,
    budget: &mut ReadingBudget,
    watch: Watch<'_>,
) -> Result<Table, TableError> {
    for_each_entry(BufReader::new(&file), watch, |name, size, part| {
        claim(BufReader::new(part), size, is_ods && name == "content.xml", budget)
    })?;
    (&file).rewind()?;
    let source = BufReader::new(file);
    // The reader of spreadsheets may panic on a file whose parts contradict each other.
    let read = catch_unwind(AssertUnwindSafe(|| {
        if is_ods {
            let mut workbook: Ods<_> = open_workbook_from_rs(source).map_err(damaged)?;
            let names = workbook.sheet_names();
            chosen(names, watch, |name| workbook.worksheet_range(name).map_err(damaged))
        } else {
            let mut workbook: Xlsx<_> = open_workbook_from_rs(source).map_err(damaged)?;
            chosen(workbook.sheet_names(), watch, |name| cells(&mut workbook, name, budget))
        }
    }));
    let (name, range, left_out) = read.unwrap_or_else(|_| {
        let reason = "its parts contradict each other; save it again, or as CSV";
        Err(TableError::damaged("the spreadsheet", reason))
    })?;
    if range.is_empty() {
        return Err(TableError::Empty);
    }
    let text = text_of(&range);
    drop(range);
    let size = text.len() as u64;
    let reading = Reading {
        choice: DialectChoice {
            encoding: Some(Encoding::Utf8),
            separator: Some(Separator::Comma),
            decimal: Some(Decimal::Point),
            ..reading.choice
        },
        ..reading.clone()
    };
    let text = Watched::new(Cursor::new(text), Some(size), watch);
    let mut table = csv_table::read(path, text, &reading, budget)?;
    table.notes.extend(left_out);
    table.format = Format::Sheet {
        name,
        header: table.has_header(),
    };
    Ok(table)
}

/// Reads all sheets, each by its name with `range_of`; no more than two are in memory at once. Returns the name and the cells of
/// the first of those with most numbers, and notes on the others that have cells.
fn chosen(
    names: Vec<String>,
    watch: Watch<'_>,
    mut range_of: impl FnMut(&str) -> Result<Range<Data>, TableError>,
) -> Result<(String, Range<Data>, Vec<String>), TableError> {
    let (mut chosen, mut most, mut left_out) = ((String::new(), Range::default()), None, Vec::new());
    for name in names {
        if watch(Progress { bytes: 0, of: None }).is_break() {
            return Err(TableError::Cancelled);
        }
        let mut sheet = (clean_name(&name), range_of(&name)?);
        let is_number = |cell: &(_, _, &Data)| matches!(cell.2, Data::Int(_) | Data::Float(_));
        let count = Some(sheet.1.used_cells().filter(is_number).count());
        if count > most {
            most = count;
            std::mem::swap(&mut chosen, &mut sheet);
        }
        let (name, range) = sheet;
        if !range.is_empty() {
            let (rows, width) = range.get_size();
            let cure = "save it as its own file to use it";
            left_out.push(format!("left out: sheet '{name}' is {rows} × {width}; {cure}"));
        }
    }
    Ok((chosen.0, chosen.1, left_out))
}

fn damaged(error: impl std::fmt::Display) -> TableError {
    TableError::array("spreadsheet", format_args!("{error}; save it again, or as CSV"))
}

/// Reads a sheet of an Excel file cell by cell: the reader of spreadsheets would allocate the whole rectangle between the first
/// and the last cell unasked.
fn cells<S: Read + Seek>(
    workbook: &mut Xlsx<S>,
    name: &str,
    budget: &mut ReadingBudget,
) -> Result<Range<Data>, TableError> {
    let mut reader = match workbook.worksheet_cells_reader(name) {
        Err(XlsxError::NotAWorksheet(_)) => return Ok(Range::default()),
        reader => reader.map_err(damaged)?,
    };
    let (mut cells, mut extent) = (Vec::new(), [0, 0]);
    while let Some(cell) = reader.next_cell().map_err(damaged)? {
        if matches!(cell.get_value(), DataRef::Empty) {
            continue;
        }
        let (row, column) = cell.get_position();
        let end = [row, column].map(|place| u64::from(place) + 1);
        if end[0] > LARGEST[0] || end[1] > LARGEST[1] {
            return Err(outside(&format!("{} of row {}", end[1], end[0])));
        }
        budget.claim(OF_CELL)?;
        extend(&mut extent, end);
        cells.push(Cell::new((row, column), Data::from(cell.get_value().clone())));
    }
    budget.claim(rectangle(extent))?;
    Ok(Range::from_sparse(cells))
}

/// Writes a sheet as CSV; its first line is row 1 of the sheet.
fn text_of(range: &Range<Data>) -> String {
    let before = range.start().map_or(0, |(row, _)| row as usize);
    let mut text = "\n".repeat(before);
    for row in range.rows() {
        let is_empty = row.iter().all(|cell| matches!(cell, Data::Empty));
        for (place, cell) in row.iter().enumerate().filter(|_| !is_empty) {
            if place > 0 {
                text.push(',');
            }
            write_cell(cell, &mut text);
        }
        text.push('\n');
    }
    text
}

fn write_cell(cell: &Data, text: &mut String) {
    let written = match cell {
        Data::Empty => return,
        Data::Bool(is_true) => u8::from(*is_true).to_string(),
        Data::Int(number) => number.to_string(),
        Data::Float(number) => number.to_string(),
        // A time of day or a duration, in days.
        Data::DateTime(moment) if moment.is_duration() || moment.as_f64() < 1.0 => {
            ((moment.as_f64() * 86_400e6).round() / 1e6).to_string()
        }
        Data::DateTime(moment) => {
            let (year, month, day, hour, minute, second, milli) = moment.to_ymd_hms_milli();
            format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{milli:03}")
        }
        Data::String(text) | Data::DateTimeIso(text) | Data::DurationIso(text) => text.clone(),
        Data::Error(error) => error.to_string(),
    };
    text.push_str(&csv_cell(&written));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_is_written_as_csv_with_its_row_numbers() {
        let mut range = Range::new((2, 1), (4, 2));
        range.set_value((2, 1), Data::String("force (N)".to_owned()));
        range.set_value((2, 2), Data::String("note, \"if any\"".to_owned()));
        range.set_value((4, 1), Data::Float(0.1));
        range.set_value((4, 2), Data::Bool(true));
        assert_eq!(text_of(&range), "\n\nforce (N),\"note, \"\"if any\"\"\"\n\n0.1,1\n");
    }
}
