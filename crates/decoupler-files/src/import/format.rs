//! File formats of recordings. To add one, add a variant of [`Format`] and a case of [`read`] here, and a module that reads its
//! arrays.

use std::{
    fmt,
    fs::File,
    io::{self, BufReader, Read, Seek as _},
    path::{Path, PathBuf},
};

use zip::ZipArchive;

use super::{
    Decimal, Dialect, Table, TableError, Watch, arrays,
    csv_table::{self, Reading},
    matlab, numpy,
    progress::Watched,
    sheet,
};
use crate::machine::{OverBudget, ReadingBudget};

/// Number of numbers that are read at once.
const BLOCK: u64 = 1 << 17;

/// File format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text in this layout.
    Text(Dialect),
    /// A `.npy` file.
    Npy,
    /// A `.npz` archive.
    Npz,
    /// A `.mat` file of versions 5 to 7.
    Matlab,
    /// A sheet of an Excel or OpenDocument file.
    Sheet {
        /// Its name.
        name: String,
        /// `true` if its first row has the names of the columns.
        header: bool,
    },
}

/// Beginnings of files that are not read, with what they are and what to do.
const REFUSED: [(&[u8], &str, &str); 21] = [
    (
        b"\xd0\xcf\x11\xe0",
        "a file of Excel up to 2003",
        "save it as .xlsx or CSV",
    ),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file", HDF),
    (b"PAR1", "a Parquet file", FRAME),
    (b"ARROW1", "an Arrow file", FRAME),
    (b"SQLite format 3", "an SQLite database", "export the table as CSV"),
    (b"#ROSBAG", "a ROS bag", "export the topics as CSV"),
    (b"\x89MCAP", "an MCAP log", "export the topics as CSV"),
    (b"TDSm", "a TDMS file", "save it as CSV, for example with npTDMS"),
    (b"\x80\x02", "a Python pickle", PICKLE),
    (b"\x80\x03", "a Python pickle", PICKLE),
    (b"\x80\x04", "a Python pickle", PICKLE),
    (b"\x80\x05", "a Python pickle", PICKLE),
    (b"\x1f\x8b", "compressed with gzip", UNPACK),
    (b"BZh", "compressed with bzip2", UNPACK),
    (b"\xfd7zXZ", "compressed with xz", UNPACK),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd", UNPACK),
    (b"7z\xbc\xaf", "a 7z archive", UNPACK),
    (b"\x89PNG", "a PNG image", TABLE),
    (b"\xff\xd8\xff", "a JPEG image", TABLE),
    (b"%PDF", "a PDF document", TABLE),
    (b"RIFF", "a WAV or AVI file", "export its channels as CSV or .npy"),
];
const HDF: &str = "save it as .npz with numpy.savez, with the option -v7 from MATLAB, or as CSV";
const FRAME: &str = "save it as CSV, for example with DataFrame.to_csv";
const PICKLE: &str = "load it in Python and save the arrays with numpy.savez";
const UNPACK: &str = "unpack it";
const TABLE: &str = "give a table of numbers";

impl Format {
    /// Names of all formats, for messages and help.
    pub const NAMES: &str = "CSV, Excel, .npy, .npz or .mat";

    /// Usual file extensions, those of text files first.
    pub const EXTENSIONS: [&str; 9] = ["csv", "txt", "tsv", "dat", "npy", "npz", "mat", "xlsx", "ods"];

    /// Returns the files in `folder` with one of the usual extensions, sorted by name.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn tables_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
        let is_table = |path: &PathBuf| {
            let extension = path.extension().map(|found| found.to_string_lossy().to_lowercase());
            path.is_file() && extension.is_some_and(|found| Self::EXTENSIONS.contains(&found.as_str()))
        };
        let entries = folder.read_dir()?.map(|entry| Ok(entry?.path()));
        let mut found = entries.collect::<io::Result<Vec<_>>>()?;
        found.retain(is_table);
        found.sort();
        Ok(found)
    }
}

