//! MAT-files of level 5, which MATLAB writes with `save` as `-v6` and `-v7`:
//! <https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf>. Numeric and logical arrays, and those in
//! structures, are read; other variables are reported. No existing crate reports the variables it skips and limits the allocation for a corrupt length.

use std::io::Read;

use flate2::read::ZlibDecoder;

use super::{
    TableError,
    format::{Array, Element, Endian, written},
    progress::table_error,
};
use crate::machine::ReadingBudget;

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

/// Reads the numeric arrays of a file; returns them and the variables left out. `budget` limits their memory.
pub(super) fn read(mut source: impl Read, budget: &mut ReadingBudget) -> Result<(Vec<Array>, Vec<String>), TableError> {
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
    let mut variable = |source: &mut dyn Read| {
        let (name, value) = Value::read(source, endian, budget, 0)?;
        // MATLAB stores internal data, such as `__function_workspace__`, in variables without a name.
        if !name.is_empty() {
            value.add(name, &mut arrays, &mut left_out);
        }
        drain(source)
    };
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
                    let mut matrix = (&mut inflated).take(size as u64);
                    variable(&mut matrix)?;
                }
                // The checksum is verified at the end of the data.
                if fill(&mut inflated, &mut [0])? {
                    let reason = "it has more data than it states; copy it again";
                    return Err(TableError::damaged("a variable", reason));
                }
                if inflated.total_in() != tag.size as u64 {
                    return Err(TableError::damaged("a variable", "its length is wrong; copy it again"));
                }
            }
            (MATRIX, None) => {
                let padding = tag.size.next_multiple_of(8) - tag.size;
                let mut limited = (&mut source).take(tag.size as u64);
                variable(&mut limited)?;
                if limited.limit() > 0 {
                    return Err(cut_off());
                }
                drain(&mut (&mut source).take(padding as u64))?;
            }
            _ => return Err(TableError::damaged("a variable", "its kind is unknown; copy it again")),
        }
    }
    Ok((arrays, left_out))
}

/// Maximum depth of structures in structures.
const DEEPEST: usize = 8;
/// Maximum number of fields times elements of a structure.
const MAX_FIELDS: usize = 1 << 20;
/// Memory of a field of a structure in bytes, without its numbers.
const FIELD: u64 = 128;
/// Maximum length of names, shapes and flags in bytes.
const LONGEST: usize = 1 << 16;

/// Value of a variable or a field.
enum Value {
    /// Numbers, column by column.
    Numbers { shape: Vec<usize>, numbers: Vec<f64> },
    /// Structures: the name of each field with its value in each structure.
    Structures(Vec<(String, Vec<Value>)>),
    /// Anything else: what it is.
    Other(String),
}

impl Value {
    /// Reads a matrix and its name.
    fn read(
        mut source: &mut dyn Read,
        endian: Endian,
        budget: &mut ReadingBudget,
        depth: usize,
    ) -> Result<(String, Self), TableError> {
        let flags = Element::U32.read(&short_data(&mut source, endian)?, endian);
        let shape = Element::I32.read(&short_data(&mut source, endian)?, endian);
        let name = text(&short_data(&mut source, endian)?);
        let flags = flags.first().copied().unwrap_or(0.0) as u32;
        let other = |what: &str| Self::Other(what.to_owned());
        let value = match flags & 0xff {
            1 => other("a cell array"),
            2 if depth == DEEPEST => other("a structure within too many others"),
            2 => return Ok((name, Self::structures(source, endian, &shape, budget, depth)?)),
            4 => other("text"),
            5 => other("sparse; save it as full"),
            6..=15 if flags & 0x0800 != 0 => other("complex"),
            6..=15 => Self::numbers(source, endian, &name, &shape, budget)?,
            _ => other("an object"),
        };
        Ok((name, value))
    }

    fn numbers(
        mut source: &mut dyn Read,
        endian: Endian,
        name: &str,
        shape: &[f64],
        budget: &mut ReadingBudget,
    ) -> Result<Self, TableError> {
        if shape.is_empty() || shape.iter().any(|size| *size < 1.0) {
            return Ok(Self::Other("empty".to_owned()));
        }
        let shape = Vec::from_iter(shape.iter().map(|size| *size as usize));
        let (kind, bytes) = data(&mut source, endian, budget)?;
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
        let expected = shape.iter().copied().try_fold(1, usize::checked_mul);
        if expected != Some(found) {
            let reason = format!(
                "it should have {} numbers and has {found}; save or copy it again",
                written(&shape)
            );
            return Err(TableError::array(name, reason));
        }
        // The numbers in the order of the file are freed once they are copied to their columns.
        budget.claim((found as u64).saturating_mul(2 * size_of::<f64>() as u64))?;
        let numbers = element.read(&bytes, endian);
        budget.release(bytes.len() as u64);
        Ok(Self::Numbers { shape, numbers })
    }

