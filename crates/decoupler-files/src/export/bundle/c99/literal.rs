use std::fmt::{Display, Write};

use crate::export::bundle::weights::Digits;

/// Name of the C type with these digits.
pub(super) fn type_name(digits: Digits) -> &'static str {
    match digits {
        Digits::Single => "float",
        Digits::Double => "double",
    }
}

/// A number as C reads it back to the same bits; one beyond the largest that `digits` can have is this.
pub(super) fn number(digits: Digits, value: f64) -> String {
    match digits {
        Digits::Single => format!("{:e}f", (value as f32).clamp(f32::MIN, f32::MAX)),
        Digits::Double => format!("{:e}", value.clamp(f64::MIN, f64::MAX)),
    }
}

/// A 64-bit whole number.
pub(super) fn long(value: i64) -> String {
    format!("INT64_C({value})")
}

/// Appends `declaration = { … };` with the nested braces of `shape`. The elements are given row by row.
pub(super) fn push_array(
    text: &mut String,
    declaration: &str,
    shape: &[usize],
    elements: impl IntoIterator<Item = impl Display>,
) {
    let _ = write!(text, "{declaration} = ");
    push_level(text, shape, &mut elements.into_iter(), 0);
    text.push_str(";\n\n");
}

fn push_level(text: &mut String, shape: &[usize], elements: &mut impl Iterator<Item = impl Display>, depth: usize) {
    /// Characters after which a line ends.
    const WIDTH: usize = 100;
    let Some((&size, inner)) = shape.split_first() else {
        return;
    };
    let indent = "    ".repeat(depth + 1);
    text.push_str("{\n");
    let mut line = indent.clone();
    for _ in 0..size {
        if inner.is_empty() {
            // The iterator has as many elements as the shape says.
            let Some(element) = elements.next() else { break };
            let _ = write!(line, "{element}, ");
            if line.len() > WIDTH {
                text.push_str(line.trim_end());
                text.push('\n');
                line.clone_from(&indent);
            }
        } else {
            text.push_str(&indent);
            push_level(text, inner, elements, depth + 1);
            text.push_str(",\n");
        }
    }
    if line.len() > indent.len() {
        text.push_str(line.trim_end());
        text.push('\n');
    }
    let _ = write!(text, "{}}}", "    ".repeat(depth));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_c() {
        let cases = [
            (number(Digits::Double, 0.1), "1e-1"),
            (number(Digits::Double, -1.0 / 3.0), "-3.333333333333333e-1"),
            (number(Digits::Single, f64::from(0.1_f32)), "1e-1f"),
            (number(Digits::Single, -1e39), "-3.4028235e38f"),
            (number(Digits::Double, f64::INFINITY), "1.7976931348623157e308"),
            (long(-5), "INT64_C(-5)"),
        ];
        for (literal, expected) in cases {
            assert_eq!(literal, expected);
        }
    }

    #[test]
    fn every_dimension_has_its_braces() {
        let mut text = String::new();
        push_array(&mut text, "static const int a[2][2]", &[2, 2], [1, 2, 3, 4]);
        let words: Vec<_> = text.split_whitespace().collect();
        assert_eq!(words.join(" "), "static const int a[2][2] = { { 1, 2, }, { 3, 4, }, };");
    }
}
