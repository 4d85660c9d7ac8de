//! MAT-files of level 5, which MATLAB writes with `save` as `-v6` and `-v7`:
//! <https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf>. Numeric and logical arrays, and those in
//! structures, are read; other variables are reported. No existing crate reports the variables it skips and limits the allocation for a corrupt length.

use std::io::{self, Read};

use flate2::read::ZlibDecoder;

use super::{
    TableError,
    format::{Array, Element, written},
};
use crate::machine::ReadingBudget;

const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;
/// Class of structures.
const STRUCTURES: i32 = 2;
/// Types of numbers by their codes in NumPy.
const CODES: [&str; 14] = [
    "", "i1", "u1", "i2", "u2", "i4", "u4", "f4", "", "f8", "", "", "i8", "u8",
];
/// Maximum depth of structures in structures.
const DEEPEST: usize = 8;
/// Maximum number of fields times elements of a structure.
const MAX_FIELDS: usize = 1 << 20;
/// Memory of a field of a structure in bytes, without its numbers.
const FIELD: u64 = 128;
/// Number of bytes that contain the flags, the shape and the name of a variable.
const HEAD: usize = 1 << 18;

/// Reads the numeric arrays of a file; returns them and the variables left out. `budget` limits their memory.
pub(super) fn read(mut source: impl Read, budget: &mut ReadingBudget) -> Result<(Vec<Array>, Vec<String>), TableError> {
    let header = up_to(&mut source, 128)?;
    if header.starts_with(b"MATLAB 7.3") {
        let reason = "it has version 7.3 of the format, which is HDF5; save it with the option -v7";
        return Err(wrong(reason));
    }
    let is_big = match header.get(126..).ok_or_else(cut_off)? {
        b"IM" => false,
        b"MI" => true,
        _ => {
            let reason = "it is not a MAT-file of version 5 to 7; save it with the option -v7";
            return Err(wrong(reason));
        }
    };
    let mut found = Variables::default();
    while let Some(tag) = parsed(&up_to(&mut source, 8)?, is_big)? {
        match tag {
            (COMPRESSED, size, false) => {
                let mut inflated = ZlibDecoder::new((&mut source).take(size as u64));
                let tag = up_to(&mut inflated, 8)?;
                if let Some((MATRIX, size, false)) = parsed(&tag, is_big)? {
                    found.read(&mut inflated, size, is_big, budget)?;
                }
                // The checksum is verified at the end of the data.
                if !up_to(&mut inflated, 1)?.is_empty() {
                    let reason = "it has more data than it states; copy it again";
                    return Err(TableError::damaged("a variable", reason));
                }
                if inflated.total_in() != size as u64 {
                    return Err(TableError::damaged("a variable", "its length is wrong; copy it again"));
                }
            }
            (MATRIX, size, false) => {
                found.read(&mut source, size, is_big, budget)?;
                up_to(&mut source, size.next_multiple_of(8) - size)?;
            }
            _ => return Err(TableError::damaged("a variable", "its kind is unknown; copy it again")),
        }
    }
    Ok((found.arrays, found.left_out))
}

/// Variables of a file.
#[derive(Default)]
struct Variables {
    arrays: Vec<Array>,
    left_out: Vec<String>,
}

impl Variables {
    /// Reads a variable of `size` bytes; of one that is left out, only its name.
    fn read(
        &mut self,
        source: &mut dyn Read,
        size: usize,
        is_big: bool,
        budget: &mut ReadingBudget,
    ) -> Result<(), TableError> {
        let mut bytes = up_to(source, size.min(HEAD))?;
        let (flags, _, name) = Elements { bytes: &bytes, is_big }.head()?;
        let left = size - bytes.len();
        // MATLAB stores internal data, such as `__function_workspace__`, in variables without a name.
        if name.is_empty() || left_out(flags).is_some() {
            let note = left_out(flags).map(|what| format!("{name} is {what}"));
            self.left_out.extend(note.filter(|_| !name.is_empty()));
            io::copy(&mut source.take(left as u64), &mut io::sink()).map_err(damage)?;
            return Ok(());
        }
        budget.claim(size as u64)?;
        bytes.append(&mut up_to(source, left)?);
        let value = Elements { bytes: &bytes, is_big }.matrix(budget, 0)?;
        drop(bytes);
        budget.release(size as u64);
        self.add(name, value);
        Ok(())
    }

