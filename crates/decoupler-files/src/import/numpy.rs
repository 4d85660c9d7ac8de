//! The `.npy` format, versions 1 to 3: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>.
//! The header is one line with three known keys, a Python literal that is read as JSON.

use std::io::{self, Read, Seek};

use serde::Deserialize;
use serde_json::Value;

use super::{
    TableError, Watch,
    archive::for_each_entry,
    format::{Array, Element, written},
};
use crate::machine::ReadingBudget;

/// Maximum length of a header in bytes.
const LONGEST_HEADER: usize = 1 << 16;

/// Reads an array: samples × any further dimensions. `budget` limits its memory.
pub(super) fn read(name: &str, source: &mut dyn Read, budget: &mut ReadingBudget) -> Result<Array, TableError> {
    let what = if name.is_empty() { "NumPy array" } else { name };
    let wrong = |reason: String| TableError::array(what, reason);
    let mut bytes = |count: usize| {
        let mut bytes = vec![0; count];
        source.read_exact(&mut bytes).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => wrong("it is cut off; copy it again".to_owned()),
            _ => error.into(),
        })?;
        Ok::<_, TableError>(bytes)
    };
    let start = bytes(8)?;
    if !start.starts_with(b"\x93NUMPY") {
        return Err(wrong("it is not a NumPy file; save it with numpy.save".to_owned()));
    }
    let of_length = match start[6] {
        1 => 2,
        2 | 3 => 4,
        version => {
            let reason = format!("version {version} of the format is unknown; save it with numpy.save");
            return Err(wrong(reason));
        }
    };
    let digits = bytes(of_length)?.into_iter().rev();
    let length = digits.fold(0, |length, byte| (length << 8) + usize::from(byte));
    if length > LONGEST_HEADER {
        return Err(wrong(format!("its header has {length} bytes; save it with numpy.save")));
    }
    let (header, element) = Header::parse(&String::from_utf8_lossy(&bytes(length)?)).map_err(wrong)?;
    let written = written(&header.shape);
    let bytes = header
        .shape
        .iter()
        .try_fold(element.size, |count, size| count.checked_mul(*size));
    let bytes = bytes.ok_or_else(|| wrong(format!("{written} numbers do not fit into memory")))?;
    let count = (bytes / element.size) as u64;
    if count == 0 {
        return Err(wrong(format!("it is empty ({written})")));
    }
    let numbers = element.read(source, count, budget)?;
    let found = numbers.len();
    if (found as u64) < count {
        return Err(wrong(format!(
            "it is cut off: its header states {written} numbers, but it has {found}; copy it again"
        )));
    }
    Ok(Array {
        name: name.to_owned(),
        shape: header.shape,
        numbers,
        is_by_column: header.fortran_order,
    })
}

/// Shape and type of an array, with the names of their keys.
#[derive(Deserialize)]
struct Header {
    descr: Value,
    /// `true` if the numbers are written column by column.
    fortran_order: bool,
    shape: Vec<usize>,
}

impl Header {
    /// Parses a header such as `{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }`.
    ///
    /// # Errors
    /// Cause and cure.
    fn parse(text: &str) -> Result<(Self, Element), String> {
        let mut json = text.replace('\'', "\"").replace('(', "[").replace(')', "]");
        // Python 2 wrote long integers with an L.
        for (python, other) in [
            ("False", "false"),
            ("True", "true"),
            ("L,", ","),
            ("L]", "]"),
            (" ", ""),
            (",]", "]"),
            (",}", "}"),
        ] {
            json = json.replace(python, other);
        }
        let header = serde_json::from_str::<Self>(&json);
        let header =
            header.map_err(|error| format!("its header is not understood: {error}; save it with numpy.save"))?;
        let Some(descr) = header.descr.as_str() else {
            return Err("it has named fields; save its columns as one array of numbers".to_owned());
        };
        let element = Element::of_code(descr).ok_or_else(|| {
            let descr: String = descr.chars().take(20).collect();
            format!("its type '{descr}' is not supported; convert it with .astype(float)")
        })?;
        Ok((header, element))
    }
}

/// Reads the arrays of an archive; returns them and the entries left out.
pub(super) fn read_archive(
    source: impl Read + Seek,
    budget: &mut ReadingBudget,
    watch: Watch<'_>,
) -> Result<(Vec<Array>, Vec<String>), TableError> {
    let (mut arrays, mut left_out) = (Vec::new(), Vec::new());
    for_each_entry(source, watch, |file_name, _, entry| {
        let Some(name) = file_name.strip_suffix(".npy") else {
            left_out.push(format!("{file_name} is not an .npy file"));
            return Ok(());
        };
        match read(name, entry, budget) {
            Ok(array) => arrays.push(array),
            // A text or a scalar next to the arrays does not make the file invalid.
            Err(TableError::Array(reason)) => {
                left_out.push(reason);
                return Ok(());
            }
            Err(error) => return Err(error),
        }
        match io::copy(entry, &mut io::sink())? {
            0 => Ok(()),
            rest => {
                let reason = format!("it has {rest} bytes more than its header states; copy it again");
                Err(TableError::damaged(name, reason))
            }
        }
    })?;
    Ok((arrays, left_out))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read_in_any_order() {
        let of = |text: &str| {
            let (header, element) = Header::parse(text).unwrap();
            (header.shape, header.fortran_order, element)
        };
        let found = of("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2), }  \n");
        assert_eq!(found, (vec![3, 2], false, Element::of_code("f8").unwrap()));
        let (shape, is_by_column, element) = of("{\"shape\":(5L,),\"fortran_order\":True,\"descr\":\">i2\"}");
        assert_eq!((shape, is_by_column, element.is_big), (vec![5], true, true));
    }

    #[test]
    fn unsupported_and_corrupt_headers_are_refused_with_a_reason() {
        let of = |descr: &str, shape: &str| {
            let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}");
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((header.len() as u16).to_le_bytes());
            bytes.extend(header.bytes());
            bytes.extend([0; 16]);
            read("a", &mut &bytes[..], &mut ReadingBudget::of(u64::MAX, true))
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
