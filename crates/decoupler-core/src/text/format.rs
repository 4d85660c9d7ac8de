use std::{fmt, time::Duration};

use serde::{Deserialize, Deserializer};

/// Text in place of a missing number.
const MISSING: &str = "–";

/// Formats a number with three significant digits: `0.217`, `12.3`, `1234`; `6.13e-5` below 0.001 and from 100000; a
/// dash for a missing number, NaN and infinity.
pub fn format_number(value: impl Into<Option<f64>>) -> String {
    let Some(value) = value.into().filter(|value| value.is_finite()) else {
        return MISSING.to_owned();
    };
    if value == 0.0 {
        return "0".to_owned();
    }
    let scientific = format!("{value:.2e}");
    if !(1e-3..99_999.5).contains(&value.abs()) {
        return scientific;
    }
    // The exponent after rounding: 9.999 is 10.0.
    let exponent = scientific
        .split_once('e')
        .and_then(|(_, exponent)| exponent.parse().ok());
    let decimals = 2_i32.saturating_sub(exponent.unwrap_or(0));
    format!("{value:.*}", usize::try_from(decimals).unwrap_or(0))
}

/// Formats R², the coefficient of determination: as [`format_number`], with more digits where a value below 1 would be
/// rounded to 1: `0.951`, `0.9998`, `0.9999997`.
pub fn format_r2(value: impl Into<Option<f64>>) -> String {
    match value.into() {
        Some(value) if (0.9995..1.0).contains(&value) => format_below_one(value, 4),
        value => format_number(value),
    }
}

/// Formats a number with `decimals` decimals, or as many more as show that it is below 1.
pub fn format_below_one(value: f64, decimals: usize) -> String {
    let text = |decimals: usize| format!("{value:.decimals$}");
    let is_one =
        |decimals: &usize| value < 1.0 && text(*decimals) == format!("{:.decimals$}", 1.0, decimals = *decimals);
    /// Decimals of the largest number below 1.
    const MAX: usize = 16;
    let text = text((decimals..MAX).find(|decimals| !is_one(decimals)).unwrap_or(MAX));
    // No -0.00.
    match text.strip_prefix('-') {
        Some(zero) if zero.chars().all(|digit| "0.".contains(digit)) => zero.to_owned(),
        _ => text,
    }
}

/// Formats a number as [`format_number`] does, with a percent sign.
pub fn format_percent(value: impl Into<Option<f64>>) -> String {
    match format_number(value) {
        text if text == MISSING => text,
        text => format!("{text} %"),
    }
}

/// Formats a duration: `0.23 ms`, `340 ms`, `12.3 s`, `4 min 5 s`, `1 h 2 min`.
pub fn format_duration(duration: Duration) -> String {
    let seconds = duration.as_secs_f64();
    let whole = seconds.round() as u64;
    match whole {
        _ if seconds < 0.9995 => format!("{} ms", format_number(1e3 * seconds)),
        0..60 => format!("{} s", format_number(seconds)),
        60..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

/// Returns the text with its first letter capitalised.
pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).collect()
}

/// Returns a count with its noun: `1 sample`, `2 samples`.
pub fn counted<N: fmt::Display + PartialEq + From<u8>>(count: N, noun: &str) -> String {
    let is_one = count == N::from(1);
    format!("{count} {noun}{}", if is_one { "" } else { "s" })
}

/// Maximum length of a name in characters.
const LONGEST_NAME: usize = 200;

/// Returns a name from a file without special characters: control characters, which could drive a terminal or break
/// XML, characters that change the direction of the text around them, and the apostrophe with which [`inert`]
/// protects spreadsheets. A name of more than 200 characters is cut.
pub fn clean_name(name: &str) -> String {
    let name = printable_name(name);
    match name.char_indices().nth(LONGEST_NAME) {
        None => name,
        Some(_) => name.chars().take(LONGEST_NAME - 1).chain(['…']).collect(),
    }
}

fn printable_name(name: &str) -> String {
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

/// Returns a name as it is in a file, with unprintable characters escaped (`\u{1b}`) and at most 1000 characters long; `None`
/// if [`clean_name`] leaves it as it is, apart from the apostrophe of [`inert`].
pub fn original_name(name: &str) -> Option<String> {
    const LONGEST: usize = 1000;
    let name = name.trim_matches(' ');
    let is_kept = !name.contains(is_unprintable) && name.chars().nth(LONGEST_NAME).is_none();
    (!is_kept).then(|| escaped(name.chars().take(LONGEST), is_unprintable))
}

/// Returns a text that is safe in a spreadsheet, which treats a cell that begins with one of `= + - @` as a formula:
/// such a text gets a leading apostrophe, unless it is a number.
pub fn inert(text: &str) -> String {
    if begins_formula(text) {
        format!("'{text}")
    } else {
        text.to_owned()
    }
}

/// Returns `true` for a text that a spreadsheet would treat as a formula.
pub fn begins_formula(text: &str) -> bool {
    text.starts_with(['=', '+', '-', '@']) && text.len() > 1 && text.parse::<f64>().is_err()
}

/// Returns `true` for characters that are not printed but have an effect.
pub fn is_unprintable(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}')
}

/// Returns a text for a terminal, in which unprintable characters, for example of the name of a file, are escaped.
pub fn printable(text: &str) -> String {
    escaped(text.chars(), |letter| {
        is_unprintable(letter) && !"\n\t".contains(letter)
    })
}

