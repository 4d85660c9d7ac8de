use decoupler_core::text::Named;

use super::{
    Decimal, Dialect, DialectChoice, Encoding, Separator, TableError,
    dialect::utf8_of_utf16,
    format::{Cell, parse},
    rows::{Rows, commonest},
    time_stamp::TimeStamp,
};

/// Number of bytes from which the layout is detected.
pub(super) const BEGINNING: usize = 1 << 18;
/// Number of rows from which the layout is detected.
const MAX_ROWS: usize = 500;

/// Detects the layout of a file from its `beginning`; `is_whole` if nothing follows.
///
/// Of all pairs of separator and decimal separator, the one is chosen with which most cells, in rows of the most common
/// length, are numbers; ties go to the pair with most cells. The first row contains names if at least half of its cells are
/// not numbers and at least one of them is above a column of numbers.
pub(super) fn detect(beginning: &[u8], is_whole: bool, choice: &DialectChoice) -> Result<Dialect, TableError> {
    let encoding = choice.encoding.unwrap_or_else(|| encoding(beginning));
    let decoded;
    let text = match encoding {
        Encoding::Utf8 | Encoding::Latin1 => beginning,
        Encoding::Utf16Le | Encoding::Utf16Be => {
            decoded = decode(beginning, encoding == Encoding::Utf16Le)?;
            &decoded
        }
    };
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let carriage_returns = text.contains(&b'\r') && !text.contains(&b'\n');
    let line_break = if carriage_returns { b'\r' } else { b'\n' };
    let declared = sep_line(text, line_break);
    let skipped_lines = choice.skip_lines.unwrap_or(0);
    let skipped = skipped_lines + usize::from(declared.is_some());
    let table = rest_after(text, line_break, skipped);
    // The last row may be truncated.
    let end = table.iter().rposition(|&byte| byte == line_break);
    let table = if is_whole {
        table
    } else {
        end.map_or(table, |end| &table[..=end])
    };
    let separators = match choice.separator.or(declared) {
        Some(separator) => vec![separator],
        None => Separator::ALL.to_vec(),
    };
    let mut best: Option<(Score, Separator, Decimal, Vec<Vec<Cell>>)> = None;
    let mut defect = None;
    for separator in separators {
        let decimals = match choice.decimal {
            Some(decimal) => vec![decimal],
            None if separator == Separator::Comma => vec![Decimal::Point],
            None => vec![Decimal::Point, Decimal::Comma],
        };
        for decimal in decimals {
            match sample(table, separator, decimal, carriage_returns) {
                Ok(rows) => {
                    let score = Score::of(&rows);
                    if best.as_ref().is_none_or(|(best, ..)| score.is_better_than(best)) {
                        best = Some((score, separator, decimal, rows));
                    }
                }
                Err(error) => defect = Some(error),
            }
        }
    }
    let Some((score, separator, decimal, rows)) = best else {
        return Err(defect.unwrap_or(TableError::Empty));
    };
    if rows.is_empty() {
        return Err(TableError::Empty);
    }
    let header = choice.header.unwrap_or_else(|| has_names(&rows));
    Ok(Dialect {
        encoding,
        separator,
        decimal,
        header,
        trailing_separator: separator != Separator::Space && score.width > 1 && ends_empty(&rows, score.width),
        sep_line: declared.is_some(),
        skipped_lines,
        carriage_returns,
    })
}

/// Score of a pair of separators.
struct Score {
    /// Most common number of cells in a row.
    width: usize,
    /// Fraction of the rows with that number of cells.
    regular: f64,
    /// Fraction of the cells of these rows, except the first row, that are numbers or missing.
    numeric: f64,
}

impl Score {
    fn of(rows: &[Vec<Cell>]) -> Self {
        let (width, count) = commonest(rows.iter().map(Vec::len));
        let body = rows
            .iter()
            .skip(usize::from(rows.len() > 1))
            .filter(|row| row.len() == width);
        let cells: Vec<Cell> = body.flatten().copied().collect();
        let numbers = cells.iter().filter(|cell| matches!(cell, Cell::Number(_))).count();
        let missing = cells.iter().filter(|cell| **cell == Cell::Missing).count();
        Self {
            width,
            regular: count as f64 / rows.len().max(1) as f64,
            // A table of empty cells is not a table of numbers.
            numeric: (numbers as f64 + 0.9 * missing as f64) / cells.len().max(1) as f64,
        }
    }

