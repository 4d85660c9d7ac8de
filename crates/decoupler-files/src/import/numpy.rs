//! The `.npy` format, versions 1 to 3: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>.
//! The header is one line with three known keys, a Python literal that is read as JSON.

use std::io::{self, Read, Seek, SeekFrom};

use serde::Deserialize;
use serde_json::Value;
use zip::{ZipArchive, result::ZipError};

use super::{
    TableError, Watch,
    format::{Array, Element, Endian, written},
    numpy,
    progress::{Watched, table_error},
};
use crate::machine::ReadingBudget;

/// Maximum length of a header in bytes.
const LONGEST_HEADER: usize = 1 << 16;
/// Memory of a number in bytes.
const NUMBER: u64 = size_of::<f64>() as u64;
/// Number of bytes read at once, so that a corrupt header allocates little memory.
const BLOCK: usize = 1 << 20;

/// Shape and type of an array.
#[derive(Debug, PartialEq)]
struct Header {
    element: Element,
    endian: Endian,
    is_by_column: bool,
    shape: Vec<usize>,
}

/// Reads an array: samples × any further dimensions. `budget` limits its memory.
pub(super) fn read(name: &str, mut source: impl Read, budget: &mut ReadingBudget) -> Result<Array, TableError> {
    let what = if name.is_empty() { "NumPy array" } else { name };
    let wrong = |reason: String| TableError::array(what, reason);
    let mut bytes = |count: usize| {
        let mut bytes = vec![0; count];
        source.read_exact(&mut bytes).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => wrong("it is cut off; copy it again".to_owned()),
            _ => table_error(error),
        })?;
        Ok::<_, TableError>(bytes)
    };
    let [b'\x93', b'N', b'U', b'M', b'P', b'Y', major, _] = bytes(8)?[..] else {
        return Err(wrong("it is not a NumPy file; save it with numpy.save".to_owned()));
    };
    let of_length = match major {
        1 => 2,
        2 | 3 => 4,
        _ => {
            return Err(wrong(format!(
                "version {major} of the format is unknown; save it with numpy.save"
            )));
        }
    };
    let length = bytes(of_length)?
        .iter()
        .rev()
        .fold(0, |length, byte| (length << 8) + usize::from(*byte));
    if length > LONGEST_HEADER {
        return Err(wrong(format!("its header has {length} bytes; save it with numpy.save")));
    }
    let header = Header::parse(&String::from_utf8_lossy(&bytes(length)?)).map_err(wrong)?;
    let shape = header.shape.as_slice();
    let size = header.element.size;
    let expected = shape.iter().copied().try_fold(size, usize::checked_mul);
    let written = written(shape);
    let expected = expected.ok_or_else(|| wrong(format!("{written} numbers do not fit into memory")))?;
    if expected == 0 {
        return Err(wrong(format!("it is empty ({written})")));
    }
    let count = (expected / size) as u64;
    // The numbers in the order of the file are freed once they are copied to their columns.
    budget.claim(count.saturating_mul(2 * NUMBER))?;
    let (mut numbers, mut block) = (Vec::new(), Vec::new());
    while numbers.len() * size < expected {
        block.clear();
        let wanted = (expected - numbers.len() * size).min(BLOCK);
        let read = (&mut source).take(wanted as u64).read_to_end(&mut block);
        read.map_err(table_error)?;
        numbers.append(&mut header.element.read(&block, header.endian));
        if block.len() < wanted {
            let found = numbers.len();
            return Err(wrong(format!(
                "it is cut off: its header states {written} numbers, but it has {found}; copy it again"
            )));
        }
    }
    let array = Array::new(name.to_owned(), shape, numbers, header.is_by_column)?;
    budget.release(count * NUMBER);
    Ok(array)
}

/// Header as written, with the names of its keys.
#[derive(Deserialize)]
struct Written {
    descr: Value,
    fortran_order: bool,
    shape: Vec<usize>,
}

impl Header {
    /// Parses a header such as `{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }`.
    ///
    /// # Errors
    /// Cause and cure.
    fn parse(text: &str) -> Result<Self, String> {
        let mut json = text.replace('\'', "\"").replace('(', "[").replace(')', "]");
        // Python 2 wrote long integers with an L.
        for (python, other) in [
            ("False", "false"),
            ("True", "true"),
            ("L,", ","),
            ("L]", "]"),
            (" ", ""),
        ] {
            json = json.replace(python, other);
        }
        let json = json.replace(",]", "]").replace(",}", "}");
        let written = serde_json::from_str::<Written>(&json);
        let written =
            written.map_err(|error| format!("its header is not understood: {error}; save it with numpy.save"))?;
        let Value::String(descr) = written.descr else {
            return Err("it has named fields; save its columns as one array of numbers".to_owned());
        };
        let endian = if descr.starts_with('>') {
            Endian::Big
        } else {
            Endian::Little
        };
        let element = Element::of_code(descr.trim_start_matches(['>', '<', '|', '='])).ok_or_else(|| {
            let descr: String = descr.chars().take(20).collect();
            format!("its type '{descr}' is not supported; convert it with .astype(float)")
        })?;
        Ok(Self {
            element,
            endian,
            is_by_column: written.fortran_order,
            shape: written.shape,
        })
    }
}

