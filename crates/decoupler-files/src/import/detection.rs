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
    let table = &table[..end.filter(|_| !is_whole).unwrap_or(table.len())];
    let given = choice.separator.or(declared);
    let separators = Separator::ALL
        .iter()
        .flat_map(|one| Decimal::ALL.iter().map(move |decimal| (*one, *decimal)));
    let is_tried = |(separator, decimal): &(Separator, Decimal)| {
        given.is_none_or(|given| given == *separator)
            && match choice.decimal {
                Some(given) => given == *decimal,
                None => *separator != Separator::Comma || *decimal == Decimal::Point,
            }
    };
    let (mut best, mut defect) = (None::<Sample>, TableError::Empty);
    for separators in separators.filter(is_tried) {
        match Sample::of(table, separators, carriage_returns) {
            Ok(sample) if best.as_ref().is_none_or(|best| sample.is_better_than(best)) => best = Some(sample),
            Ok(_) => {}
            Err(error) => defect = error,
        }
    }
    let Some(best) = best.filter(|best| !best.rows.is_empty()) else {
        return Err(defect);
    };
    let (separator, decimal) = best.separators;
    let dialect = Dialect {
        encoding,
        separator,
        decimal,
        header: choice.header.unwrap_or_else(|| best.has_names()),
        trailing_separator: separator != Separator::Space && best.width > 1 && best.ends_empty(),
        sep_line: declared.is_some(),
        skipped_lines,
        carriage_returns,
    };
    let is_known = is_whole || end.is_some();
    Ok((dialect, if is_known { best.width } else { 0 }))
}

/// Cells of the first rows with a pair of separators.
struct Sample {
    separators: (Separator, Decimal),
    rows: Vec<Vec<Cell>>,
    /// Most common number of cells in a row.
    width: usize,
    /// Fraction of the rows with that number of cells, times the fraction of their cells, except in the first row, that are
    /// numbers or missing; higher if there are several columns.
    merit: f64,
}

impl Sample {
    fn of(text: &[u8], separators: (Separator, Decimal), carriage_returns: bool) -> Result<Self, TableError> {
        // A time stamp counts as a number.
        let parsed = |cell: &[u8]| match parse(cell, separators.1) {
            Cell::Text if TimeStamp::parse(cell).is_some() => Cell::Number(0.0),
            found => found,
        };
        let mut source = Rows::new(text, separators.0, carriage_returns);
        let mut rows: Vec<Vec<Cell>> = Vec::new();
        while rows.len() < MAX_ROWS {
            match source.advance() {
                Ok(true) => rows.push(source.cells().map(parsed).collect()),
                Ok(false) => break,
                // The closing quote may lie beyond the beginning.
                Err(TableError::Quote(_)) if !rows.is_empty() => break,
                Err(error) => return Err(error),
            }
        }
        let (width, count) = commonest(rows.iter().map(Vec::len));
        let body = rows.iter().skip(usize::from(rows.len() > 1));
        let (mut cells, mut numeric) = (0, 0.0);
        for cell in body.filter(|row| row.len() == width).flatten() {
            cells += 1;
            numeric += match cell {
                Cell::Number(_) => 1.0,
                // A table of empty cells is not a table of numbers.
                Cell::Missing => 0.9,
                Cell::Text => 0.0,
            };
        }
        let regular = count as f64 / rows.len().max(1) as f64;
        let several = if width > 1 { 0.3 } else { 0.0 };
        Ok(Self {
            separators,
            rows,
            width,
            merit: regular * numeric / f64::from(cells.max(1)) + several,
        })
    }

    fn is_better_than(&self, other: &Self) -> bool {
        self.merit > other.merit + 1e-9 || (self.merit > other.merit - 1e-9 && self.width > other.width)
    }

    fn has_names(&self) -> bool {
        let Some((first, body)) = self.rows.split_first() else {
            return false;
        };
        let texts = first.iter().filter(|cell| **cell == Cell::Text).count();
        let filled = first.iter().filter(|cell| **cell != Cell::Missing).count();
        let is_number = |column: usize| {
            let cells = || body.iter().filter_map(|row| row.get(column));
            let numbers = cells().filter(|cell| matches!(cell, Cell::Number(_))).count();
            numbers > 0 && 2 * numbers >= cells().count()
        };
        let is_above_numbers = |column: usize| first[column] == Cell::Text && is_number(column);
        texts > 0 && 2 * texts >= filled && (body.is_empty() || (0..first.len()).any(is_above_numbers))
    }

    /// Returns `true` if the last cell of every row of the most common length is empty.
    fn ends_empty(&self) -> bool {
        let mut rows = self.rows.iter().filter(|row| row.len() == self.width);
        rows.all(|row| row[self.width - 1] == Cell::Missing)
    }
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
        // The last character of the beginning may be truncated.
        _ if std::str::from_utf8(beginning).is_err_and(|error| error.error_len().is_some()) => Encoding::Latin1,
        _ => Encoding::Utf8,
    }
}

/// Returns the separator given by a first line `sep=`.
fn sep_line(text: &[u8], line_break: u8) -> Option<Separator> {
    let line = text.split(|&byte| byte == line_break).next()?;
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    let quoted = line.strip_prefix(b"\"").and_then(|line| line.strip_suffix(b"\""));
    let (name, character) = quoted.unwrap_or(line).split_at_checked(4)?;
    Separator::of_character(character).filter(|_| name.eq_ignore_ascii_case(b"sep="))
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
