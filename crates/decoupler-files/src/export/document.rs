use std::{
    fmt, fs,
    io::{self, ErrorKind, Read as _, Write as _},
    path::{Path, PathBuf},
};

use decoupler_core::{evaluation::Run, text::in_one_line};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::{
    Value,
    value::{RawValue, to_raw_value},
};
use strum::{EnumMessage as _, VariantArray as _};
use thiserror::Error;

use super::{AtomicFile, WriteError};
use crate::{
    import::Recorded,
    machine::{ReadingBudget, system_cause},
};

pub(super) const PROGRAM: &str = concat!("decoupler ", env!("CARGO_PKG_VERSION"));

/// Kinds of JSON files that the program writes and reads back, each with its name in sentences, its format, and what helps if
/// a file is damaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, strum::Display, strum::EnumMessage, strum::VariantArray)]
#[non_exhaustive]
pub enum DocumentKind {
    /// A trained network with its record: [`super::NetworkFile`].
    #[strum(to_string = "network file", message = "decoupler network")]
    #[strum(detailed_message = "copy or save it again")]
    Network,
    /// A training to be resumed: [`super::CheckpointFile`].
    #[strum(to_string = "checkpoint", message = "decoupler checkpoint")]
    #[strum(detailed_message = "copy it again, or start a new training")]
    Checkpoint,
    /// The source of the samples of a run: [`super::RecipeFile`].
    #[strum(to_string = "recipe", message = "decoupler recipe")]
    #[strum(detailed_message = "correct it, or save it again")]
    Recipe,
    /// A sensor model: [`super::SensorFile`].
    #[strum(to_string = "sensor file", message = "decoupler sensor")]
    #[strum(detailed_message = "correct it, or calibrate again")]
    Sensor,
    /// A name or choice of the run list: [`super::RunFolder`].
    #[strum(to_string = "part of a run list", message = "decoupler run list")]
    #[strum(detailed_message = "name the run or choose A and B again")]
    RunList,
    /// A finished trial of `decoupler sweep`.
    #[strum(to_string = "trial", message = "decoupler trial")]
    #[strum(detailed_message = "delete it and run the sweep again")]
    Trial,
}

