use std::ops::Range;

use super::Separator;

/// Cells of a row of text; the buffers are reused, so that rows of similar length need no allocation.
#[derive(Debug, Default)]
pub(super) struct Fields {
    separator: Separator,
    /// Maximum number of cells; one more is found, so that a longer row is noticed.
    limit: Option<usize>,
    /// Text of the cells, without quotes and separators.
    text: Vec<u8>,
    ranges: Vec<Range<usize>>,
}

impl Fields {
    pub(super) fn new(separator: Separator, limit: Option<usize>) -> Self {
        Self {
            separator,
            limit,
            ..Self::default()
        }
    }

    /// Splits a row without its line break. Quotes enclose a cell only from its start, and a doubled one is part of it.
    pub(super) fn split(&mut self, row: &[u8]) {
        self.ranges.clear();
        self.text.clear();
        let (separator, has_spaces) = (self.separator.byte(), self.separator == Separator::Space);
        let (mut start, mut is_quoted) = (0, false);
        let mut bytes = row.iter().copied().peekable();
        while let Some(byte) = bytes.next() {
            let is_separator = byte == separator || (has_spaces && byte.is_ascii_whitespace());
            match byte {
                b'"' if is_quoted && bytes.next_if_eq(&b'"').is_none() => is_quoted = false,
                b'"' if !is_quoted && self.text.len() == start => is_quoted = true,
                _ if is_quoted || !is_separator => self.text.push(byte),
                _ => start = self.end_cell(start),
            }
            if self.limit.is_some_and(|limit| self.ranges.len() > limit) {
                return;
            }
        }
        self.end_cell(start);
    }

    /// Ends a cell, unless it is nothing between two spaces; returns the start of the next.
    fn end_cell(&mut self, start: usize) -> usize {
        let end = self.text.len();
        if self.separator != Separator::Space || end > start {
            self.ranges.push(start..end);
        }
        end
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
