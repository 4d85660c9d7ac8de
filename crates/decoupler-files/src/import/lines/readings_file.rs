use std::io::Read;

use ndarray::Array2;

use super::{
    super::{Separator, TableError, rows::Rows},
    LONGEST_LINE, LineParser, ParsedLine,
};

/// File with the readings of an array, read block by block, so that a large file needs little memory.
pub struct ReadingsFile<R> {
    rows: Rows<R>,
    parser: LineParser,
    /// Number of the last line if it is cut off: malformed and without a line break. It is ignored, unless it is the only line
    /// with readings.
    pub torn_line: Option<u64>,
}

/// Block of the readings of row-wires.
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    /// Rows × M4, in ohm.
    pub values_ohm: Array2<f64>,
    /// Line of each row in the file, from 1.
    pub lines: Vec<u64>,
    /// Index of the row-wire of each row among those that are read; 0 if it is unknown.
    pub row_indices: Vec<usize>,
}

impl<R: Read> ReadingsFile<R> {
    /// Reads the lines of `source` by `parser`.
    pub fn new(source: R, parser: LineParser) -> Self {
        let mut rows = Rows::new(source, Separator::Comma, false);
        rows.longest = LONGEST_LINE;
        Self {
            rows,
            parser,
            torn_line: None,
        }
    }

    /// Number of lines so far whose row-wire follows from their order.
    pub fn lines_in_turn(&self) -> usize {
        self.parser.lines_in_turn.unwrap_or(0)
    }

    /// Reads at most `most` further lines; returns `None` at the end.
    ///
    /// # Errors
    /// If the file cannot be read, has no readings, or a line is malformed.
    pub fn read(&mut self, most: usize) -> Result<Option<Readings>, TableError> {
        let (mut values_ohm, mut lines, mut row_indices) = (Vec::new(), Vec::new(), Vec::new());
        let channels = self.parser.problem.inputs.len();
        let mut taken = 0;
        while taken < most && self.torn_line.is_none() && self.rows.next_text()? {
            let (line, has_readings) = (self.rows.line, self.parser.has_readings);
            let (first_row, readings) = match self.parser.parse(line, &self.rows.text) {
                Ok(ParsedLine::NoReadings | ParsedLine::Start { .. }) => continue,
                Ok(ParsedLine::Row {
                    row_index, readings, ..
                }) => (row_index.unwrap_or(0), readings),
                Ok(ParsedLine::Snapshot(readings)) => (0, readings),
                Err(_) if has_readings && !self.rows.is_ended => {
                    self.torn_line = Some(line);
                    break;
                }
                Err(error) => return Err(TableError::Contents(error.to_string())),
            };
            let rows = readings.len() / channels;
            values_ohm.extend_from_slice(readings);
            lines.extend(std::iter::repeat_n(line, rows));
            row_indices.extend(first_row..first_row + rows);
            taken += 1;
        }
        if !self.parser.has_readings {
            return Err(TableError::Empty);
        }
        if lines.is_empty() {
            return Ok(None);
        }
        let shape = (lines.len(), channels);
        Ok(Some(Readings {
            values_ohm: Array2::from_shape_vec(shape, values_ohm).expect("every row has M4 readings"),
            lines,
            row_indices,
        }))
    }
}

#[cfg(test)]
mod tests {
    use decoupler_core::scene;
    use ndarray::array;

    use super::*;

    /// Reader of two readings of each of three row-wires.
    fn reader(text: &str, rows: scene::Rows) -> ReadingsFile<&[u8]> {
        ReadingsFile::new(
            text.as_bytes(),
            LineParser::of_array("3x1_1x2".parse().unwrap(), rows, true).unwrap(),
        )
    }

    fn read(text: &str) -> Result<Readings, TableError> {
        Ok(reader(text, scene::Rows::All).read(100)?.unwrap())
    }

    #[test]
    fn columns_are_found_by_name_or_order() {
        for text in [
            "1.5,2\n3,4e0\n",
            " 1.5 , 2\r\n3,4",
            "r_2,note,r_1\n2,\"a, b\",1.5\n4,,3\n",
            "\u{feff}r_1,r_2\n1.5,2\n\n3,4\n",
            "\u{feff}1.5,2\n3,4\n",
        ] {
            assert_eq!(read(text).unwrap().values_ohm, array![[1.5, 2.0], [3.0, 4.0]], "{text}");
        }
    }