    fn is_better_than(&self, other: &Self) -> bool {
        let merit = |score: &Self| score.numeric * score.regular + if score.width > 1 { 0.3 } else { 0.0 };
        let (ours, theirs) = (merit(self), merit(other));
        ours > theirs + 1e-9 || (ours > theirs - 1e-9 && self.width > other.width)
    }
}

/// Cells of the first rows.
fn sample(text: &[u8], separator: Separator, decimal: Decimal, crs: bool) -> Result<Vec<Vec<Cell>>, TableError> {
    let mut rows = Rows::new(text, separator, crs);
    let mut sample = Vec::new();
    while sample.len() < MAX_ROWS {
        match rows.advance() {
            Ok(true) => sample.push(rows.cells().map(|cell| parse_or_stamp(cell, decimal)).collect()),
            Ok(false) => break,
            // The closing quote may lie beyond the beginning.
            Err(TableError::Quote { .. }) if !sample.is_empty() => break,
            Err(error) => return Err(error),
        }
    }
    Ok(sample)
}

/// Parses a cell; a time stamp counts as a number.
fn parse_or_stamp(cell: &[u8], decimal: Decimal) -> Cell {
    match parse(cell, decimal) {
        Cell::Text if TimeStamp::parse(cell).is_some() => Cell::Number(0.0),
        found => found,
    }
}

fn has_names(rows: &[Vec<Cell>]) -> bool {
    let Some((first, body)) = rows.split_first() else {
        return false;
    };
    let is_text = |cell: &&Cell| **cell == Cell::Text;
    let texts = first.iter().filter(is_text).count();
    let filled = first.iter().filter(|cell| **cell != Cell::Missing).count();
    if texts == 0 || 2 * texts < filled {
        return false;
    }
    let is_number = |column: usize| {
        let cells = || body.iter().filter_map(|row| row.get(column));
        let numbers = cells().filter(|cell| matches!(cell, Cell::Number(_))).count();
        numbers > 0 && 2 * numbers >= cells().count()
    };
    body.is_empty() || (0..first.len()).any(|column| first[column] == Cell::Text && is_number(column))
}

fn ends_empty(rows: &[Vec<Cell>], width: usize) -> bool {
    rows.iter()
        .filter(|row| row.len() == width)
        .all(|row| row[width - 1] == Cell::Missing)
}

fn encoding(beginning: &[u8]) -> Encoding {
    let even = |offset: usize| {
        let bytes = beginning.iter().skip(offset).step_by(2).take(200);
        let (zeros, count) = bytes.fold((0, 0), |(zeros, count), byte| {
            (zeros + usize::from(*byte == 0), count + 1)
        });
        count > 2 && 10 * zeros > 7 * count
    };
    match beginning {
        [0xff, 0xfe, ..] => Encoding::Utf16Le,
        [0xfe, 0xff, ..] => Encoding::Utf16Be,
        _ if even(1) && !even(0) => Encoding::Utf16Le,
        _ if even(0) && !even(1) => Encoding::Utf16Be,
        _ => match std::str::from_utf8(beginning) {
            Ok(_) => Encoding::Utf8,
            // The last character of the beginning may be truncated.
            Err(error) if error.error_len().is_none() => Encoding::Utf8,
            Err(_) => Encoding::Latin1,
        },
    }
}

fn decode(bytes: &[u8], is_little_endian: bool) -> Result<Vec<u8>, TableError> {
    let mut text = Vec::new();
    std::io::Read::read_to_end(&mut utf8_of_utf16(bytes, is_little_endian), &mut text)?;
    Ok(text)
}

