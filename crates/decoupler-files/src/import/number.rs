use super::Decimal;

/// A cell as a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cell {
    /// A finite number.
    Number(f64),
    /// Empty, or "NaN".
    Missing,
    /// Anything else, infinities included.
    Text,
}

/// Longest number that is copied to the stack.
const LONGEST: usize = 64;

/// Reads a cell without surrounding spaces; the number is the one nearest to the text.
pub(super) fn parse(cell: &[u8], decimal: Decimal) -> Cell {
    if cell.is_empty() {
        return Cell::Missing;
    }
    let number = match decimal {
        Decimal::Point => parse_point(cell),
        // A point would be a separator of thousands, or a point after all.
        Decimal::Comma if cell.contains(&b'.') || cell.len() > LONGEST => None,
        Decimal::Comma => {
            let mut copy = [0; LONGEST];
            let copy = &mut copy[..cell.len()];
            copy.copy_from_slice(cell);
            if let Some(comma) = copy.iter_mut().find(|byte| **byte == b',') {
                *comma = b'.';
            }
            parse_point(copy)
        }
    };
    match number {
        Some(number) if number.is_finite() => Cell::Number(number),
        Some(number) if number.is_nan() => Cell::Missing,
        _ => Cell::Text,
    }
}

fn parse_point(cell: &[u8]) -> Option<f64> {
    std::str::from_utf8(cell).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_numbers_missing_or_text() {
        use Cell::{Missing, Number, Text};
        let cases = [
            ("1.5", Number(1.5), Text),
            ("1,5", Text, Number(1.5)),
            ("-2e-3", Number(-0.002), Number(-0.002)),
            ("+.5", Number(0.5), Text),
            ("1.234,5", Text, Text),
            ("1,234,5", Text, Text),
            ("", Missing, Missing),
            ("NaN", Missing, Missing),
            ("nan", Missing, Missing),
            ("inf", Text, Text),
            ("1e999", Text, Text),
            ("NA", Text, Text),
            ("1 000", Text, Text),
            ("0x10", Text, Text),
            (
                "9007199254740993",
                Number(9_007_199_254_740_992.0),
                Number(9_007_199_254_740_992.0),
            ),
        ];
        for (text, point, comma) in cases {
            assert_eq!(parse(text.as_bytes(), Decimal::Point), point, "{text}");
            assert_eq!(parse(text.as_bytes(), Decimal::Comma), comma, "{text}");
        }
    }
}