    /// Adds the numbers as arrays, those of a field named `variable.field`, and notes what is left out.
    fn add(&mut self, name: String, value: Value) {
        match value {
            Value::Other(what) => self.left_out.push(format!("{name} is {what}")),
            Value::Numbers { shape, numbers } => {
                // A row vector becomes a column of the table.
                let first = shape.iter().position(|&size| size > 1).unwrap_or(shape.len() - 1);
                let (shape, is_by_column) = (shape[first..].to_vec(), true);
                self.arrays.push(Array {
                    name,
                    shape,
                    numbers,
                    is_by_column,
                });
            }
            Value::Structures(fields) => {
                for (field, values) in fields {
                    let name = format!("{name}.{field}");
                    match stacked(values) {
                        Some(value) => self.add(name, value),
                        None => self
                            .left_out
                            .push(format!("{name} has values of several shapes or kinds")),
                    }
                }
            }
        }
    }
}

/// Value of a variable or a field.
enum Value {
    /// Numbers, column by column.
    Numbers { shape: Vec<usize>, numbers: Vec<f64> },
    /// Structures: the name of each field with its value in each structure.
    Structures(Vec<(String, Vec<Value>)>),
    /// Anything else: what it is.
    Other(&'static str),
}

/// Elements of a variable, which follow each other.
struct Elements<'a> {
    bytes: &'a [u8],
    is_big: bool,
}

impl<'a> Elements<'a> {
    /// Type and data of the next element.
    fn next(&mut self) -> Result<(u32, &'a [u8]), TableError> {
        let tag = &self.bytes[..self.bytes.len().min(8)];
        let (kind, size, is_small) = parsed(tag, self.is_big)?.ok_or_else(cut_off)?;
        let (start, end) = match is_small {
            true => (4, 8),
            false => (8, 8 + size.next_multiple_of(8)),
        };
        let data = self.bytes.get(start..start + size).ok_or_else(cut_off)?;
        self.bytes = self.bytes.get(end..).unwrap_or_default();
        Ok((kind, data))
    }

    fn next_integers(&mut self) -> Result<Vec<i32>, TableError> {
        Ok(integers(self.next()?.1, self.is_big))
    }

    /// Flags, shape and name of a matrix.
    fn head(&mut self) -> Result<(i32, Vec<i32>, String), TableError> {
        let flags = self.next_integers()?.first().copied().unwrap_or(0);
        Ok((flags, self.next_integers()?, text(self.next()?.1)))
    }

    /// Value of a matrix.
    fn matrix(mut self, budget: &mut ReadingBudget, depth: usize) -> Result<Value, TableError> {
        let (flags, shape, name) = self.head()?;
        match left_out(flags) {
            Some(what) => Ok(Value::Other(what)),
            None if flags & 0xff != STRUCTURES => self.numbers(&name, &shape, budget),
            None if depth == DEEPEST => Ok(Value::Other("a structure within too many others")),
            None => self.structures(&shape, budget, depth),
        }
    }

    fn numbers(&mut self, name: &str, shape: &[i32], budget: &mut ReadingBudget) -> Result<Value, TableError> {
        if shape.is_empty() || shape.iter().any(|size| *size < 1) {
            return Ok(Value::Other("empty"));
        }
        let shape = Vec::from_iter(shape.iter().map(|size| *size as usize));
        let (kind, mut bytes) = self.next()?;
        let element = CODES.get(kind as usize).and_then(|code| Element::of_code(code));
        let element = element.ok_or_else(|| {
            let reason = "its numbers have an unknown type; save it with the option -v7";
            TableError::array(name, reason)
        })?;
        let found = bytes.len() / element.size;
        let expected = shape.iter().copied().try_fold(1, usize::checked_mul);
        if expected != Some(found) {
            let shape = written(&shape);
            let reason = format!("it should have {shape} numbers and has {found}; save or copy it again");
            return Err(TableError::array(name, reason));
        }
        let is_big = self.is_big;
        let numbers = Element { is_big, ..element }.read(&mut bytes, found as u64, budget)?;
        Ok(Value::Numbers { shape, numbers })
    }