/// Returns the separator given by a first line `sep=`.
fn sep_line(text: &[u8], line_break: u8) -> Option<Separator> {
    let line = text.split(|&byte| byte == line_break).next()?;
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    let line = line
        .strip_prefix(b"\"")
        .and_then(|line| line.strip_suffix(b"\""))
        .unwrap_or(line);
    let (name, character) = line.split_at_checked(4)?;
    if !name.eq_ignore_ascii_case(b"sep=") {
        return None;
    }
    Separator::of_character(character)
}

fn rest_after(text: &[u8], line_break: u8, lines: usize) -> &[u8] {
    let mut rest = text;
    for _ in 0..lines {
        let Some(end) = rest.iter().position(|&byte| byte == line_break) else {
            return &[];
        };
        rest = &rest[end + 1..];
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &[u8]) -> String {
        detect(text, true, &DialectChoice::default()).unwrap().to_string()
    }

    #[test]
    fn layouts_are_detected() {
        let cases = [
            ("1,2,3\n4,5,6\n", "separator comma, decimal point, no header, utf-8"),
            ("t,x\n1,2.5\n", "separator comma, decimal point, a header, utf-8"),
            (
                "1,5;2,5\n3,5;4\n",
                "separator semicolon, decimal comma, no header, utf-8",
            ),
            ("a;b\n1,5;2,5\n", "separator semicolon, decimal comma, a header, utf-8"),
            (
                "x\ty\n1,5\t2,5\n3\t4\n",
                "separator tab, decimal comma, a header, utf-8",
            ),
            ("1|2\n3|4\n", "separator bar, decimal point, no header, utf-8"),
            ("1.0e0 2.0e0\n3 4\n", "separator space, decimal point, no header, utf-8"),
            ("1.5\n2.5\n", "separator comma, decimal point, no header, utf-8"),
            (
                "sep=;\r\na;b;\r\n1;2;\r\n",
                "separator semicolon, decimal point, a header, utf-8, a sep= line, a separator at the end of each row",
            ),
            (
                "a,b\r1,2\r3,4\r",
                "separator comma, decimal point, a header, utf-8, lines end with CR",
            ),
            // A missing value among numbers is not a name.
            (
                "0.1,NA,3\n0.2,1,3\n",
                "separator comma, decimal point, no header, utf-8",
            ),
            // Text next to numbers in every row.
            ("A,1,2\nB,3,4\n", "separator comma, decimal point, no header, utf-8"),
            (
                "\"time (s)\",\"x, mm\"\n1,2\n",
                "separator comma, decimal point, a header, utf-8",
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(found(text.as_bytes()), expected, "{text:?}");
        }
        assert!(found(b"x (\xb5T);y\n1;2\n").ends_with("latin-1"));
        let utf16: Vec<u8> = "\u{feff}x;y\n1,5;2\n"
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect();
        assert_eq!(found(&utf16), "separator semicolon, decimal comma, a header, utf-16le");
        assert_eq!(
            found(&utf16[2..]),
            "separator semicolon, decimal comma, a header, utf-16le"
        );
    }

    #[test]
    fn given_choices_override_detection() {
        let choice = DialectChoice {
            separator: Some(Separator::Comma),
            header: Some(true),
            skip_lines: Some(1),
            ..DialectChoice::default()
        };
        let dialect = detect(b"a;b;c\n1,2\n3,4\n", true, &choice).unwrap();
        assert_eq!(
            (dialect.separator, dialect.header, dialect.skipped_lines),
            (Separator::Comma, true, 1)
        );
    }

    #[test]
    fn empty_and_binary_files_are_refused() {
        for text in ["", "\n\n", "\u{feff}", "sep=;\n"] {
            let error = detect(text.as_bytes(), true, &DialectChoice::default()).unwrap_err();
            assert!(matches!(error, TableError::Empty), "{text:?}: {error}");
        }
        let error = detect(b"1,2\n\0\x01\x02\x03,\n", true, &DialectChoice::default()).unwrap_err();
        assert_eq!(
            error.to_string().split(';').next(),
            Some("it is not text: line 2 contains a zero byte")
        );
    }
}
