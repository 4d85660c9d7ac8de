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

const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;
/// Maximum depth of structures in structures.
const DEEPEST: usize = 8;
/// Maximum number of fields times elements of a structure.
const MAX_FIELDS: usize = 1 << 20;
/// Memory of a field of a structure in bytes, without its numbers.
const FIELD: u64 = 128;
/// Maximum length of names, shapes and flags in bytes.
const LONGEST: usize = 1 << 16;

/// Reads the numeric arrays of a file; returns them and the variables left out. `budget` limits their memory.
pub(super) fn read(mut source: impl Read, budget: &mut ReadingBudget) -> Result<(Vec<Array>, Vec<String>), TableError> {
    let mut header = [0; 128];
    if !fill(&mut source, &mut header)? {
        return Err(cut_off());
    }
    if header.starts_with(b"MATLAB 7.3") {
        let reason = "it has version 7.3 of the format, which is HDF5; save it with the option -v7";
        return Err(wrong(reason));
    }
    let endian = match &header[126..] {
        b"IM" => Endian::Little,
        b"MI" => Endian::Big,
        _ => {
            let reason = "it is not a MAT-file of version 5 to 7; save it with the option -v7";
            return Err(wrong(reason));
        }
    };
    let mut found = Variables::default();
    let mut tag = [0; 8];
    while fill(&mut source, &mut tag)? {
        let (kind, size, is_small) = parsed(tag, endian)?;
        let mut limited = (&mut source).take(size as u64);
        match (kind, is_small) {
            (COMPRESSED, false) => {
                let mut inflated = ZlibDecoder::new(&mut limited);
                if fill(&mut inflated, &mut tag)?
                    && let (MATRIX, size, false) = parsed(tag, endian)?
                {
                    found.read(&mut inflated, size, endian, budget)?;
                }
                // The checksum is verified at the end of the data.
                if fill(&mut inflated, &mut [0])? {
                    let reason = "it has more data than it states; copy it again";
                    return Err(TableError::damaged("a variable", reason));
                }
                if inflated.total_in() != size as u64 {
                    return Err(TableError::damaged("a variable", "its length is wrong; copy it again"));
                }
            }
            (MATRIX, false) => {
                found.read(&mut limited, size, endian, budget)?;
                let padding = size.next_multiple_of(8) - size;
                drain(&mut source, padding as u64)?;
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
        endian: Endian,
        budget: &mut ReadingBudget,
    ) -> Result<(), TableError> {
        // Flags, shape and name come first.
        let mut bytes = Vec::new();
        let mut read = |bytes: &mut Vec<u8>, end: usize| {
            let missing = (end - bytes.len()) as u64;
            let read = source.take(missing).read_to_end(bytes).map_err(damage)?;
            if (read as u64) < missing {
                Err(cut_off())
            } else {
                Ok(())
            }
        };
        read(&mut bytes, size.min(4 * LONGEST))?;
        let head = Elements { bytes: &bytes, endian }.matrix_head()?;
        let (name, other) = match head {
            (name, _, Class::Other(what)) => (name, Some(what)),
            (name, ..) => (name, None),
        };
        // MATLAB stores internal data, such as `__function_workspace__`, in variables without a name.
        if let Some(what) = other.filter(|_| !name.is_empty()) {
            self.left_out.push(format!("{name} is {what}"));
        }
        if other.is_some() || name.is_empty() {
            return drain(source, (size - bytes.len()) as u64);
        }
        budget.claim(size as u64)?;
        read(&mut bytes, size)?;
        let value = Elements { bytes: &bytes, endian }.matrix(budget, 0)?.1;
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
                match Array::new(name, &shape[first..], numbers, true) {
                    Ok(array) => self.arrays.push(array),
                    Err(error) => self.left_out.push(error.to_string()),
                }
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

/// Class of a matrix.
enum Class {
    Numbers,
    Structures,
    /// Anything else: what it is.
    Other(&'static str),
}

/// Elements of a variable, which follow each other.
struct Elements<'a> {
    bytes: &'a [u8],
    endian: Endian,
}

impl<'a> Elements<'a> {
    /// Type and data of the next element.
    fn next(&mut self) -> Result<(u32, &'a [u8]), TableError> {
        let (tag, rest) = self.bytes.split_first_chunk().ok_or_else(cut_off)?;
        let (kind, size, is_small) = parsed(*tag, self.endian)?;
        let (data, padded) = if is_small {
            (&tag[4..], 0)
        } else {
            (rest, size.next_multiple_of(8))
        };
        self.bytes = rest.get(padded..).unwrap_or_default();
        Ok((kind, data.get(..size).ok_or_else(cut_off)?))
    }

    /// Data of a name, a shape or flags.
    fn next_short(&mut self) -> Result<&'a [u8], TableError> {
        let (_, data) = self.next()?;
        if data.len() > LONGEST {
            return Err(wrong("an element has an invalid length; copy it again"));
        }
        Ok(data)
    }

    fn next_integers(&mut self) -> Result<Vec<f64>, TableError> {
        Ok(Element::I32.read(self.next_short()?, self.endian))
    }

    /// Name, shape and class of a matrix.
    fn matrix_head(&mut self) -> Result<(String, Vec<f64>, Class), TableError> {
        let flags = self.next_integers()?.first().copied().unwrap_or(0.0) as i64;
        let (shape, name) = (self.next_integers()?, text(self.next_short()?));
        let class = match flags & 0xff {
            1 => Class::Other("a cell array"),
            2 => Class::Structures,
            4 => Class::Other("text"),
            5 => Class::Other("sparse; save it as full"),
            6..=15 if flags & 0x0800 != 0 => Class::Other("complex"),
            6..=15 => Class::Numbers,
            _ => Class::Other("an object"),
        };
        Ok((name, shape, class))
    }

    /// Name and value of a matrix.
    fn matrix(mut self, budget: &mut ReadingBudget, depth: usize) -> Result<(String, Value), TableError> {
        let (name, shape, class) = self.matrix_head()?;
        let value = match class {
            Class::Other(what) => Value::Other(what),
            Class::Numbers => self.numbers(&name, &shape, budget)?,
            Class::Structures if depth == DEEPEST => Value::Other("a structure within too many others"),
            Class::Structures => self.structures(&shape, budget, depth)?,
        };
        Ok((name, value))
    }

    fn numbers(&mut self, name: &str, shape: &[f64], budget: &mut ReadingBudget) -> Result<Value, TableError> {
        if shape.is_empty() || shape.iter().any(|size| *size < 1.0) {
            return Ok(Value::Other("empty"));
        }
        let shape = Vec::from_iter(shape.iter().map(|size| *size as usize));
        let (kind, bytes) = self.next()?;
        let code = match kind {
            1 => "i1",
            2 => "u1",
            3 => "i2",
            4 => "u2",
            5 => "i4",
            6 => "u4",
            7 => "f4",
            9 => "f8",
            12 => "i8",
            13 => "u8",
            _ => "",
        };
        let element = Element::of_code(code).ok_or_else(|| {
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
        // The numbers in the order of the file are freed once they are copied to their columns.
        budget.claim((found as u64).saturating_mul(2 * size_of::<f64>() as u64))?;
        let numbers = element.read(bytes, self.endian);
        Ok(Value::Numbers { shape, numbers })
    }

    /// Reads the fields of `shape` structures.
    fn structures(&mut self, shape: &[f64], budget: &mut ReadingBudget, depth: usize) -> Result<Value, TableError> {
        let length = self.next_integers()?.first().map_or(0, |length| *length as usize);
        let (_, names) = self.next()?;
        let count: f64 = shape.iter().product();
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
        for _ in 0..elements {
            for (_, values) in &mut fields {
                let endian = self.endian;
                values.push(match self.next()? {
                    (MATRIX, bytes @ [_, ..]) => Elements { bytes, endian }.matrix(budget, depth + 1)?.1,
                    _ => Value::Other("empty"),
                });
            }
        }
        Ok(Value::Structures(fields))
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

/// Returns the type and size of an element from its tag, and `true` if it is small: its data is in the tag.
fn parsed(tag: [u8; 8], endian: Endian) -> Result<(u32, usize, bool), TableError> {
    let number = |bytes: &[u8]| Element::U32.read(bytes, endian)[0] as u32;
    let (kind, size) = (number(&tag[..4]), number(&tag[4..]) as usize);
    match (kind >> 16) as usize {
        0 => Ok((kind, size, false)),
        small @ 1..=4 => Ok((kind & 0xffff, small, true)),
        _ => Err(wrong("an element has an invalid length; copy it again")),
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

/// Reads `count` bytes, or up to the end.
fn drain(source: &mut dyn Read, count: u64) -> Result<(), TableError> {
    std::io::copy(&mut source.take(count), &mut std::io::sink()).map_err(damage)?;
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
