//! MAT-files of level 5, which MATLAB writes with `save` as `-v6` and `-v7`:
//! <https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf>. Numeric and logical arrays, and those in
//! structures, are read; other variables are reported. No existing crate reports the variables it skips and limits the allocation for a corrupt length.

use std::io::{self, Read};

use flate2::read::ZlibDecoder;

use super::{
    TableError,
    format::{Array, Element, written},
    progress::table_error,
};
use crate::machine::ReadingBudget;

const COMPRESSED: u32 = 15;
const MATRIX: u32 = 14;
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
/// Maximum length of names, shapes and flags in bytes.
const LONGEST: u64 = 1 << 16;

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
    let mut file = Elements::new(&mut source, is_big, budget);
    while let Some(tag) = file.tag()? {
        match tag.kind {
            COMPRESSED if tag.size == tag.rest => {
                // Compressed variables are not padded.
                file.padding = 0;
                let mut inflated = ZlibDecoder::new((&mut *file.source).take(tag.rest));
                let mut elements = Elements::new(&mut inflated, is_big, file.budget);
                if let Some(Tag { kind: MATRIX, rest, .. }) = elements.tag()? {
                    found.read(&mut elements, rest)?;
                }
                // The checksum is verified at the end of the data.
                if !up_to(&mut inflated, 1)?.is_empty() {
                    let reason = "it has more data than it states; copy it again";
                    return Err(TableError::damaged("a variable", reason));
                }
                if inflated.total_in() != tag.rest {
                    return Err(TableError::damaged("a variable", "its length is wrong; copy it again"));
                }
            }
            MATRIX if tag.size == tag.rest => found.read(&mut file, tag.rest)?,
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
    /// Reads a variable, the next `size` bytes of `elements`.
    fn read(&mut self, elements: &mut Elements<'_>, size: u64) -> Result<(), TableError> {
        let mut source = (&mut *elements.source).take(size);
        let (name, value) = Elements::new(&mut source, elements.is_big, elements.budget).matrix(0)?;
        drain(&mut source)?;
        if source.limit() > 0 {
            return Err(cut_off());
        }
        // MATLAB stores internal data, such as `__function_workspace__`, in variables without a name.
        if !name.is_empty() {
            self.add(name, value);
        }
        Ok(())
    }

    /// Adds the numbers as arrays, those of a field named `variable.field`, and notes what is left out.
    fn add(&mut self, name: String, value: Value) {
        match value {
            Value::Other(what) => self.left_out.push(format!("{name} is {what}")),
            Value::Numbers { shape, numbers } => {
                // A row vector becomes a column of the table.
                let first = shape.iter().position(|&size| size > 1).unwrap_or(shape.len() - 1);
                match Array::new(&name, shape[first..].to_vec(), numbers, true) {
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

/// Beginning of an element.
struct Tag {
    kind: u32,
    /// Number of bytes of the data.
    size: u64,
    /// The data of a small element.
    small: Vec<u8>,
    /// Number of bytes of the data that follow.
    rest: u64,
}

/// Elements that follow each other.
struct Elements<'a> {
    source: &'a mut dyn Read,
    is_big: bool,
    budget: &'a mut ReadingBudget,
    /// Number of bytes before the next element.
    padding: u64,
}

impl<'a> Elements<'a> {
    fn new(source: &'a mut dyn Read, is_big: bool, budget: &'a mut ReadingBudget) -> Self {
        Self {
            source,
            is_big,
            budget,
            padding: 0,
        }
    }

    /// Tag of the next element; `None` at the end. Its data must be read before the next.
    fn tag(&mut self) -> Result<Option<Tag>, TableError> {
        drain(&mut (&mut *self.source).take(self.padding))?;
        let tag = up_to(self.source, 8)?;
        let [kind, size] = self.integers(&tag)[..] else {
            return if tag.is_empty() { Ok(None) } else { Err(cut_off()) };
        };
        let (kind, size) = (kind as u32, u64::from(size as u32));
        let (size, small) = match kind >> 16 {
            0 => (size, Vec::new()),
            small @ 1..=4 => (u64::from(small), tag[4..][..small as usize].to_vec()),
            _ => return Err(wrong("an element has an invalid length; copy it again")),
        };
        let rest = size - small.len() as u64;
        self.padding = rest.next_multiple_of(8) - rest;
        let kind = kind & 0xffff;
        Ok(Some(Tag {
            kind,
            size,
            small,
            rest,
        }))
    }

    fn next(&mut self) -> Result<Tag, TableError> {
        self.tag()?.ok_or_else(cut_off)
    }

    /// Data of an element.
    fn data(&mut self, tag: Tag) -> Result<Vec<u8>, TableError> {
        let mut data = tag.small;
        data.extend(up_to(self.source, tag.rest)?);
        if (data.len() as u64) < tag.size {
            return Err(cut_off());
        }
        Ok(data)
    }

    /// Data of a name, a shape or flags.
    fn next_short(&mut self) -> Result<Vec<u8>, TableError> {
        let tag = self.next()?;
        if tag.size > LONGEST {
            return Err(wrong("an element has an invalid length; copy it again"));
        }
        self.data(tag)
    }

    fn next_integers(&mut self) -> Result<Vec<i32>, TableError> {
        let bytes = self.next_short()?;
        Ok(self.integers(&bytes))
    }

    fn integers(&self, bytes: &[u8]) -> Vec<i32> {
        let integer = if self.is_big {
            i32::from_be_bytes
        } else {
            i32::from_le_bytes
        };
        bytes.as_chunks().0.iter().map(|bytes| integer(*bytes)).collect()
    }

    /// Name and value of a matrix. The data of one that is left out, and of a variable without a name, is not read.
    fn matrix(&mut self, depth: usize) -> Result<(String, Value), TableError> {
        let flags = self.next_integers()?.first().copied().unwrap_or(0);
        let (shape, name) = (self.next_integers()?, text(&self.next_short()?));
        let value = match flags & 0xff {
            _ if depth == 0 && name.is_empty() => Value::Other("internal"),
            1 => Value::Other("a cell array"),
            2 if depth == DEEPEST => Value::Other("a structure within too many others"),
            2 => self.structures(&shape, depth)?,
            4 => Value::Other("text"),
            5 => Value::Other("sparse; save it as full"),
            6..=15 if flags & 0x0800 != 0 => Value::Other("complex"),
            6..=15 => self.numbers(&name, &shape)?,
            _ => Value::Other("an object"),
        };
        Ok((name, value))
    }

    fn numbers(&mut self, name: &str, shape: &[i32]) -> Result<Value, TableError> {
        if shape.is_empty() || shape.iter().any(|size| *size < 1) {
            return Ok(Value::Other("empty"));
        }
        let shape = Vec::from_iter(shape.iter().map(|size| *size as usize));
        let tag = self.next()?;
        let element = CODES.get(tag.kind as usize).and_then(|code| Element::of_code(code));
        let element = element.ok_or_else(|| {
            let reason = "its numbers have an unknown type; save it with the option -v7";
            TableError::array(name, reason)
        })?;
        let is_big = self.is_big;
        let found = tag.size / element.size as u64;
        let expected = shape
            .iter()
            .try_fold(1_u64, |count, size| count.checked_mul(*size as u64));
        if expected != Some(found) {
            let shape = written(&shape);
            let reason = format!("it should have {shape} numbers and has {found}; save or copy it again");
            return Err(TableError::array(name, reason));
        }
        self.budget.claim(found.saturating_mul(size_of::<f64>() as u64))?;
        let mut data = tag.small.chain((&mut *self.source).take(tag.rest));
        let numbers = Element { is_big, ..element }.read(&mut data, found).map_err(damage)?;
        drain(&mut data)?;
        if (numbers.len() as u64) < found {
            return Err(cut_off());
        }
        Ok(Value::Numbers { shape, numbers })
    }

    /// Reads the fields of `shape` structures.
    fn structures(&mut self, shape: &[i32], depth: usize) -> Result<Value, TableError> {
        let length = self
            .next_integers()?
            .first()
            .map_or(0, |length| (*length).max(0) as usize);
        let tag = self.next()?;
        self.budget.claim(tag.size)?;
        let names = self.data(tag)?;
        let count: f64 = shape.iter().map(|size| f64::from(*size)).product();
        let width = names.len().checked_div(length).unwrap_or(0);
        let values = count.max(1.0) * width as f64;
        if values > MAX_FIELDS as f64 {
            return Ok(Value::Other("a structure with too many fields"));
        }
        self.budget.claim(values as u64 * FIELD)?;
        let names = names.chunks_exact(length.max(1)).take(width);
        let mut fields = Vec::from_iter(names.map(|name| (text(name), Vec::new())));
        // Without fields, a shape of any size has no data.
        let elements = if fields.is_empty() { 0 } else { count as usize };
        for _ in 0..elements {
            for (_, values) in &mut fields {
                let tag = self.next()?;
                let mut data = (&mut *self.source).take(tag.rest);
                values.push(match tag.kind {
                    MATRIX if tag.size > 0 => Elements::new(&mut data, self.is_big, self.budget).matrix(depth + 1)?.1,
                    _ => Value::Other("empty"),
                });
                drain(&mut data)?;
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

fn wrong(reason: &str) -> TableError {
    TableError::array("MAT-file", reason)
}

fn cut_off() -> TableError {
    wrong("it is cut off; copy it again")
}

/// Reads `count` bytes, or those up to the end.
fn up_to(source: &mut dyn Read, count: u64) -> Result<Vec<u8>, TableError> {
    let mut bytes = Vec::new();
    source.take(count).read_to_end(&mut bytes).map_err(damage)?;
    Ok(bytes)
}

/// Reads up to the end.
fn drain(source: &mut dyn Read) -> Result<(), TableError> {
    io::copy(source, &mut io::sink()).map_err(damage)?;
    Ok(())
}

/// Converts a decompression error; other I/O errors are passed on.
fn damage(error: io::Error) -> TableError {
    match error.kind() {
        io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData => {
            TableError::damaged("a variable", "its compressed data is corrupt; copy it again")
        }
        io::ErrorKind::UnexpectedEof => cut_off(),
        _ => table_error(error),
    }
}