/// Reads the table in the file at `path`, whose format is recognised by its beginning, and that of an archive by the names in
/// it.
///
/// # Errors
/// If the file cannot be read, does not contain a table or is a known kind of file that is not read, or `watch` breaks.
pub(super) fn read(path: &Path, reading: &Reading<'_>, watch: Watch<'_>) -> Result<Table, TableError> {
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        return Err(io::Error::from(io::ErrorKind::IsADirectory).into());
    }
    let size = metadata.is_file().then_some(metadata.len());
    let budget = &mut ReadingBudget::now();
    let mut beginning = Vec::new();
    // A pipe can be read only once.
    if size.is_some() {
        (&file).take(16).read_to_end(&mut beginning)?;
        (&file).rewind()?;
    }
    let refused = |what: &str, cure: &str| TableError::Contents(format!("it is {what}, which is not read; {cure}"));
    if let Some((_, what, cure)) = REFUSED.iter().find(|(start, ..)| beginning.starts_with(start)) {
        return Err(refused(what, cure));
    }
    let is_named = path.extension().is_some_and(|found| found.eq_ignore_ascii_case("mat")) && size.is_some();
    let (arrays, format) = match beginning[..] {
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => {
            let array = numpy::read("", &mut BufReader::new(Watched::new(file, size, watch)), budget)?;
            ((vec![array], Vec::new()), Format::Npy)
        }
        [b'P', b'K', 3 | 5, ..] => {
            let archive = ZipArchive::new(BufReader::new(&file));
            (&file).rewind()?;
            let names = archive.iter().flat_map(ZipArchive::file_names);
            let names = Vec::from_iter(names.filter_map(|name| Some(name.ok()?.into_owned())));
            let has = |is_it: fn(&str) -> bool| names.iter().any(|name| is_it(name));
            let is_excel = has(|name| name.starts_with("xl/"));
            let is_ods = !is_excel && has(|name| name == "mimetype") && has(|name| name == "content.xml");
            if is_excel || is_ods {
                return sheet::read(path, file, is_ods, reading, budget, watch);
            }
            if archive.is_ok_and(|archive| !archive.is_empty()) && !has(|name| name.ends_with(".npy")) {
                return Err(refused("a zip archive without .npy arrays", "unpack it"));
            }
            (numpy::read_archive(BufReader::new(file), budget, watch)?, Format::Npz)
        }
        _ if is_named || beginning.starts_with(b"MATLAB") => {
            let source = BufReader::new(Watched::new(file, size, watch));
            (matlab::read(source, budget)?, Format::Matlab)
        }
        _ => return csv_table::read(path, Watched::new(file, size, watch), reading, budget),
    };
    arrays::table(path, arrays, format, reading, budget)
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text(dialect) => write!(f, "text: {dialect}"),
            Self::Npy => f.write_str("NumPy array"),
            Self::Npz => f.write_str("archive of NumPy arrays"),
            Self::Matlab => f.write_str("MATLAB file"),
            Self::Sheet { name, .. } => write!(f, "sheet '{name}'"),
        }
    }
}

/// Type of the numbers in a NumPy or MATLAB file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Element {
    /// As in NumPy: `f` for floating point, `i` and `u` for integers with and without a sign.
    pub(super) kind: char,
    /// Number of bytes.
    pub(super) size: usize,
    /// `true` if the most significant byte comes first.
    pub(super) is_big: bool,
}

impl Element {
    /// Returns the type with this code of NumPy, such as `<f8`.
    pub(super) fn of_code(code: &str) -> Option<Self> {
        let is_big = code.starts_with('>');
        let code = code.trim_start_matches(['>', '<', '|', '=']);
        let code = if ["b1", "?"].contains(&code) { "u1" } else { code };
        let kind = code.chars().next()?;
        let size = code[kind.len_utf8()..].parse().ok()?;
        let is_known = match kind {
            'f' => [4, 8].contains(&size),
            'i' | 'u' => [1, 2, 4, 8].contains(&size),
            _ => false,
        };
        is_known.then_some(Self { kind, size, is_big })
    }

    /// Reads `count` numbers, or those up to the end of the source, block by block, so that a corrupt count allocates little
    /// memory.
    pub(super) fn read(
        self,
        source: &mut dyn Read,
        count: u64,
        budget: &mut ReadingBudget,
    ) -> Result<Vec<f64>, TableError> {
        let bytes = count.saturating_mul(size_of::<f64>() as u64);
        // A vector that grows has room for up to twice its numbers.
        budget.claim(bytes.saturating_mul(2))?;
        let (mut numbers, mut block) = (Vec::new(), Vec::new());
        while (numbers.len() as u64) < count {
            block.clear();
            let wanted = (count - numbers.len() as u64).min(BLOCK) * self.size as u64;
            source.take(wanted).read_to_end(&mut block)?;
            numbers.extend(block.chunks_exact(self.size).map(|chunk| self.number(chunk)));
            if (block.len() as u64) < wanted {
                break;
            }
        }
        budget.release(bytes);
        Ok(numbers)
    }

