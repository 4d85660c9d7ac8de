use super::TableError;

/// Type of the numbers in a file of NumPy or MATLAB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Element {
    F32,
    F64,
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
}

/// Order of the bytes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Endian {
    Little,
    Big,
}

impl Element {
    /// Number of bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::F32 | Self::I32 | Self::U32 => 4,
            Self::F64 | Self::I64 | Self::U64 => 8,
        }
    }

    /// Reads the numbers in `bytes`, of which no part is left over.
    pub(super) fn read(self, bytes: &[u8], endian: Endian) -> Vec<f64> {
        macro_rules! numbers {
            ($type:ty) => {
                bytes
                    .chunks_exact(size_of::<$type>())
                    .map(|chunk| {
                        let bytes = chunk.try_into().expect("chunks have the size of the type");
                        let number = match endian {
                            Endian::Little => <$type>::from_le_bytes(bytes),
                            Endian::Big => <$type>::from_be_bytes(bytes),
                        };
                        #[allow(clippy::cast_lossless, reason = "not lossless for all of the types")]
                        let number = number as f64;
                        number
                    })
                    .collect()
            };
        }
        match self {
            Self::F32 => numbers!(f32),
            Self::F64 => numbers!(f64),
            Self::I8 => numbers!(i8),
            Self::I16 => numbers!(i16),
            Self::I32 => numbers!(i32),
            Self::I64 => numbers!(i64),
            Self::U8 => numbers!(u8),
            Self::U16 => numbers!(u16),
            Self::U32 => numbers!(u32),
            Self::U64 => numbers!(u64),
        }
    }
}

/// A named array of numbers: rows × columns, column by column.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    pub(super) name: String,
    pub(super) rows: usize,
    pub(super) columns: Vec<Vec<f64>>,
}

impl Array {
    /// Divides `numbers` into columns.
    pub(super) fn new(
        name: String,
        rows: usize,
        width: usize,
        numbers: Vec<f64>,
        is_by_column: bool,
    ) -> Result<Self, TableError> {
        if width > super::rows::MAX_CELLS {
            let reason = format!(
                "{rows} × {width} is more than {} columns; transpose it",
                super::rows::MAX_CELLS
            );
            return Err(TableError::array(name, reason));
        }
        let columns = if width == 1 {
            vec![numbers]
        } else if is_by_column {
            numbers.chunks_exact(rows.max(1)).map(<[f64]>::to_vec).collect()
        } else {
            let column = |index| numbers.iter().skip(index).step_by(width).copied().collect();
            (0..width).map(column).collect()
        };
        Ok(Self { name, rows, columns })
    }
}