    /// Reads the fields of `shape` structures.
    fn structures(&mut self, shape: &[i32], budget: &mut ReadingBudget, depth: usize) -> Result<Value, TableError> {
        let length = self.next_integers()?.first().map_or(0, |length| *length as usize);
        let (_, names) = self.next()?;
        let count: f64 = shape.iter().map(|size| f64::from(*size)).product();
        let width = names.len().checked_div(length).unwrap_or(0);
        let values = count.max(1.0) * width as f64;
        if values > MAX_FIELDS as f64 {
            return Ok(Value::Other("a structure with too many fields"));
        }
        budget.claim(values as u64 * FIELD)?;
        let names = names.chunks_exact(length.max(1)).take(width);
        let mut fields = Vec::from_iter(names.map(|name| (text(name), Vec::new())));
        // Without fields, a shape of any size has no data.
        let elements = if fields.is_empty() { 0 } else { count as usize };
        let is_big = self.is_big;
        for _ in 0..elements {
            for (_, values) in &mut fields {
                values.push(match self.next()? {
                    (MATRIX, bytes @ [_, ..]) => Elements { bytes, is_big }.matrix(budget, depth + 1)?,
                    _ => Value::Other("empty"),
                });
            }
        }
        Ok(Value::Structures(fields))
    }
}

/// Returns what a matrix with these flags is, unless it is numbers or structures.
fn left_out(flags: i32) -> Option<&'static str> {
    match flags & 0xff {
        1 => Some("a cell array"),
        STRUCTURES => None,
        4 => Some("text"),
        5 => Some("sparse; save it as full"),
        6..=15 => (flags & 0x0800 != 0).then_some("complex"),
        _ => Some("an object"),
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

/// Returns the type and size of an element from its tag, and `true` if it is small: its data is in the tag. `None` at the end.
fn parsed(tag: &[u8], is_big: bool) -> Result<Option<(u32, usize, bool)>, TableError> {
    let [kind, size] = integers(tag, is_big)[..] else {
        return if tag.is_empty() { Ok(None) } else { Err(cut_off()) };
    };
    let (kind, size) = (kind as u32, size as u32);
    match kind >> 16 {
        0 => Ok(Some((kind, size as usize, false))),
        small @ 1..=4 => Ok(Some((kind & 0xffff, small as usize, true))),
        _ => Err(wrong("an element has an invalid length; copy it again")),
    }
}

fn integers(bytes: &[u8], is_big: bool) -> Vec<i32> {
    let integer = match is_big {
        true => i32::from_be_bytes,
        false => i32::from_le_bytes,
    };
    bytes.as_chunks().0.iter().map(|bytes| integer(*bytes)).collect()
}

fn wrong(reason: &str) -> TableError {
    TableError::array("MAT-file", reason)
}

fn cut_off() -> TableError {
    wrong("it is cut off; copy it again")
}

/// Reads `count` bytes, or those up to the end.
fn up_to(source: &mut dyn Read, count: usize) -> Result<Vec<u8>, TableError> {
    let mut bytes = Vec::new();
    source.take(count as u64).read_to_end(&mut bytes).map_err(damage)?;
    Ok(bytes)
}

/// Converts a decompression error; other I/O errors are passed on.
fn damage(error: io::Error) -> TableError {
    match error.kind() {
        io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => {
            TableError::damaged("a variable", "its compressed data is corrupt; copy it again")
        }
        io::ErrorKind::UnexpectedEof => cut_off(),
        _ => error.into(),
    }
}