impl DocumentKind {
    /// Value of the field `format`.
    pub(super) fn format(self) -> &'static str {
        self.get_message().unwrap_or_default()
    }

    /// Version of the format, the only one that can be read.
    pub(super) fn version(self) -> u64 {
        match self {
            Self::Network | Self::Checkpoint => 4,
            Self::Recipe | Self::Sensor | Self::RunList | Self::Trial => 1,
        }
    }

    fn cure(self) -> &'static str {
        self.get_detailed_message().unwrap_or_default()
    }

    /// Returns the kind of the file at `path`, determined by its beginning; `None` if it is of no kind or cannot be
    /// read.
    pub fn of_file(path: &Path) -> Option<Self> {
        /// Number of bytes within which the format is named, even in a recipe formatted by hand.
        const BEGINNING: u64 = 512;
        let mut beginning = Vec::new();
        let file = fs::File::open(path).ok()?;
        file.take(BEGINNING).read_to_end(&mut beginning).ok()?;
        let text = String::from_utf8_lossy(&beginning);
        let (_, rest) = text.trim_start().strip_prefix('{')?.split_once("\"format\"")?;
        let rest = rest.trim_start_matches(|c: char| c == ':' || c.is_whitespace());
        let is_named = |kind: &&Self| rest.starts_with(&format!("\"{}\"", kind.format()));
        Self::VARIANTS.iter().find(is_named).copied()
    }

    /// Returns the origin of the samples of `run` for its file: `recorded`, or `None` if they are simulated.
    ///
    /// # Errors
    /// [`DocumentError::NoPlan`] if the samples are recorded and no plan is given.
    pub(super) fn recorded_of(self, run: &Run, recorded: Option<&Recorded>) -> Result<Option<Recorded>, DocumentError> {
        if run.settings().simulation().is_some() {
            return Ok(None);
        }
        recorded.map_or(Err(DocumentError::NoPlan(self)), |recorded| Ok(Some(recorded.clone())))
    }

    /// Reads the bytes of the file of this kind at `path` and checks their heading.
    ///
    /// # Errors
    /// The file cannot be read, or is of another kind or version.
    pub(super) fn read(self, path: &Path) -> Result<Vec<u8>, DocumentError> {
        let bytes = read_limited(path).map_err(|source| DocumentError::Read(path.to_owned(), source))?;
        let checked = self.check_heading(&bytes);
        checked.map_err(|defect| DocumentError::unusable(path, &defect))?;
        Ok(bytes)
    }

    fn check_heading(self, bytes: &[u8]) -> Result<(), String> {
        let (format, version) = (self.format(), self.version());
        let other = |reason: &str| format!("is not a {self}: {reason}; choose one that Decoupler saved");
        let beginning = format!("{{\"format\":\"{format}\",");
        let heading: Heading = serde_json::from_slice(bytes).map_err(|error| match error {
            _ if bytes.trim_ascii().is_empty() => other("it is empty"),
            error if is_cut_off(bytes, &error) => {
                let (line, column) = (error.line(), error.column());
                format!("is cut off at line {line}, column {column}; {}", self.cure())
            }
            error if error.is_data() => other(&format!("it has no field \"format\": \"{format}\"")),
            error if bytes.starts_with(beginning.as_bytes()) => self.damage(error),
            error => other(&error.to_string()),
        })?;
        if heading.format != format {
            return Err(other(&format!("its format is {}", heading.format)));
        }
        if heading.version.as_u64() != Some(version) {
            let program = heading.program.as_str().unwrap_or("another program");
            return Err(format!(
                "has version {} of the format, written by {program}; this is {PROGRAM}, which reads version {version}: open it \
                 with the program that wrote it",
                heading.version
            ));
        }
        Ok(())
    }

    fn damage(self, defect: impl fmt::Display) -> String {
        format!("is damaged: {defect}; {}", self.cure())
    }

    pub(super) fn damaged(self, path: &Path, defect: impl fmt::Display) -> DocumentError {
        DocumentError::unusable(path, &self.damage(defect))
    }

    /// Reads the contents of the file of this kind at `path`, and the program that wrote it.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub(super) fn load<T: DeserializeOwned>(self, path: &Path) -> Result<(String, T), DocumentError> {
        let bytes = self.read(path)?;
        self.unseal(&bytes).map_err(|defect| self.damaged(path, defect))
    }

    /// Reads the contents of a file of this kind, and the program that wrote it.
    ///
    /// # Errors
    /// A description of the damage.
    pub(super) fn unseal<T: DeserializeOwned>(self, bytes: &[u8]) -> Result<(String, T), String> {
        let text = |error: serde_json::Error| error.to_string();
        let sealed: Sealed<'_> = serde_json::from_slice(bytes).map_err(text)?;
        let contents = match (sealed.crc32, sealed.run, sealed.sensor) {
            (Some(crc32), Some(run), None) if crc32 == checksum(run) => run,
            (Some(_), Some(_), None) => return Err("its checksum shows that something in it has changed".to_owned()),
            (None, None, Some(sensor)) if self == Self::Sensor => sensor,
            _ => return Err("the field `crc32` or `run` is missing".to_owned()),
        };
        Ok((sealed.program, serde_json::from_str(contents.get()).map_err(text)?))
    }

    /// Writes `contents`, of `program`, to the file of this kind at `path`, whole or not at all; `commit` puts it in its place.
    ///
    /// # Errors
    /// The path cannot be written, or the file would be too large to be read again.
    pub(super) fn save<T>(
        self,
        program: &str,
        contents: &impl Serialize,
        path: &Path,
        commit: fn(AtomicFile) -> Result<T, WriteError>,
    ) -> Result<T, WriteError> {
        let error = |source| WriteError::io(path, source);
        let text = self.seal(program, contents).map_err(|source| error(source.into()))?;
        if text.len() as u64 >= LARGEST_BYTES {
            return Err(error(too_large()));
        }
        let mut file = AtomicFile::create(path)?;
        writeln!(file, "{text}").map_err(error)?;
        commit(file)
    }

    /// Returns the text of a file of this kind.
    ///
    /// # Errors
    /// The contents cannot be written as JSON.
    pub(super) fn seal(self, program: &str, contents: &impl Serialize) -> serde_json::Result<String> {
        let contents = to_raw_value(contents)?;
        serde_json::to_string(&Sealed {
            format: self.format().to_owned(),
            version: self.version(),
            program: program.to_owned(),
            crc32: Some(checksum(&contents)),
            run: Some(&contents),
            sensor: None,
        })
    }
}

/// Fields that identify a JSON file of Decoupler. They are read before the rest, which differs between versions.
#[derive(Deserialize)]
struct Heading {
    format: Value,
    #[serde(default)]
    version: Value,
    #[serde(default)]
    program: Value,
}

/// Layout of a file with a checksum, which detects any change to its contents.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sealed<'a> {
    format: String,
    version: u64,
    program: String,
    /// CRC-32 of the text of `run`, as hexadecimal digits.
    crc32: Option<String>,
    #[serde(borrow)]
    run: Option<&'a RawValue>,
    /// Contents of a sensor file that is written by hand, without a checksum.
    #[serde(borrow, skip_serializing_if = "Option::is_none")]
    sensor: Option<&'a RawValue>,
}

fn checksum(run: &RawValue) -> String {
    format!("{:08x}", crc32fast::hash(run.get().as_bytes()))
}