    #[test]
    fn a_last_line_that_is_cut_off_is_ignored_and_reported() {
        for (text, rows, torn) in [
            ("r_1,r_2\n1,2\n3,4\n5", 2, Some(4)),
            ("1,2\n3,4\n5,", 2, Some(3)),
            ("1,2\n3,4\n5,6e-", 2, Some(3)),
            ("1,2\n3,4\n5,6", 3, None),
        ] {
            let mut reader = reader(text, scene::Rows::All);
            let mut lines = 0;
            while let Some(block) = reader.read(2).unwrap() {
                lines += block.lines.len();
            }
            assert_eq!((lines, reader.torn_line), (rows, torn), "{text}");
        }
        for refused in ["1,2\n3\n5,6", "1,2\n3\n", "r_1,r_2\n1"] {
            assert!(read(refused).is_err(), "{refused}");
        }
    }

    #[test]
    fn blocks_follow_each_other_without_gaps() {
        let text: String = (1..=7).map(|k| format!("{k},{k}.5\n")).collect();
        let mut reader = reader(&text, scene::Rows::All);
        let mut read = Vec::new();
        while let Some(block) = reader.read(3).unwrap() {
            read.extend(block.lines);
        }
        assert_eq!(read, [1, 2, 3, 4, 5, 6, 7]);
    }

    #[test]
    fn row_wires_come_from_their_column_from_whole_snapshots_or_from_the_order() {
        for text in ["row,r_1,r_2\n3,1,2\n1,1,2\n", "3,1,2\n1,1,2\n"] {
            let found = reader(text, scene::Rows::Known).read(100).unwrap().unwrap();
            assert_eq!((found.row_indices, found.lines.len()), (vec![2, 0], 2), "{text}");
        }
        for text in ["r_1,r_2\n1,2\n3,4\n5,6\n", "1,2\n3,4\n5,6\n", "1,2,3,4,5,6\n"] {
            let found = reader(text, scene::Rows::Known).read(100).unwrap().unwrap();
            assert_eq!(found.row_indices, [0, 1, 2], "{text}");
            assert_eq!(found.values_ohm, array![[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]], "{text}");
        }
        let refused = reader("row,r_1,r_2\n4,1,2\n", scene::Rows::Known)
            .read(100)
            .unwrap_err()
            .to_string();
        assert!(
            refused.contains("line 2, column 1: '4' is not a row-wire; give a number from 1 to 3"),
            "{refused}"
        );
    }

    #[test]
    fn errors_name_line_and_column() {
        let cases = [
            ("nothing", "", "no rows"),
            ("names only", "r_1,r_2\n", "no rows"),
            ("a channel too few", "r_1,b\n1,2\n", "no column 'r_2'"),
            ("other names", "a,b\n1,2\n", "no column 'r_1'"),
            ("a channel twice", "r_1,r_2,r_2\n", "two columns 'r_2'"),
            ("a short row", "r_1,r_2\n1,2\n3\n", "line 3: 1 cell where 2"),
            ("too many columns", "1,2,3,4\n", "line 1: 4 cells where 2"),
            (
                "semicolons",
                "r_1;r_2\n1;2\n",
                "line 1: 1 cell where 2 are needed, separated by commas",
            ),
            ("a word", "1,2\n3,many\n", "line 2, column 2: 'many'"),
            ("a word in the first row", "1,many\n", "line 1, column 2: 'many'"),
            ("NaN", "r_1,r_2\nNaN,1\n", "line 2, column 1: 'NaN'"),
            ("infinity", "1,inf\n", "column 2: 'inf'"),
            ("overflow", "1,1e999\n", "column 2: '1e999'"),
            ("negative", "1,-2\n", "column 2: '-2'"),
            ("zero", "0,2\n", "column 1: '0'"),
            ("empty", "r_1,r_2\n\n\n1,\n", "line 4, column 2: ''"),
            ("old line ends", "1,2\r3,4\r", "line 1: there is a line break"),
            ("not text", "1,\u{0}\u{1b}[2J\n", "line 1 contains a zero byte"),
            ("control characters", "1,\u{1b}[2J\n", "column 2: '\\u{1b}[2J'"),
        ];
        for (sentence, text, expected) in cases {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{sentence}: {message}");
        }
    }
}
