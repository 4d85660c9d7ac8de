use serde::Deserialize;
use serde_json::error::Category;

/// The fields that identify a JSON file of ours, read before the rest, which differs between versions.
#[derive(Deserialize)]
pub(super) struct Heading {
    pub(super) format: serde_json::Value,
    #[serde(default)]
    pub(super) version: serde_json::Value,
    #[serde(default)]
    program: serde_json::Value,
}

/// Reasons for which a file has no heading of ours.
pub(super) enum NoHeading {
    /// Not JSON; the parser's message, with line and column.
    NotJson(String),
    /// JSON that ends too early, at this line and column, counted from 1.
    CutOff { line: usize, column: usize },
    /// JSON of another program.
    Other,
}

impl Heading {
    pub(super) fn read(bytes: &[u8]) -> Result<Self, NoHeading> {
        serde_json::from_slice(bytes).map_err(|error| {
            let cut_off = NoHeading::CutOff {
                line: error.line(),
                column: error.column(),
            };
            // To the parser a number that ends with the file, as "1e", is invalid; to us the file was cut off.
            match error.classify() {
                _ if bytes.trim_ascii().is_empty() => NoHeading::NotJson("it is empty".to_owned()),
                Category::Eof => cut_off,
                Category::Syntax if in_last_number(bytes, &error) => cut_off,
                Category::Data => NoHeading::Other,
                Category::Syntax | Category::Io => NoHeading::NotJson(error.to_string()),
            }
        })
    }

    /// The version, if it is another one.
    pub(super) fn version_other_than(&self, known: u64) -> Option<String> {
        (self.version.as_u64() != Some(known)).then(|| self.version.to_string())
    }

    /// The program that wrote it.
    pub(super) fn program(&self) -> String {
        self.program.as_str().unwrap_or("another program").to_owned()
    }
}

/// Returns whether the parser stopped in a number with which the file ends, as `1e`: to the parser it is invalid, to us
/// the file was cut off.
fn in_last_number(bytes: &[u8], error: &serde_json::Error) -> bool {
    let text = bytes.trim_ascii_end();
    let last_line = text.rsplit(|byte| *byte == b'\n').next().unwrap_or_default();
    let lines = 1 + text.iter().filter(|byte| **byte == b'\n').count();
    error.to_string().starts_with("invalid number")
        && (error.line(), error.column()) >= (lines, last_line.len())
        && !text.ends_with(b"}")
}
