//! Arrays in NumPy's format 1.0 (`.npy`), kept in an uncompressed ZIP archive (`.npz`). Written and read here: the crates
//! for it bring a parser of Python literals, and with that a C compiler, or compression and encryption.

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
const LOCAL_FILE: u32 = 0x0403_4b50;
const CENTRAL_FILE: u32 = 0x0201_4b50;
const END: u32 = 0x0605_4b50;
/// 1 January 1980, the first day of the format: the same network gives the same file.
const DATE: u16 = (1 << 5) | 1;
/// Version 2.0 of the format.
const VERSION: u16 = 20;

/// Writes the archive.
pub(super) fn write(arrays: &[NamedArray]) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for array in arrays {
        let contents = write_array(array);
        let (name, offset) = (format!("{}.npy", array.name), bytes.len() as u32);
        let mut common = Vec::new();
        for part in [VERSION, 0, 0, 0, DATE] {
            common.extend(part.to_le_bytes());
        }
        let size = contents.len() as u32;
        for part in [crc32fast::hash(&contents), size, size] {
            common.extend(part.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        // No extra field.
        common.extend(0_u16.to_le_bytes());
        bytes.extend(LOCAL_FILE.to_le_bytes());
        bytes.extend(&common);
        bytes.extend(name.as_bytes());
        bytes.extend(&contents);
        directory.extend(CENTRAL_FILE.to_le_bytes());
        directory.extend(VERSION.to_le_bytes());
        directory.extend(&common);
        // Comment, disk and attributes.
        directory.extend([0; 10]);
        directory.extend(offset.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (offset, count) = (bytes.len() as u32, arrays.len() as u16);
    bytes.extend(&directory);
    bytes.extend(END.to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend([count.to_le_bytes(), count.to_le_bytes()].concat());
    bytes.extend((directory.len() as u32).to_le_bytes());
    bytes.extend(offset.to_le_bytes());
    bytes.extend([0; 2]);
    bytes
}

fn write_array(array: &NamedArray) -> Vec<u8> {
    let descr = match array.digits {
        Digits::Single => "<f4",
        Digits::Double => "<f8",
    };
    let sizes: Vec<_> = array.shape.iter().map(usize::to_string).collect();
    // A tuple of one has a comma after it.
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
    let mut arrays = Vec::new();
    let mut rest = bytes;
    while u32_at(rest, 0)? == LOCAL_FILE {
        let (checksum, size) = (u32_at(rest, 14)?, u32_at(rest, 22)? as usize);
        let name_size = usize::from(u16_at(rest, 26)?);
        let name = part(rest, 30, name_size)?;
        let contents = part(rest, 30 + name_size, size)?;
        let name = String::from_utf8_lossy(name).trim_end_matches(".npy").to_owned();
        if crc32fast::hash(contents) != checksum {
            return Err(format!("the checksum of '{name}' is wrong"));
        }
        arrays.push(read_array(name, contents)?);
        rest = &rest[30 + name_size + size..];
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

fn u32_at(bytes: &[u8], start: usize) -> Result<u32, String> {
    Ok(u32::from(u16_at(bytes, start)?) | u32::from(u16_at(bytes, start + 2)?) << 16)
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
    fn arrays_come_back() {
        assert_eq!(read(&write(&arrays())).unwrap(), arrays());
    }

    /// The header as NumPy 2.4 writes it.
    #[test]
    fn the_header_is_numpys() {
        let bytes = write_array(&arrays()[0]);
        let expected = b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (1, 2, 3), }";
        assert!(bytes.starts_with(expected), "{}", String::from_utf8_lossy(&bytes));
        assert_eq!((bytes[127], bytes.len()), (b'\n', 128 + 48));
        let text = String::from_utf8_lossy(&write_array(&arrays()[1])).into_owned();
        assert!(text.contains("'shape': (2,), }"), "{text}");
    }

    #[test]
    fn damage_is_noticed() {
        let whole = write(&arrays());
        let mut changed = whole.clone();
        changed[200] ^= 1;
        assert!(read(&changed).is_err());
        for end in 0..200 {
            assert!(read(&whole[..end]).is_err(), "{end}");
        }
    }
}
