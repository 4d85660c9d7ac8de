//! MAT-files of level 5, which MATLAB writes with `save` as `-v6` and `-v7`:
//! <https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf>. Numeric and logical arrays are read; other variables are
//! reported. No existing crate reports the variables it skips and limits the allocation for a corrupt length.

use std::io::Read;

use flate2::read::ZlibDecoder;

use super::{
    TableError,
    format::{Array, Element, Endian},
    input_lines::table_error,
};

/// Number of bytes read at once, so that a corrupt length allocates little memory.
const BLOCK: usize = 1 << 20;
const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;

/// Tag of an element of a file.
struct Tag {
    kind: u32,
    size: usize,
    /// Data of a small element, stored in its tag.
    small: Option<[u8; 4]>,
}

/// Reads the numeric arrays of a file; returns them and the variables left out.
pub(super) fn read(mut source: impl Read) -> Result<(Vec<Array>, Vec<String>), TableError> {
    let mut header = [0; 128];
    if !fill(&mut source, &mut header)? {
        return Err(wrong("it is cut off; copy it again"));
    }
    if header.starts_with(b"MATLAB 7.3") {
        return Err(wrong(
            "it has version 7.3 of the format, which is HDF5; save it with the option -v7",
        ));
    }
    let endian = match &header[126..] {
        b"IM" => Endian::Little,
        b"MI" => Endian::Big,
        _ => {
            return Err(wrong(
                "it is not a MAT-file of version 5 to 7; save it with the option -v7",
            ));
        }
    };
    let (mut arrays, mut left_out) = (Vec::new(), Vec::new());
    while let Some(tag) = Tag::read(&mut source, endian)? {
        match (tag.kind, tag.small) {
            (COMPRESSED, None) => {
                let mut limited = (&mut source).take(tag.size as u64);
                let mut inflated = ZlibDecoder::new(&mut limited);
                if let Some(Tag {
                    kind: MATRIX,
                    small: None,
                    size,
                }) = Tag::read(&mut inflated, endian)?
                {
                    variable(
                        &mut (&mut inflated).take(size as u64),
                        endian,
                        &mut arrays,
                        &mut left_out,
                    )?;
                }
                drain(&mut limited)?;
            }
            (MATRIX, None) => {
                let padding = tag.size.next_multiple_of(8) - tag.size;
                let mut limited = (&mut source).take(tag.size as u64);
                variable(&mut limited, endian, &mut arrays, &mut left_out)?;
                drain(&mut limited)?;
                drain(&mut (&mut source).take(padding as u64))?;
            }
            (_, Some(_)) => {}
            (_, None) => drain(&mut (&mut source).take(tag.size.next_multiple_of(8) as u64))?,
        }
    }
    Ok((arrays, left_out))
}

/// Reads one variable.
fn variable(
    source: &mut impl Read,
    endian: Endian,
    arrays: &mut Vec<Array>,
    left_out: &mut Vec<String>,
) -> Result<(), TableError> {
    let flags = Element::U32.read(&data(source, endian)?.1, endian);
    let dimensions = Element::I32.read(&data(source, endian)?.1, endian);
    let name = data(source, endian)?.1;
    let name: String = name
        .iter()
        .copied()
        .map(char::from)
        .filter(|letter| !letter.is_control())
        .collect();
    let flags = flags.first().copied().unwrap_or(0.0) as u32;
    let mut leave_out = |what: &str| {
        // MATLAB stores internal data in variables without a name.
        if !name.is_empty() {
            left_out.push(format!("{name} is {what}"));
        }
        Ok(())
    };
    match flags & 0xff {
        1 => return leave_out("a cell array"),
        2 => return leave_out("a structure; save its fields as variables"),
        4 => return leave_out("text"),
        5 => return leave_out("sparse; save it as full"),
        6..=15 if flags & 0x0800 != 0 => return leave_out("complex"),
        6..=15 => {}
        _ => return leave_out("an object"),
    }
    let &[rows, width] = &dimensions[..] else {
        return leave_out(&format!("an array of {} dimensions", dimensions.len()));
    };
    if !(rows >= 1.0 && width >= 1.0) {
        return leave_out("empty");
    }
    let (rows, width) = (rows as usize, width as usize);
    let (kind, bytes) = data(source, endian)?;
    let element = match kind {
        1 => Element::I8,
        2 => Element::U8,
        3 => Element::I16,
        4 => Element::U16,
        5 => Element::I32,
        6 => Element::U32,
        7 => Element::F32,
        9 => Element::F64,
        12 => Element::I64,
        13 => Element::U64,
        _ => {
            return Err(TableError::array(
                name,
                "its numbers have an unknown type; save it with the option -v7",
            ));
        }
    };
    let found = bytes.len() / element.size();
    if rows.checked_mul(width) != Some(found) {
        let reason = format!("it should have {rows} × {width} numbers and has {found}; save or copy it again");
        return Err(TableError::array(name, reason));
    }
    let numbers = element.read(&bytes, endian);
    // A row vector becomes a column of the table.
    let (rows, width) = if rows == 1 { (width, 1) } else { (rows, width) };
    arrays.push(Array::new(name, rows, width, numbers, true)?);
    Ok(())
}

