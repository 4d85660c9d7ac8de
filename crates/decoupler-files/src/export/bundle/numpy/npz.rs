//! Arrays in NumPy's format 1.0 (`.npy`) in an uncompressed ZIP archive (`.npz`).

use std::io::{Cursor, Read, Write};

use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter, result::ZipResult, write::SimpleFileOptions};

use crate::export::bundle::weights::Digits;

/// An array with its name.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct NamedArray {
    pub(super) name: String,
    pub(super) digits: Digits,
    pub(super) shape: Vec<usize>,
    /// Row by row.
    pub(super) values: Vec<f64>,
}

const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";

/// Writes the archive. The same arrays always give the same bytes.
pub(super) fn write(arrays: &[NamedArray]) -> Vec<u8> {
    let archive = || -> ZipResult<Vec<u8>> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(DateTime::default());
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        for array in arrays {
            archive.start_file(format!("{}.npy", array.name), options)?;
            archive.write_all(&write_array(array))?;
        }
        Ok(archive.finish()?.into_inner())
    };
    archive().expect("writing to memory does not fail, and every array has a short, unique name and less than 4 GB")
}

fn write_array(array: &NamedArray) -> Vec<u8> {
    let descr = match array.digits {
        Digits::Single => "<f4",
        Digits::Double => "<f8",
    };
    let sizes: Vec<_> = array.shape.iter().map(usize::to_string).collect();
    // A tuple of one element ends with a comma.
    let comma = if sizes.len() == 1 { "," } else { "" };
    let mut header = format!(
        "{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}{comma}), }}",
        sizes.join(", ")
    );
    // The values begin at a multiple of 64 bytes; the line ends the header.
    let padded = (MAGIC.len() + 2 + header.len() + 1).next_multiple_of(64);
    header += &" ".repeat(padded - MAGIC.len() - 2 - header.len() - 1);
    header.push('\n');
    let mut bytes = MAGIC.to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    for &value in &array.values {
        match array.digits {
            Digits::Single => bytes.extend((value as f32).to_le_bytes()),
            Digits::Double => bytes.extend(value.to_le_bytes()),
        }
    }
    bytes
}

/// Reads an archive that [`write`] wrote.
///
/// # Errors
/// A description of the first damage.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<NamedArray>, String> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let mut arrays = Vec::with_capacity(archive.len());
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).map_err(|error| error.to_string())?;
        let name = entry.name().map_err(|error| error.to_string())?;
        let name = name.trim_end_matches(".npy").to_owned();
        let mut contents = Vec::new();
        // The checksum is verified at the end of the entry.
        entry
            .read_to_end(&mut contents)
            .map_err(|error| format!("'{name}': {error}"))?;
        arrays.push(read_array(name, &contents)?);
    }
    Ok(arrays)
}

fn read_array(name: String, bytes: &[u8]) -> Result<NamedArray, String> {
    let damaged = || format!("the header of '{name}' is damaged");
    let header_size = usize::from(u16_at(bytes, MAGIC.len())?);
    let header = part(bytes, MAGIC.len() + 2, header_size)?;
    let header = std::str::from_utf8(header).map_err(|_| damaged())?;
    let (digits, width) = match header.split("'descr': '").nth(1).and_then(|rest| rest.get(..3)) {
        Some("<f4") => (Digits::Single, 4),
        Some("<f8") => (Digits::Double, 8),
        _ => return Err(damaged()),
    };
    let shape = header
        .split("'shape': (")
        .nth(1)
        .and_then(|rest| rest.split(')').next());
    let sizes = shape
        .ok_or_else(damaged)?
        .split(',')
        .map(str::trim)
        .filter(|size| !size.is_empty());
    let shape: Vec<usize> = sizes
        .map(|size| size.parse().map_err(|_| damaged()))
        .collect::<Result<_, _>>()?;
    let count: usize = shape.iter().product();
    let values = part(bytes, MAGIC.len() + 2 + header_size, count * width)?;
    let value = |bytes: &[u8]| match *bytes {
        [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => f64::NAN,
    };
    let values = values.chunks(width).map(value).collect();
    Ok(NamedArray {
        name,
        digits,
        shape,
        values,
    })
}

fn part(bytes: &[u8], start: usize, size: usize) -> Result<&[u8], String> {
    let part = bytes.get(start..).and_then(|rest| rest.get(..size));
    part.ok_or_else(|| "it is cut off".to_owned())
}

fn u16_at(bytes: &[u8], start: usize) -> Result<u16, String> {
    let two = part(bytes, start, 2)?;
    Ok(u16::from_le_bytes([two[0], two[1]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrays() -> Vec<NamedArray> {
        let array = |name: &str, digits, shape: &[usize], values: &[f64]| NamedArray {
            name: name.to_owned(),
            digits,
            shape: shape.to_vec(),
            values: values.to_vec(),
        };
        vec![
            array(
                "a",
                Digits::Double,
                &[1, 2, 3],
                &[1.0, -2.5, 1e-300, f64::MAX, 0.1, -0.0],
            ),
            array("of_singles", Digits::Single, &[2], &[0.5, f64::from(0.1_f32)]),
            array("empty", Digits::Double, &[0, 4], &[]),
        ]
    }

    #[test]
    fn arrays_round_trip() {
        assert_eq!(read(&write(&arrays())).unwrap(), arrays());
    }

    /// The header as NumPy 2.4 writes it.
    #[test]
    fn the_header_is_that_of_numpy() {
        let bytes = write_array(&arrays()[0]);
        let expected = b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (1, 2, 3), }";
        assert!(bytes.starts_with(expected), "{}", String::from_utf8_lossy(&bytes));
        assert_eq!((bytes[127], bytes.len()), (b'\n', 128 + 48));
        let text = String::from_utf8_lossy(&write_array(&arrays()[1])).into_owned();
        assert!(text.contains("'shape': (2,), }"), "{text}");
    }

    #[test]
    fn damage_is_detected() {
        let whole = write(&arrays());
        let mut changed = whole.clone();
        changed[200] ^= 1;
        assert!(read(&changed).is_err());
        for end in 0..200 {
            assert!(read(&whole[..end]).is_err(), "{end}");
        }
    }
}
