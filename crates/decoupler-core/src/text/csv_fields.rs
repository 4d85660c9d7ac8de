use csv_core::{ReadRecordResult, Reader};

/// Fields of one line of CSV, kept between lines so that none allocates.
#[derive(Debug)]
pub struct CsvFields {
    parser: Reader,
    text: Vec<u8>,
    /// End of each field in `text`.
    ends: Vec<usize>,
    count: usize,
}

impl Default for CsvFields {
    fn default() -> Self {
        Self {
            // `Reader::default` has no tables.
            parser: Reader::new(),
            text: Vec::new(),
            ends: Vec::new(),
            count: 0,
        }
    }
}

impl CsvFields {
    /// Splits a line without its line break.
    pub fn split(&mut self, line: &[u8]) {
        self.parser.reset();
        // Lines of like lengths need no further room.
        self.text.resize(self.text.len().max(line.len().next_power_of_two()), 0);
        let (mut rest, mut written) = (line, 0);
        self.count = 0;
        loop {
            let (result, read, text, ends) =
                self.parser
                    .read_record(rest, &mut self.text[written..], &mut self.ends[self.count..]);
            rest = &rest[read..];
            written += text;
            self.count += ends;
            match result {
                // The parser takes the empty rest for the end of the record.
                ReadRecordResult::InputEmpty => {}
                ReadRecordResult::OutputFull => self.text.resize(2 * self.text.len() + 1, 0),
                ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len() + 8, 0),
                ReadRecordResult::Record | ReadRecordResult::End => break,
            }
        }
    }

    /// Number of fields.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Field with this index, without surrounding spaces.
    ///
    /// # Panics
    /// If there are not this many fields.
    pub fn get(&self, index: usize) -> &[u8] {
        let ends = &self.ends[..self.count];
        let start = if index == 0 { 0 } else { ends[index - 1] };
        self.text[start..ends[index]].trim_ascii()
    }

    /// Iterates over the fields of the line.
    pub fn iter(&self) -> impl Iterator<Item = &[u8]> {
        (0..self.count).map(|index| self.get(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_split_as_by_the_csv_crate() {
        let long = format!("\"{}\",{}", "x".repeat(5000), "1,".repeat(500));
        let mut fields = CsvFields::default();
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
}