/// Reads the type and data of an element within a variable.
fn data(source: &mut impl Read, endian: Endian) -> Result<(u32, Vec<u8>), TableError> {
    let tag = Tag::read(source, endian)?.ok_or_else(cut_off)?;
    if let Some(small) = tag.small {
        return Ok((tag.kind, small[..tag.size].to_vec()));
    }
    let mut bytes = Vec::new();
    while bytes.len() < tag.size {
        let wanted = (tag.size - bytes.len()).min(BLOCK);
        let read = source.take(wanted as u64).read_to_end(&mut bytes).map_err(damage)?;
        if read < wanted {
            return Err(cut_off());
        }
    }
    let padding = tag.size.next_multiple_of(8) - tag.size;
    drain(&mut source.take(padding as u64))?;
    Ok((tag.kind, bytes))
}

impl Tag {
    /// Reads a tag; `None` at the end.
    fn read(source: &mut impl Read, endian: Endian) -> Result<Option<Self>, TableError> {
        let mut bytes = [0; 8];
        if !fill(source, &mut bytes)? {
            return Ok(None);
        }
        let from = |bytes: [u8; 4]| match endian {
            Endian::Little => u32::from_le_bytes(bytes),
            Endian::Big => u32::from_be_bytes(bytes),
        };
        let [first, second] = [
            [bytes[0], bytes[1], bytes[2], bytes[3]],
            [bytes[4], bytes[5], bytes[6], bytes[7]],
        ];
        let kind = from(first);
        let small_size = (kind >> 16) as usize;
        if small_size > 4 {
            return Err(wrong("an element has an invalid length; copy it again"));
        }
        Ok(Some(if small_size > 0 {
            Self {
                kind: kind & 0xffff,
                size: small_size,
                small: Some(second),
            }
        } else {
            Self {
                kind,
                size: from(second) as usize,
                small: None,
            }
        }))
    }
}

fn wrong(reason: &str) -> TableError {
    TableError::array("MAT-file", reason)
}

fn cut_off() -> TableError {
    wrong("it is cut off; copy it again")
}

/// Fills `buffer`; returns `false` if the source is too short.
fn fill(source: &mut impl Read, buffer: &mut [u8]) -> Result<bool, TableError> {
    match source.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(damage(error)),
    }
}

fn drain(source: &mut impl Read) -> Result<(), TableError> {
    std::io::copy(source, &mut std::io::sink()).map_err(damage)?;
    Ok(())
}

/// Converts a decompression error; other I/O errors are passed on.
fn damage(error: std::io::Error) -> TableError {
    match error.kind() {
        std::io::ErrorKind::InvalidInput | std::io::ErrorKind::InvalidData => {
            wrong("its compressed data is corrupt; copy it again")
        }
        _ => table_error(error),
    }
}
