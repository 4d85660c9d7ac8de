use decoupler_core::text::Named;

use super::{
    Decimal, Dialect, DialectChoice, Encoding, Separator, TableError,
    format::{Cell, parse},
    rows::{Rows, commonest},
    time_stamp::TimeStamp,
};

/// Number of bytes from which the layout is detected.
pub(super) const BEGINNING: usize = 1 << 18;
/// Number of rows from which the layout is detected.
const MAX_ROWS: usize = 500;

/// Detects the layout of a file from its `beginning` in UTF-8 or Latin-1; `is_whole` if nothing follows. Returns it with the
/// most common number of cells of a row, or 0 if no row ends within the beginning.
///
/// Of all pairs of separator and decimal separator, the one is chosen with which most cells, in rows of the most common
/// length, are numbers; ties go to the pair with most cells. The first row contains names if at least half of its cells are
/// not numbers and at least one of them is above a column of numbers.
pub(super) fn detect(
    text: &[u8],
    is_whole: bool,
    encoding: Encoding,
    choice: &DialectChoice,
) -> Result<(Dialect, usize), TableError> {
    let carriage_returns = text.contains(&b'\r') && !text.contains(&b'\n');
    let line_break = if carriage_returns { b'\r' } else { b'\n' };
    let declared = sep_line(text, line_break);
    let skipped_lines = choice.skip_lines.unwrap_or(0);
    let skipped = skipped_lines + usize::from(declared.is_some());
    let mut lines = text.split_inclusive(|&byte| byte == line_break);
    let start: usize = lines.by_ref().take(skipped).map(<[u8]>::len).sum();
    let table = &text[start..];
    // The last row may be truncated.
    let end = table.iter().rposition(|&byte| byte == line_break).map(|end| end + 1);
    let table = if is_whole {
        table
    } else {
        &table[..end.unwrap_or(table.len())]
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
    let Some((score, separator, decimal, rows)) = best.filter(|(.., rows)| !rows.is_empty()) else {
        return Err(defect.unwrap_or(TableError::Empty));
    };
    let dialect = Dialect {
        encoding,
        separator,
        decimal,
        header: choice.header.unwrap_or_else(|| has_names(&rows)),
        trailing_separator: separator != Separator::Space && score.width > 1 && ends_empty(&rows, score.width),
        sep_line: declared.is_some(),
        skipped_lines,
        carriage_returns,
    };
    let is_known = is_whole || end.is_some();
    Ok((dialect, if is_known { score.width } else { 0 }))
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
            Err(TableError::Quote(_)) if !sample.is_empty() => break,
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

/// Guesses the encoding of a file from its beginning.
pub(super) fn encoding_of(beginning: &[u8]) -> Encoding {
    let has_zeros = |offset: usize| {
        let bytes = Vec::from_iter(beginning.iter().skip(offset).step_by(2).take(200));
        let zeros = bytes.iter().filter(|byte| ***byte == 0).count();
        bytes.len() > 2 && 10 * zeros > 7 * bytes.len()
    };
    match beginning {
        [0xff, 0xfe, ..] => Encoding::Utf16Le,
        [0xfe, 0xff, ..] => Encoding::Utf16Be,
        _ if has_zeros(1) && !has_zeros(0) => Encoding::Utf16Le,
        _ if has_zeros(0) && !has_zeros(1) => Encoding::Utf16Be,
        _ => match std::str::from_utf8(beginning) {
            // The last character of the beginning may be truncated.
            Err(error) if error.error_len().is_some() => Encoding::Latin1,
            _ => Encoding::Utf8,
        },
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn dialect(text: &[u8], choice: &DialectChoice) -> Result<Dialect, TableError> {
        detect(text, true, encoding_of(text), choice).map(|(dialect, _)| dialect)
    }

    fn found(text: &[u8]) -> String {
        dialect(text, &DialectChoice::default()).unwrap().to_string()
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
        assert_eq!([&utf16, &utf16[2..]].map(encoding_of), [Encoding::Utf16Le; 2]);
    }

    #[test]
    fn given_choices_override_detection() {
        let choice = DialectChoice {
            separator: Some(Separator::Comma),
            header: Some(true),
            skip_lines: Some(1),
            ..DialectChoice::default()
        };
        let dialect = dialect(b"a;b;c\n1,2\n3,4\n", &choice).unwrap();
        assert_eq!(
            (dialect.separator, dialect.header, dialect.skipped_lines),
            (Separator::Comma, true, 1)
        );
    }

    #[test]
    fn empty_and_binary_files_are_refused() {
        for text in ["", "\n\n", "sep=;\n"] {
            let error = dialect(text.as_bytes(), &DialectChoice::default()).unwrap_err();
            assert!(matches!(error, TableError::Empty), "{text:?}: {error}");
        }
        let error = dialect(b"1,2\n\0\x01\x02\x03,\n", &DialectChoice::default()).unwrap_err();
        assert_eq!(
            error.to_string().split(';').next(),
            Some("it is not text: line 2 contains a zero byte")
        );
    }
}
