use std::{fmt, io::Read};

use decoupler_core::text::{Named, UnknownName, counted};
use encoding_rs::{UTF_16BE, UTF_16LE};
use encoding_rs_io::DecodeReaderBytesBuilder;
use serde::{Deserialize, Serialize};

/// Character between the cells of a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, strum::Display, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum Separator {
    /// `,`
    #[default]
    Comma = b',',
    /// `;`
    Semicolon = b';',
    /// Tab.
    Tab = b'\t',
    /// `|`
    Bar = b'|',
    /// Any number of spaces or tabs.
    Space = b' ',
}

/// Character before the decimal places.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, strum::Display, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "snake_case")]
pub enum Decimal {
    /// `1.5`
    #[default]
    Point,
    /// `1,5`
    Comma,
}

/// Encoding of a text file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, strum::Display, strum::IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "kebab-case")]
pub enum Encoding {
    /// UTF-8, with or without a byte-order mark.
    #[default]
    #[serde(rename = "utf-8")]
    #[strum(serialize = "utf-8")]
    Utf8,
    /// ISO 8859-1.
    #[serde(rename = "latin-1")]
    #[strum(serialize = "latin-1")]
    Latin1,
    /// UTF-16, little-endian.
    #[serde(rename = "utf-16le")]
    #[strum(serialize = "utf-16le")]
    Utf16Le,
    /// UTF-16, big-endian.
    #[serde(rename = "utf-16be")]
    #[strum(serialize = "utf-16be")]
    Utf16Be,
}

/// Layout of a text file, detected or given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Dialect {
    /// Encoding of the text.
    pub encoding: Encoding,
    /// Separator of the cells.
    pub separator: Separator,
    /// Decimal separator.
    pub decimal: Decimal,
    /// `true` if the first row contains the names of the columns.
    pub header: bool,
    /// `true` if every row ends with a separator after its last cell.
    pub trailing_separator: bool,
    /// `true` if the first line is `sep=` followed by the separator.
    pub sep_line: bool,
    /// Number of lines before the table, without the `sep=` line.
    pub skipped_lines: usize,
    /// `true` if lines end with a carriage return alone.
    pub carriage_returns: bool,
}

/// Layout given by the user; the rest is detected from the beginning of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DialectChoice {
    /// Encoding of the text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoding: Option<Encoding>,
    /// Separator of the cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub separator: Option<Separator>,
    /// Decimal separator.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decimal: Option<Decimal>,
    /// `true` if the first row contains the names of the columns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub header: Option<bool>,
    /// Number of lines before the table, without the `sep=` line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skip_lines: Option<usize>,
}

impl Named for Separator {
    const WHAT: &'static str = "a separator";
    /// In the order in which they are tried.
    const ALL: &'static [Self] = &[Self::Comma, Self::Semicolon, Self::Tab, Self::Bar, Self::Space];
}

impl Separator {
    /// Returns the separator of this name, or with this character.
    ///
    /// # Errors
    /// If there is none.
    pub fn named(text: &str) -> Result<Self, UnknownName> {
        let of_character = Self::of_character(text.replace("\\t", "\t").as_bytes());
        of_character.map_or_else(|| Self::parse(&text.to_lowercase()), Ok)
    }

    /// The character.
    pub(super) fn byte(self) -> u8 {
        self as u8
    }

    /// Returns the separator with this character.
    pub(super) fn of_character(character: &[u8]) -> Option<Self> {
        let mut all = Self::ALL.iter().copied();
        all.find(|separator| character == [separator.byte()])
    }
}

impl Named for Decimal {
    const WHAT: &'static str = "a decimal separator";
    const ALL: &'static [Self] = &[Self::Point, Self::Comma];
}

impl Decimal {
    /// Returns the separator of this name, or with this character.
    ///
    /// # Errors
    /// If there is none.
    pub fn named(text: &str) -> Result<Self, UnknownName> {
        Self::parse(match text {
            "." => "point",
            "," => "comma",
            name => name,
        })
    }
}

impl Named for Encoding {
    const WHAT: &'static str = "an encoding";
    const ALL: &'static [Self] = &[Self::Utf8, Self::Latin1, Self::Utf16Le, Self::Utf16Be];
}

impl Encoding {
    /// Returns the text of a cell. Invalid UTF-8 is read as Latin-1, which maps to the first 256 characters of Unicode.
    pub(super) fn text(self, cell: &[u8]) -> String {
        match std::str::from_utf8(cell) {
            Ok(text) if self != Self::Latin1 => text.to_owned(),
            _ => cell.iter().copied().map(char::from).collect(),
        }
    }
}

impl fmt::Display for Dialect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (separator, decimal, encoding) = (self.separator, self.decimal, self.encoding);
        let header = if self.header { "a header" } else { "no header" };
        write!(f, "separator {separator}, decimal {decimal}, {header}, {encoding}")?;
        let skipped = format!("{} before the table", counted(self.skipped_lines, "line"));
        for (is_so, what) in [
            (self.sep_line, "a sep= line"),
            (self.trailing_separator, "a separator at the end of each row"),
            (self.skipped_lines > 0, &skipped),
            (self.carriage_returns, "lines end with CR"),
        ] {
            if is_so {
                write!(f, ", {what}")?;
            }
        }
        Ok(())
    }
}

/// Returns the text of a UTF-16 source as UTF-8, including its byte order mark. Unpaired surrogates become U+FFFD.
pub(super) fn utf8_of_utf16<R: Read>(source: R, is_little_endian: bool) -> impl Read {
    let encoding = if is_little_endian { UTF_16LE } else { UTF_16BE };
    DecodeReaderBytesBuilder::new().encoding(Some(encoding)).build(source)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_byte_orders_are_decoded_across_blocks() {
        let text = format!("{}𝒳;°C\n", "ä1,5;".repeat(10_000));
        for is_little_endian in [true, false] {
            let to = if is_little_endian {
                u16::to_le_bytes
            } else {
                u16::to_be_bytes
            };
            // An additional byte shifts the surrogates across the end of a block.
            let bytes: Vec<u8> = text.encode_utf16().flat_map(to).collect();
            let mut decoded = String::new();
            utf8_of_utf16(&bytes[..], is_little_endian)
                .read_to_string(&mut decoded)
                .unwrap();
            assert!(decoded == text);
        }
    }

    #[test]
    fn invalid_utf_16_becomes_replacement_characters() {
        let mut decoded = String::new();
        let bytes = [0x41, 0x00, 0x00, 0xd8, 0x42, 0x00, 0x00, 0xd8, 0x43];
        utf8_of_utf16(&bytes[..], true).read_to_string(&mut decoded).unwrap();
        // A truncated end becomes one replacement character.
        assert_eq!(decoded, "A\u{fffd}B\u{fffd}");
    }
}