/// Returns a text for a message of one line: line breaks, tabs and other unprintable characters, for example of a field of a
/// damaged file, are escaped. The middle of a text of more than 1000 characters is left out: the cure is at the end.
pub fn in_one_line(text: &str) -> String {
    const BEGIN: usize = 700;
    const END: usize = 299;
    let text = escaped(text.chars(), is_unprintable);
    let place = |index: usize| text.char_indices().nth(index).map(|(place, _)| place);
    match (
        place(BEGIN),
        place(BEGIN + END + 1),
        text.char_indices().nth_back(END - 1),
    ) {
        (Some(begin), Some(_), Some((end, _))) => format!("{}…{}", &text[..begin], &text[end..]),
        _ => text,
    }
}

fn escaped(text: impl Iterator<Item = char>, is_escaped: impl Fn(char) -> bool) -> String {
    let mut escaped = String::new();
    for letter in text {
        if is_escaped(letter) {
            escaped.extend(letter.escape_debug());
        } else {
            escaped.push(letter);
        }
    }
    escaped
}

/// Reads the original of a name; unprintable characters, which no program of ours writes, are escaped.
pub(crate) fn escaped_if_any<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<String>, D::Error> {
    let name = Option::<String>::deserialize(deserializer)?;
    Ok(name.map(|name| original_name(&name).unwrap_or(name)))
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
    fn long_messages_lose_their_middle() {
        let whole = "é".repeat(1000);
        assert_eq!(in_one_line(&whole), whole);
        let cut = in_one_line(&format!("begin\n{}save it again", "é".repeat(5000)));
        assert_eq!(cut.chars().count(), 1000);
        assert!(
            cut.starts_with("begin\\né") && cut.contains("é…é") && cut.ends_with("ésave it again"),
            "{cut}"
        );
    }

    #[test]
    fn numbers_have_three_significant_digits() {
        let cases = [
            (0.0, "0"),
            (-0.0, "0"),
            (2.2812, "2.28"),
            (0.2171, "0.217"),
            (-12.345, "-12.3"),
            (9.999, "10.0"),
            (1234.4, "1234"),
            (99_999.0, "99999"),
            (100_000.0, "1.00e5"),
            (0.001, "0.00100"),
            (0.000_999, "9.99e-4"),
            (6.13e-5, "6.13e-5"),
            (2.36e-12, "2.36e-12"),
            (f64::MAX, "1.80e308"),
            (f64::from_bits(1), "4.94e-324"),
            (f64::NAN, "–"),
            (f64::INFINITY, "–"),
        ];
        for (value, text) in cases {
            assert_eq!(format_number(value), text, "{value}");
        }
        assert_eq!(format_number(None), "–");
        assert_eq!(format_percent(2.28), "2.28 %");
        assert_eq!(format_percent(Some(f64::NAN)), "–");
    }

    #[test]
    fn r2_is_rounded_to_one_only_if_it_is_one() {
        let cases = [
            (Some(0.951_2), "0.951"),
            (Some(0.999_4), "0.999"),
            (Some(0.999_76), "0.9998"),
            (Some(0.999_98), "0.99998"),
            (Some(1.0 - 3e-9), "0.999999997"),
            (Some(1.0 - f64::EPSILON / 2.0), "0.9999999999999999"),
            (Some(1.0), "1.00"),
            (Some(-0.12), "-0.120"),
            (Some(f64::NEG_INFINITY), "–"),
            (None, "–"),
        ];
        for (value, text) in cases {
            assert_eq!(format_r2(value), text);
        }
        assert_eq!(format_below_one(-1e-7, 2), "0.00");
        assert_eq!(format_below_one(0.998, 2), "0.998");
        assert_eq!(format_below_one(1.002, 2), "1.00");
    }

    #[test]
    fn durations_have_the_usual_units() {
        let cases = [
            (0.0, "0 ms"),
            (0.000_23, "0.230 ms"),
            (0.34, "340 ms"),
            (0.9999, "1.00 s"),
            (12.34, "12.3 s"),
            (59.7, "1 min 0 s"),
            (245.0, "4 min 5 s"),
            (3720.0, "1 h 2 min"),
        ];
        for (seconds, text) in cases {
            assert_eq!(format_duration(Duration::from_secs_f64(seconds)), text);
        }
    }

    #[test]
    fn names_keep_letters_and_lose_special_characters() {
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
    fn the_original_of_a_changed_name_is_printable() {
        for (name, original) in [
            ("force (µN)", None),
            (" 'quoted' ", None),
            ("'=1+2", None),
            ("a\u{1b}[31mb", Some("a\\u{1b}[31mb")),
            ("x\ty", Some("x\\ty")),
            ("e\u{202e}f", Some("e\\u{202e}f")),
        ] {
            let found = original_name(name);
            assert_eq!(found.as_deref(), original);
            // Cleaning the original name, as it is in the file, leads to the same name as before.
            assert!(found.is_none_or(|found| clean_name(&found) == found));
        }
    }

    #[test]
    fn long_names_are_cut_and_texts_for_a_terminal_escaped() {
        let long = "ü".repeat(100_000);
        let name = clean_name(&long);
        assert_eq!(name.chars().count(), 200);
        assert!(name.ends_with("ü…") && clean_name(&name) == name);
        assert_eq!(clean_name(&"x".repeat(200)), "x".repeat(200));
        assert_eq!(original_name(&long).map(|name| name.chars().count()), Some(1000));
        let text = printable("cannot read '/a/b\u{1b}[2J\u{9b}c': \tno\nmore");
        assert_eq!(text, "cannot read '/a/b\\u{1b}[2J\\u{9b}c': \tno\nmore");
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