    fn number(self, chunk: &[u8]) -> f64 {
        let mut bytes = [0; 8];
        bytes[..self.size].copy_from_slice(chunk);
        if self.is_big {
            bytes[..self.size].reverse();
        }
        let bits = u64::from_le_bytes(bytes);
        match (self.kind, self.size) {
            ('f', 4) => f64::from(f32::from_bits(bits as u32)),
            ('f', _) => f64::from_bits(bits),
            ('i', size) => ((bits << (64 - 8 * size)) as i64 >> (64 - 8 * size)) as f64,
            _ => bits as f64,
        }
    }
}

/// A named array of numbers: samples × columns.
#[derive(Debug)]
pub(super) struct Array {
    pub(super) name: String,
    /// Shape in the file: the first dimension counts samples, and the others are joined in the order of the numbers.
    pub(super) shape: Vec<usize>,
    pub(super) numbers: Vec<f64>,
    pub(super) is_by_column: bool,
}

impl Array {
    pub(super) fn rows(&self) -> usize {
        self.shape.first().copied().unwrap_or(1)
    }

    pub(super) fn width(&self) -> usize {
        self.shape.iter().skip(1).product()
    }

    /// Returns the columns of samples of `each` rows, which are side by side.
    pub(super) fn columns(self, each: usize, budget: &mut ReadingBudget) -> Result<Vec<Vec<f64>>, OverBudget> {
        let (rows, width) = (self.rows(), self.width());
        if width * each == 1 {
            return Ok(vec![self.numbers]);
        }
        let bytes = (self.numbers.len() * size_of::<f64>()) as u64;
        budget.claim(bytes)?;
        let column = |index: usize| {
            let (row, column) = (index / width, index % width);
            let (first, step) = match self.is_by_column {
                true => (column * rows + row, each),
                false => (row * width + column, each * width),
            };
            let numbers = self.numbers[first..].iter().step_by(step);
            numbers.take(rows / each).copied().collect()
        };
        let columns = (0..width * each).map(column).collect();
        // The numbers in the order of the file are freed.
        budget.release(bytes);
        Ok(columns)
    }
}

/// Returns a shape as text, such as 500 × 192.
pub(super) fn written(shape: &[usize]) -> String {
    match shape {
        [] => "one number".to_owned(),
        [rows] => format!("{rows} × 1"),
        shape => Vec::from_iter(shape.iter().map(usize::to_string)).join(" × "),
    }
}

/// Parsed cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cell {
    /// A finite number.
    Number(f64),
    /// Empty, or "NaN".
    Missing,
    /// Anything else, including infinities.
    Text,
}

impl Cell {
    pub(super) fn number(self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(number),
            Self::Missing | Self::Text => None,
        }
    }
}

/// Maximum length of a number with a decimal comma, which is copied to the stack.
const LONGEST: usize = 64;

/// Parses a cell without surrounding spaces; the number is correctly rounded.
pub(super) fn parse(cell: &[u8], decimal: Decimal) -> Cell {
    let of_point = |cell: &[u8]| std::str::from_utf8(cell).ok().and_then(|text| text.parse::<f64>().ok());
    let number = match decimal {
        Decimal::Point => of_point(cell),
        // A point would be a thousands separator, or a decimal point after all.
        Decimal::Comma if cell.contains(&b'.') || cell.len() > LONGEST => None,
        Decimal::Comma => {
            let copy = &mut [0; LONGEST][..cell.len()];
            copy.copy_from_slice(cell);
            copy.iter_mut()
                .filter(|byte| **byte == b',')
                .for_each(|comma| *comma = b'.');
            of_point(copy)
        }
    };
    match number {
        Some(number) if number.is_finite() => Cell::Number(number),
        Some(number) if number.is_nan() => Cell::Missing,
        None if cell.is_empty() => Cell::Missing,
        _ => Cell::Text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_numbers_missing_or_text() {
        use Cell::{Missing, Number, Text};
        let cases = [
            ("1.5", Number(1.5), Text),
            ("1,5", Text, Number(1.5)),
            ("-2e-3", Number(-0.002), Number(-0.002)),
            ("+.5", Number(0.5), Text),
            ("1.234,5", Text, Text),
            ("1,234,5", Text, Text),
            ("", Missing, Missing),
            ("NaN", Missing, Missing),
            ("nan", Missing, Missing),
            ("inf", Text, Text),
            ("1e999", Text, Text),
            ("NA", Text, Text),
            ("1 000", Text, Text),
            ("0x10", Text, Text),
            (
                "9007199254740993",
                Number(9_007_199_254_740_992.0),
                Number(9_007_199_254_740_992.0),
            ),
        ];
        for (text, point, comma) in cases {
            assert_eq!(parse(text.as_bytes(), Decimal::Point), point, "{text}");
            assert_eq!(parse(text.as_bytes(), Decimal::Comma), comma, "{text}");
        }
    }
}