    /// Reads the fields of `shape` structures.
    fn structures(
        mut source: &mut dyn Read,
        endian: Endian,
        shape: &[f64],
        budget: &mut ReadingBudget,
        depth: usize,
    ) -> Result<Self, TableError> {
        let length = Element::I32.read(&short_data(&mut source, endian)?, endian);
        let length = length.first().map_or(0, |length| *length as usize);
        let (_, names) = data(&mut source, endian, budget)?;
        let count: f64 = shape.iter().product();
        let width = names.len().checked_div(length).unwrap_or(0);
        if count.max(1.0) * width as f64 > MAX_FIELDS as f64 {
            return Ok(Self::Other("a structure with too many fields".to_owned()));
        }
        budget.claim((count.max(1.0) * width as f64) as u64 * FIELD)?;
        let mut fields = Vec::new();
        if length > 0 {
            fields.extend(names.chunks_exact(length).map(|name| (text(name), Vec::new())));
        }
        // Without fields, a shape of any size has no data.
        let elements = if fields.is_empty() { 0 } else { count as usize };
        for _ in 0..elements {
            for (_, values) in &mut fields {
                let tag = Tag::read(&mut source, endian)?.ok_or_else(cut_off)?;
                let mut limited = (&mut source).take(tag.size as u64);
                let value = match (tag.kind, tag.size) {
                    (MATRIX, 1..) => Self::read(&mut limited, endian, budget, depth + 1)?.1,
                    _ => Self::Other("empty".to_owned()),
                };
                drain(&mut limited)?;
                values.push(value);
            }
        }
        Ok(Self::Structures(fields))
    }

    /// Adds the numbers as arrays, those of a field named `variable.field`, and notes what is left out.
    fn add(self, name: String, arrays: &mut Vec<Array>, left_out: &mut Vec<String>) {
        match self {
            Self::Other(what) => left_out.push(format!("{name} is {what}")),
            Self::Numbers { shape, numbers } => {
                // A row vector becomes a column of the table.
                let first = shape.iter().position(|&size| size > 1).unwrap_or(shape.len() - 1);
                match Array::new(name, &shape[first..], numbers, true) {
                    Ok(array) => arrays.push(array),
                    Err(error) => left_out.push(error.to_string()),
                }
            }
            Self::Structures(fields) => {
                for (field, values) in fields {
                    let name = format!("{name}.{field}");
                    match stacked(values) {
                        Some(value) => value.add(name, arrays, left_out),
                        None => left_out.push(format!("{name} has values of several shapes or kinds")),
                    }
                }
            }
        }
    }
}

/// Stacks the values of a field in several structures: vectors of one length become the rows of a matrix. `None` if their
/// shapes differ.
fn stacked(mut values: Vec<Value>) -> Option<Value> {
    if values.len() == 1 {
        return values.pop();
    }
    let vector = |value| match value {
        Value::Numbers { shape, numbers } if shape.iter().filter(|size| **size > 1).count() <= 1 => Some(numbers),
        Value::Numbers { .. } | Value::Structures(_) | Value::Other(_) => None,
    };
    let rows: Vec<Vec<f64>> = values.into_iter().map(vector).collect::<Option<_>>()?;
    let width = rows.first()?.len();
    if rows.iter().any(|row| row.len() != width) {
        return None;
    }
    let column = |place: usize| rows.iter().map(move |row| row[place]);
    Some(Value::Numbers {
        shape: vec![rows.len(), width],
        numbers: (0..width).flat_map(column).collect(),
    })
}

/// Returns the name in `bytes`, which ends at a zero byte.
fn text(bytes: &[u8]) -> String {
    let letters = bytes.iter().copied().take_while(|byte| *byte != 0).map(char::from);
    letters.filter(|letter| !letter.is_control()).collect()
}

/// Reads the type and data of an element within a variable.
fn data(source: &mut dyn Read, endian: Endian, budget: &mut ReadingBudget) -> Result<(u32, Vec<u8>), TableError> {
    let tag = Tag::read(source, endian)?.ok_or_else(cut_off)?;
    budget.claim(tag.size as u64)?;
    contents(source, tag)
}

/// Reads the data of a name, a shape or flags.
fn short_data(source: &mut dyn Read, endian: Endian) -> Result<Vec<u8>, TableError> {
    match Tag::read(source, endian)?.ok_or_else(cut_off)? {
        tag if tag.size > LONGEST => Err(wrong("an element has an invalid length; copy it again")),
        tag => Ok(contents(source, tag)?.1),
    }
}

/// Reads the data of the element with this tag.
fn contents(source: &mut dyn Read, tag: Tag) -> Result<(u32, Vec<u8>), TableError> {
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
    fn read(source: &mut dyn Read, endian: Endian) -> Result<Option<Self>, TableError> {
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

/// Fills `buffer`; returns `false` at the end of the source.
fn fill(source: &mut dyn Read, buffer: &mut [u8]) -> Result<bool, TableError> {
    let mut filled = 0;
    while filled < buffer.len() {
        match source.read(&mut buffer[filled..]).map_err(damage)? {
            0 if filled == 0 => return Ok(false),
            0 => return Err(cut_off()),
            read => filled += read,
        }
    }
    Ok(true)
}

fn drain(source: &mut dyn Read) -> Result<(), TableError> {
    std::io::copy(source, &mut std::io::sink()).map_err(damage)?;
    Ok(())
}

/// Converts a decompression error; other I/O errors are passed on.
fn damage(error: std::io::Error) -> TableError {
    match error.kind() {
        std::io::ErrorKind::InvalidInput | std::io::ErrorKind::InvalidData => {
            TableError::damaged("a variable", "its compressed data is corrupt; copy it again")
        }
        std::io::ErrorKind::UnexpectedEof => cut_off(),
        _ => table_error(error),
    }
}
