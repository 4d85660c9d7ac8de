use std::ops::Range;

use csv_core::{ReadRecordResult, Reader, ReaderBuilder};

use super::Separator;

/// Cells of a row of text; the buffers are reused, so that rows of similar length need no allocation.
#[derive(Debug)]
pub(super) struct Fields {
    separator: Separator,
    /// Maximum number of cells; one more is found, so that a longer row is noticed.
    limit: Option<usize>,
    parser: Reader,
    /// Text of the row; without quotes and separators, if it has quotes.
    text: Vec<u8>,
    ends: Vec<usize>,
    ranges: Vec<Range<usize>>,
}

impl Default for Fields {
    fn default() -> Self {
        Self::new(Separator::Comma, None)
    }
}

impl Fields {
    pub(super) fn new(separator: Separator, limit: Option<usize>) -> Self {
        Self {
            separator,
            limit,
            parser: ReaderBuilder::new().delimiter(separator.byte()).build(),
            text: Vec::new(),
            ends: Vec::new(),
            ranges: Vec::new(),
        }
    }

    /// Splits a row without its line break.
    pub(super) fn split(&mut self, row: &[u8]) {
        self.ranges.clear();
        let separator = self.separator.byte();
        let is_spaced = self.separator == Separator::Space;
        match (row.contains(&b'"'), is_spaced) {
            (true, _) => self.split_quoted(row),
            (false, true) => self.split_at(row, |byte| byte == separator || byte.is_ascii_whitespace()),
            (false, false) => self.split_at(row, |byte| byte == separator),
        }
        if is_spaced {
            self.ranges.retain(|range| !range.is_empty());
        }
    }

    fn split_at(&mut self, row: &[u8], is_separator: impl Fn(u8) -> bool) {
        self.text.clear();
        self.text.extend_from_slice(row);
        let mut start = 0;
        for (place, &byte) in row.iter().enumerate() {
            if is_separator(byte) {
                self.ranges.push(start..place);
                start = place + 1;
                if self.limit.is_some_and(|limit| self.ranges.len() > limit) {
                    return;
                }
            }
        }
        self.ranges.push(start..row.len());
    }

    fn split_quoted(&mut self, row: &[u8]) {
        self.parser.reset();
        // The text of the cells is never longer than the row.
        self.text.resize(self.text.len().max(row.len() + 1), 0);
        let (mut rest, mut written, mut count) = (row, 0, 0);
        loop {
            let (text, ends) = (&mut self.text[written..], &mut self.ends[count..]);
            let (result, read, copied, found) = self.parser.read_record(rest, text, ends);
            rest = &rest[read..];
            written += copied;
            count += found;
            match result {
                // The parser treats empty input as the end of the record.
                ReadRecordResult::InputEmpty => {}
                ReadRecordResult::OutputEndsFull if self.limit.is_none_or(|limit| count <= limit) => {
                    self.ends.resize(2 * count + 8, 0);
                }
                _ => break,
            }
        }
        let starts = std::iter::once(&0).chain(&self.ends);
        let ranges = starts.zip(&self.ends[..count]).map(|(&start, &end)| start..end);
        self.ranges.extend(ranges);
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.ranges.len()
    }

    /// Cells of the row, without surrounding spaces.
    pub(super) fn iter(&self) -> impl DoubleEndedIterator<Item = &[u8]> + Clone {
        self.ranges.iter().map(|range| self.text[range.clone()].trim_ascii())
    }

    /// Cell with this index; empty if there are not this many.
    pub(super) fn get(&self, index: usize) -> &[u8] {
        let range = self.ranges.get(index).cloned().unwrap_or_default();
        self.text[range].trim_ascii()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_split_as_by_the_csv_crate() {
        let long = format!("\"{}\",{}", "x".repeat(5000), "1,".repeat(500));
        let mut fields = Fields::new(Separator::Comma, None);
        for line in [
            "1.5, 2 ,3",
            "a",
            "\"a, b\",\"say \"\"yes\"\"\",",
            ",,",
            long.as_str(),
            "\"unbalanced,1",
            "1\"2,3",
        ] {
            fields.split(line.as_bytes());
            let mut record = csv::ByteRecord::new();
            let mut reader = csv::ReaderBuilder::new()
                .has_headers(false)
                .from_reader(line.as_bytes());
            assert!(reader.read_byte_record(&mut record).unwrap());
            record.trim();
            assert!(fields.iter().eq(&record), "{line}");
        }
    }

    #[test]
    fn a_row_is_split_up_to_one_cell_beyond_the_limit() {
        for row in [",".repeat(1000), "\"\",".repeat(1000)] {
            let mut fields = Fields::new(Separator::Comma, Some(20));
            fields.split(row.as_bytes());
            assert!(fields.len() > 20 && fields.len() < 100, "{}", fields.len());
        }
    }
}