/// Reads the arrays of an archive; returns them and the entries left out. Each entry is read to its end, where its checksum is
/// verified, since a damaged header can make an array look like something to leave out.
pub(super) fn read_archive(
    mut source: impl Read + Seek,
    budget: &mut ReadingBudget,
    watch: Watch<'_>,
) -> Result<(Vec<Array>, Vec<String>), TableError> {
    check_names(&mut source)?;
    let mut archive = ZipArchive::new(source).map_err(|error| defect("the archive", error))?;
    let mut arrays = Vec::new();
    let mut left_out = Vec::new();
    for index in 0..archive.len() {
        let entry = archive.by_index(index).map_err(|error| defect("the archive", error))?;
        let file_name = entry.name().map_err(|error| defect("the archive", error))?.into_owned();
        let Some(name) = file_name.strip_suffix(".npy").map(str::to_owned) else {
            left_out.push(format!("{file_name} is not an .npy file"));
            continue;
        };
        let size = entry.size();
        let mut entry = Watched::new(entry, Some(size), watch);
        let array = numpy::read(&name, &mut entry, budget);
        let rest = match array {
            // Without its end, a part of a damaged entry may be larger than memory or endless.
            Err(TableError::Cancelled | TableError::OverBudget(_)) => 0,
            _ => io::copy(&mut entry, &mut io::sink()).map_err(|error| damage(&name, error))?,
        };
        match array {
            Ok(_) if rest > 0 => {
                let reason = format!("it has {rest} bytes more than its header states; copy it again");
                return Err(TableError::damaged(&name, reason));
            }
            Ok(array) => arrays.push(array),
            // A text or a scalar next to the arrays does not make the file invalid.
            Err(TableError::Array(reason)) => left_out.push(reason),
            Err(TableError::Io(error)) => return Err(damage(&name, error)),
            Err(error) => return Err(error),
        }
    }
    Ok((arrays, left_out))
}

/// Checks that the name of each entry is the same at its data and in the directory at the end of the archive, so that a damaged
/// name does not become the name of a column.
pub(super) fn check_names(source: &mut (impl Read + Seek)) -> Result<(), TableError> {
    /// Length of a header before the name of its entry.
    const HEADER: usize = 30;
    let mut archive = ZipArchive::new(&mut *source).map_err(|error| defect("the archive", error))?;
    let mut entries = Vec::new();
    for index in 0..archive.len() {
        let entry = archive
            .by_index_raw(index)
            .map_err(|error| defect("the archive", error))?;
        entries.push((entry.header_start(), entry.name_raw().to_vec()));
    }
    drop(archive);
    for (start, name) in entries {
        let mut header = vec![0; HEADER + name.len()];
        source.seek(SeekFrom::Start(start))?;
        source.read_exact(&mut header)?;
        let length = usize::from(u16::from_le_bytes([header[26], header[27]]));
        if length != name.len() || header[HEADER..] != name {
            let reason = "an entry has two names; copy it again";
            return Err(TableError::damaged("the archive", reason));
        }
    }
    source.rewind()?;
    Ok(())
}

/// Returns the error of reading the entry `name` of an archive.
pub(super) fn damage(name: &str, error: io::Error) -> TableError {
    match error.kind() {
        io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput | io::ErrorKind::UnexpectedEof => {
            TableError::damaged(name, "its contents do not match its checksum; copy it again")
        }
        _ => table_error(error),
    }
}

fn defect(what: &str, error: ZipError) -> TableError {
    match error {
        ZipError::Io(error) => table_error(error),
        error => TableError::damaged(what, format!("{error}; copy it again, or save it again")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read_in_any_order() {
        let header = Header::parse("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }  \n").unwrap();
        let (element, endian) = (Element::of_code("f8").unwrap(), Endian::Little);
        let expected = Header {
            element,
            endian,
            is_by_column: false,
            shape: vec![3, 2],
        };
        assert_eq!(header, expected);
        let header = Header::parse("{\"shape\":(5L,),\"fortran_order\":True,\"descr\":\">i2\"}").unwrap();
        assert_eq!(
            (header.endian, header.is_by_column, header.shape),
            (Endian::Big, true, vec![5])
        );
    }

    #[test]
    fn unsupported_and_corrupt_headers_are_refused_with_a_reason() {
        let of = |descr: &str, shape: &str| {
            let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}");
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((header.len() as u16).to_le_bytes());
            bytes.extend(header.bytes());
            bytes.extend([0; 16]);
            read("a", &bytes[..], &mut ReadingBudget::of(u64::MAX, true))
                .unwrap_err()
                .to_string()
        };
        for (descr, shape, cause) in [
            ("'|O'", "(2,)", "'|O' is not supported"),
            ("'<c16'", "(1,)", "'<c16' is not supported"),
            ("[('x', '<f8')]", "(2,)", "named fields"),
            ("'<f8'", "(18446744073709551615, 2)", "do not fit into memory"),
            (
                "'<f8'",
                "(99999999999, 2)",
                "states 99999999999 × 2 numbers, but it has 2",
            ),
            ("'<f8'", "(0, 2)", "it is empty (0 × 2)"),
            ("'<f8'", "(x, 2)", "is not understood"),
            ("'<f8", "(2,)", "is not understood"),
        ] {
            let error = of(descr, shape);
            assert!(error.contains(cause), "{descr} {shape}: {error}");
        }
    }
}
