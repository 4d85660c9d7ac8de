use serde::{Deserialize, Deserializer};

/// Returns a name from a file without what is no letter of it: control characters, with which a name could drive a terminal
/// or break XML, characters that turn the direction of the text around it, and the apostrophe with which
/// [`inert`] protects spreadsheets.
pub fn clean_name(name: &str) -> String {
    let name = match name.strip_prefix('\'') {
        Some(rest) if begins_formula(rest) => rest,
        _ => name,
    };
    if !name.contains(is_unprintable) {
        return name.to_owned();
    }
    let words = name.split(|c: char| is_unprintable(c) || c.is_whitespace());
    words.filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Returns a text for a spreadsheet, which takes a cell that begins with one of `= + - @` for a formula: such a text gets
/// an apostrophe in front, unless it is a number.
pub fn inert(text: &str) -> String {
    if begins_formula(text) {
        format!("'{text}")
    } else {
        text.to_owned()
    }
}

/// Returns `true` for a text that a spreadsheet would take for a formula.
pub fn begins_formula(text: &str) -> bool {
    text.starts_with(['=', '+', '-', '@']) && text.len() > 1 && text.parse::<f64>().is_err()
}

/// Returns `true` for characters that are not printed but do something.
pub fn is_unprintable(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}')
}

/// Reads a name and cleans it.
pub(crate) fn cleaned<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    String::deserialize(deserializer).map(|name| clean_name(&name))
}

/// Reads a name that may be missing and cleans it.
pub(crate) fn cleaned_if_any<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    Ok(Option::<String>::deserialize(deserializer)?.map(|name| clean_name(&name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_keep_their_letters_and_lose_what_is_none() {
        for (name, expected) in [
            ("force (µN)", "force (µN)"),
            ("a\u{1b}[31mb\u{7}", "a [31mb"),
            ("x\ty\r\nz", "x y z"),
            ("e\u{202e}f", "e f"),
            ("\u{9b}2J", "2J"),
            ("'=1+2", "=1+2"),
            ("'quoted'", "'quoted'"),
            ("力 – ü  two spaces", "力 – ü  two spaces"),
        ] {
            assert_eq!(clean_name(name), expected);
            assert_eq!(clean_name(&clean_name(name)), expected);
        }
    }

    #[test]
    fn formulas_are_inert_and_numbers_stay_numbers() {
        for text in [
            "=1+2",
            "+cmd|' /C calc'!A0",
            "-a",
            "@SUM(1)",
            "=",
            "-0.5",
            "+3e-5",
            "-",
            "a=b",
            "–",
        ] {
            let is_changed = ["=1+2", "+cmd|' /C calc'!A0", "-a", "@SUM(1)"].contains(&text);
            assert_eq!(inert(text) != text, is_changed, "{text}");
            assert_eq!(clean_name(&inert(text)), text);
        }
    }
}