/// Returns true if JSON ends too early. The parser reports an incomplete number at the end, such as `1e`, as invalid.
fn is_cut_off(bytes: &[u8], error: &serde_json::Error) -> bool {
    let text = bytes.trim_ascii_end();
    let last_line = text.rsplit(|byte| *byte == b'\n').next().unwrap_or_default();
    let lines = 1 + text.iter().filter(|byte| **byte == b'\n').count();
    let is_in_last_number = error.is_syntax()
        && error.to_string().starts_with("invalid number")
        && (error.line(), error.column()) >= (lines, last_line.len())
        && !text.ends_with(b"}");
    error.is_eof() || is_in_last_number
}

/// Memory that a byte of JSON may take once it is read: short arrays of short numbers.
const MEMORY_OF_BYTE: u64 = 8;
/// Largest JSON file that is read or written, in bytes: 1 GiB.
const LARGEST_BYTES: u64 = 1 << 30;
/// Number of bytes that are read at once.
const BLOCK: u64 = 1 << 20;
/// Number of bytes that are read first, to decide whether to read the rest.
const BEGINNING: u64 = 1 << 16;

/// Reads the JSON file at `path`. If its beginning shows that Decoupler did not write it, returns only the beginning.
///
/// # Errors
/// The operating system refuses, or the file does not end within [`LARGEST_BYTES`], or it needs too much memory.
fn read_limited(path: &Path) -> io::Result<Vec<u8>> {
    let file = fs::File::open(path)?;
    let mut budget = ReadingBudget::now();
    // The length of a pipe or device is unknown; it is claimed block by block.
    let mut claimed = 0;
    let mut claim = |bytes: u64| {
        if bytes > LARGEST_BYTES {
            return Err(too_large());
        }
        let more = bytes.saturating_sub(claimed);
        claimed += more;
        let claimed = budget.claim(more * MEMORY_OF_BYTE);
        claimed.map_err(|over| io::Error::new(ErrorKind::FileTooLarge, over))
    };
    claim(file.metadata()?.len())?;
    let mut bytes = Vec::new();
    (&file).take(BEGINNING).read_to_end(&mut bytes)?;
    let begun = serde_json::from_slice::<Heading>(&bytes);
    if begun.is_err_and(|error| !is_cut_off(&bytes, &error)) {
        return Ok(bytes);
    }
    while (&file).take(BLOCK).read_to_end(&mut bytes)? > 0 {
        claim(bytes.len() as u64)?;
    }
    Ok(bytes)
}

fn too_large() -> io::Error {
    io::Error::new(
        ErrorKind::FileTooLarge,
        "it is larger than 1 GiB, the largest size of such files",
    )
}

/// Errors of reading or writing a network file, a checkpoint, a run list or the files of a sweep.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DocumentError {
    /// The operating system cannot read it.
    #[error("cannot read '{}': {}", .0.display(), system_cause(.1))]
    Read(PathBuf, #[source] io::Error),
    /// The file is of another kind or version, cut off or damaged, or is not saved because it could not be read back: the
    /// defect, with the field or with line and column, and what to do, as the rest of a sentence about the file.
    #[error("'{path}' {1}", path = .0.display())]
    Unusable(PathBuf, String),
    /// The samples are recorded, and no plan is given.
    #[error(
        "a {0} of recorded samples names the recording: give the plan that reads it, or save the networks with serde"
    )]
    NoPlan(DocumentKind),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl DocumentError {
    pub(super) fn unusable(path: &Path, defect: &str) -> Self {
        Self::Unusable(path.to_owned(), in_one_line(defect))
    }

    /// The contents for `path` could not be read back.
    pub(super) fn unsound(path: &Path, defect: impl fmt::Display) -> Self {
        let defect = format!("is not saved: {defect}; train again with other settings");
        Self::unusable(path, &defect)
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use rand::{Rng, SeedableRng, rngs::ChaCha8Rng};

    use super::*;

    #[test]
    fn only_the_beginning_of_other_files_than_json_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let read = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            read_limited(&path).unwrap()
        };
        let json = format!("{{\"format\":\"a\",\"text\":\"{}\"}}", "ä".repeat(100_000));
        assert_eq!(read(json.as_bytes()), json.as_bytes());
        let cut = &json.as_bytes()[..150_000];
        assert_eq!(read(cut), cut);
        assert_eq!(read(&[b'x'; 100_000]).len(), 1 << 16);
    }

    #[test]
    fn only_the_beginning_of_random_bytes_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let mut bytes = vec![0; 100_000];
        ChaCha8Rng::seed_from_u64(0).fill_bytes(&mut bytes);
        for first in 0..=u8::MAX {
            bytes[0] = first;
            fs::write(&path, &bytes).unwrap();
            assert_eq!(read_limited(&path).unwrap().len(), 1 << 16, "first byte {first}");
        }
    }

    #[test]
    fn oversized_files_are_refused_unread() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        fs::write(&path, "{\"format\":\"").unwrap();
        File::options()
            .write(true)
            .open(&path)
            .unwrap()
            .set_len(1 << 40)
            .unwrap();
        assert_eq!(read_limited(&path).unwrap_err().kind(), ErrorKind::FileTooLarge);
    }
}
