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
    /// Text of the cells of a row with quotes.
    unquoted: Vec<u8>,
    has_quotes: bool,
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
            unquoted: Vec::new(),
            has_quotes: false,
            ends: Vec::new(),
            ranges: Vec::new(),
        }
    }

    /// Splits a row without its line break.
    pub(super) fn split(&mut self, text: &[u8]) {
        self.ranges.clear();
        self.has_quotes = text.contains(&b'"');
        if self.has_quotes {
            self.split_quoted(text);
            return;
        }
        let separator = self.separator.byte();
        match self.separator {
            Separator::Space => {
                self.split_at(text, |byte| byte == separator || byte.is_ascii_whitespace());
                self.ranges.retain(|range| !range.is_empty());
            }
            _ => self.split_at(text, |byte| byte == separator),
        }
    }

    fn split_at(&mut self, text: &[u8], is_separator: impl Fn(u8) -> bool) {
        let mut start = 0;
        for (place, &byte) in text.iter().enumerate() {
            if is_separator(byte) {
                self.ranges.push(start..place);
                start = place + 1;
                if self.limit.is_some_and(|limit| self.ranges.len() > limit) {
                    return;
                }
            }
        }
        self.ranges.push(start..text.len());
    }

    fn split_quoted(&mut self, text: &[u8]) {
        self.parser.reset();
        // The text of the cells is never longer than the row.
        self.unquoted.resize(self.unquoted.len().max(text.len() + 1), 0);
        let (mut rest, mut written, mut count) = (text, 0, 0);
        loop {
            let (unquoted, ends) = (&mut self.unquoted[written..], &mut self.ends[count..]);
            let (result, read, copied, found) = self.parser.read_record(rest, unquoted, ends);
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
        let mut start = 0;
        for &end in &self.ends[..count] {
            if self.separator != Separator::Space || end > start {
                self.ranges.push(start..end);
            }
            start = end;
        }
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.ranges.len()
    }

    /// Cells of the row `text`, which was split last, without surrounding spaces.
    pub(super) fn iter<'a>(&'a self, text: &'a [u8]) -> impl DoubleEndedIterator<Item = &'a [u8]> + Clone {
        let text = if self.has_quotes { &self.unquoted } else { text };
        self.ranges.iter().map(|range| text[range.clone()].trim_ascii())
    }

    /// Cell with this index, as from [`Self::iter`]; empty if there are not this many.
    pub(super) fn get<'a>(&'a self, text: &'a [u8], index: usize) -> &'a [u8] {
        let text = if self.has_quotes { &self.unquoted } else { text };
        let range = self.ranges.get(index).cloned().unwrap_or_default();
        text[range].trim_ascii()
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
            assert!(fields.iter(line.as_bytes()).eq(&record), "{line}");
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
