use std::io::{self, ErrorKind};

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

/// Says in plain words why the operating system refused a file, and what to do about it.
pub fn system_cause(error: &io::Error) -> String {
    let words = match error.kind() {
        ErrorKind::NotFound => "there is no such file or folder; check the name",
        ErrorKind::PermissionDenied => {
            "permission denied; change the permissions of the file and its folder, or give another place"
        }
        ErrorKind::IsADirectory => "it is a folder; give the name of a file",
        ErrorKind::NotADirectory => "a part of the path is a file, not a folder; correct the path",
        ErrorKind::AlreadyExists => "there is a file of this name already; remove it, or give another name",
        ErrorKind::StorageFull => "the disk is full; free some space, or give a place on another disk",
        ErrorKind::QuotaExceeded => "your share of the disk is used up; free some space, or give another place",
        // Beyond a limit of our own.
        ErrorKind::FileTooLarge if error.get_ref().is_some() => return error.to_string(),
        ErrorKind::FileTooLarge => "the file is too large for this disk; give a place on another disk",
        ErrorKind::ReadOnlyFilesystem => "the disk is read-only; give a place on another disk",
        ErrorKind::InvalidFilename => {
            "the name is too long, or has characters that the disk does not allow; give another"
        }
        ErrorKind::ResourceBusy | ErrorKind::ExecutableFileBusy => {
            "another program is using it; close that program, or wait, and try again"
        }
        ErrorKind::BrokenPipe => "the program that reads it has ended; start both again",
        ErrorKind::OutOfMemory => "memory is full; close other programs, or use less data",
        ErrorKind::InvalidData => "it is not text that can be read; check that it is the right file",
        _ => return with_cure(error),
    };
    words.to_owned()
}

/// The system's own words, without its number, for what happens rarely.
fn with_cure(error: &io::Error) -> String {
    let text = error.to_string();
    let words = text.split(" (os error").next().unwrap_or(&text);
    if error.raw_os_error().is_some() {
        format!("the system reports: {words}; check the disk or device, or give another place")
    } else {
        words.to_owned()
    }
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

    #[test]
    fn every_refusal_is_said_in_words_with_a_cure() {
        // Linux numbers: no entry, permission, exists, not a folder, is a folder, too large, full, read-only, input/output,
        // too many open files, name too long, loop of links.
        for number in [2, 13, 17, 20, 21, 27, 28, 30, 5, 24, 36, 40] {
            let text = system_cause(&io::Error::from_raw_os_error(number));
            assert!(!text.contains("os error") && text.contains(';'), "{number}: {text}");
        }
        let own = io::Error::other("the archive is empty; choose another");
        assert_eq!(system_cause(&own), "the archive is empty; choose another");
    }
}
