use std::io::{BufRead, BufReader, Read};

use super::{Format, Separator, TableError, fields::Fields};

/// Maximum length of a row in bytes: 16 MiB, enough for more than ten thousand columns.
pub(super) const LONGEST_ROW: usize = 1 << 24;
/// Maximum number of cells in a row.
pub(super) const MAX_CELLS: usize = 20_000;
const BUFFER: usize = 1 << 18;

/// Rows of a text file, split into cells and with their line numbers. A row may span several lines if the line breaks are
/// quoted.
pub(super) struct Rows<R> {
    source: BufReader<R>,
    fields: Fields,
    /// Maximum length of a row in bytes, and of blank lines before it.
    pub(super) longest: usize,
    line_break: u8,
    /// Text of the current row, without its line break.
    pub(super) text: Vec<u8>,
    /// `true` if the current row ends with a line break.
    pub(super) is_ended: bool,
    /// Line on which the current row starts, from 1.
    pub(super) line: u64,
    /// Number of lines read.
    lines: u64,
}

impl<R: Read> Rows<R> {
    pub(super) fn new(source: R, separator: Separator, has_carriage_returns: bool) -> Self {
        Self {
            source: BufReader::with_capacity(BUFFER, source),
            fields: Fields::new(separator, Some(MAX_CELLS)),
            longest: LONGEST_ROW,
            line_break: if has_carriage_returns { b'\r' } else { b'\n' },
            text: Vec::new(),
            is_ended: false,
            line: 0,
            lines: 0,
        }
    }

    /// Skips `lines` lines.
    pub(super) fn skip(&mut self, lines: usize) -> Result<(), TableError> {
        for _ in 0..lines {
            self.text.clear();
            self.line = self.lines + 1;
            if !self.append_line()? {
                break;
            }
        }
        Ok(())
    }

    /// Advances to the next row that is not blank, and splits it; returns `false` at the end.
    pub(super) fn advance(&mut self) -> Result<bool, TableError> {
        if !self.next_text()? {
            return Ok(false);
        }
        self.fields.split(&self.text);
        if self.fields.len() > MAX_CELLS {
            let reason = format_args!("more than {MAX_CELLS} cells in a row; check the separator");
            return Err(TableError::in_row(self.line, reason));
        }
        Ok(true)
    }

    /// Advances to the [text](Self::text) of the next row that is not blank; returns `false` at the end.
    pub(super) fn next_text(&mut self) -> Result<bool, TableError> {
        let mut blank = 0;
        loop {
            self.text.clear();
            self.line = self.lines + 1;
            if !self.append_line()? {
                return Ok(false);
            }
            // Spaces only: an empty cell between tabs is a cell.
            if self.text.iter().all(|byte| b" \r\n".contains(byte)) {
                blank += self.text.len();
                if blank > self.longest {
                    return Err(self.endless());
                }
                continue;
            }
            let mut quotes = count_quotes(&self.text);
            while !quotes.is_multiple_of(2) {
                let before = self.text.len();
                if !self.append_line()? {
                    return Err(TableError::Quote(self.line));
                }
                quotes += count_quotes(&self.text[before..]);
            }
            self.is_ended = self.text.last() == Some(&self.line_break);
            while self.text.last().is_some_and(|byte| b"\r\n".contains(byte)) {
                self.text.pop();
            }
            return Ok(true);
        }
    }

    fn endless(&self) -> TableError {
        let limit = self.longest >> 20;
        let reason = format_args!("no row ends within {limit} MiB; check its quotes and line breaks");
        TableError::in_row(self.line, reason)
    }

    /// Appends the next line to the text; returns `false` at the end.
    fn append_line(&mut self) -> Result<bool, TableError> {
        let left = self.longest.saturating_sub(self.text.len());
        let mut limited = (&mut self.source).take(left as u64 + 1);
        let read = limited.read_until(self.line_break, &mut self.text)?;
        if read > left {
            return Err(self.endless());
        }
        self.lines += u64::from(read > 0);
        let start = self.text.len() - read;
        if self.text[start..].contains(&0) {
            let (line, names) = (self.lines, Format::NAMES);
            let reason = format!("it is not text: line {line} contains a zero byte; give {names}");
            return Err(TableError::Contents(reason));
        }
        Ok(read > 0)
    }

    /// Number of cells in the current row.
    pub(super) fn len(&self) -> usize {
        self.fields.len()
    }

    /// Cells of the current row, without surrounding spaces.
    pub(super) fn cells(&self) -> impl DoubleEndedIterator<Item = &[u8]> + Clone {
        self.fields.iter()
    }
}

/// Returns the most common number of cells of a row, and how often it occurs.
pub(super) fn commonest(widths: impl Iterator<Item = usize>) -> (usize, usize) {
    let mut widths: Vec<usize> = widths.collect();
    widths.sort_unstable();
    let runs = widths.chunk_by(|a, b| a == b);
    runs.max_by_key(|run| run.len())
        .map_or((0, 0), |run| (run[0], run.len()))
}

fn count_quotes(text: &[u8]) -> usize {
    text.iter().filter(|&&byte| byte == b'"').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str, separator: Separator) -> Vec<(u64, Vec<String>)> {
        let mut rows = Rows::new(text.as_bytes(), separator, false);
        let mut all = Vec::new();
        while rows.advance().unwrap() {
            let cells = rows.cells().map(|cell| String::from_utf8_lossy(cell).into_owned());
            all.push((rows.line, cells.collect()));
        }
        all
    }

    #[test]
    fn rows_are_split_as_by_the_csv_crate_with_line_numbers() {
        let text = "a, \"b\nc\" ,d\r\n\r\n1,\"say \"\"yes\"\"\",\n  \n,,\n\"x,y\",2\n3";
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(
                // The quotes are no longer at the start of their cell.
                "a,\"b\nc\",d\n1,\"say \"\"yes\"\"\",\n,,\n\"x,y\",2\n3".as_bytes(),
            );
        let expected: Vec<Vec<String>> = reader
            .records()
            .map(|record| record.unwrap().iter().map(str::to_owned).collect())
            .collect();
        let found = rows(&text.replace(" \"b", "\"b").replace("c\" ", "c\""), Separator::Comma);
        assert_eq!(
            found.iter().map(|(_, cells)| cells.clone()).collect::<Vec<_>>(),
            expected
        );
        assert_eq!(found.iter().map(|(line, _)| *line).collect::<Vec<_>>(), [1, 4, 6, 7, 8]);
    }

    #[test]
    fn any_number_of_spaces_separates_two_cells() {
        let found = rows("  1   2\t3 \n \"a b\"  4\n", Separator::Space);
        assert_eq!(found[0].1, ["1", "2", "3"]);
        assert_eq!(found[1].1, ["a b", "4"]);
    }

    #[test]
    fn an_unclosed_quote_does_not_exhaust_memory() {
        let text = format!("1,\"2\n{}", "3,4\n".repeat(5_000_000));
        let mut rows = Rows::new(text.as_bytes(), Separator::Comma, false);
        let error = rows.advance().unwrap_err().to_string();
        assert!(error.contains("line 1") && error.contains("16 MiB"), "{error}");
    }

    #[test]
    fn endless_rows_are_refused() {
        for byte in [b'1', b'\n', b',', b'"', 0, 255] {
            let mut rows = Rows::new(std::io::repeat(byte), Separator::Comma, false);
            assert!(rows.advance().is_err(), "{byte}");
        }
    }
}
