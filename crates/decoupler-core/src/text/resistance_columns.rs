use super::{ReadError, csv_fields::CsvFields};

/// Columns of resistances in lines of CSV: named `r_1` to `r_M4`, in any order and among others, or without names.
#[derive(Clone, Debug)]
pub struct ResistanceColumns {
    /// Column index of each resistance, in the order r_1 to r_M4.
    resistances: Vec<usize>,
    /// Column index of the row-wire, if there is such a column.
    row: Option<usize>,
    /// Number of columns in a line.
    width: usize,
}

impl ResistanceColumns {
    /// Finds the columns in a line of names.
    ///
    /// # Errors
    /// If a column is missing or duplicated.
    pub fn named(names: &CsvFields, channels: usize) -> Result<Self, ReadError> {
        let mut resistances = vec![None; channels];
        for (column, name) in names.iter().enumerate() {
            if let Some(channel) = channel_of(name, channels)
                && resistances[channel - 1].replace(column).is_some()
            {
                return Err(ReadError::Twice(channel));
            }
        }
        let missing = |index: usize| ReadError::Missing(index + 1, channels);
        let resistances = resistances.iter().enumerate();
        Ok(Self {
            resistances: resistances
                .map(|(index, column)| column.ok_or_else(|| missing(index)))
                .collect::<Result<_, _>>()?,
            row: names.iter().position(|name| name == b"row"),
            width: names.count(),
        })
    }

    /// Columns without names: `count` resistances, after the row-wire if lines begin with it.
    pub fn unnamed(count: usize, begins_with_row: bool) -> Self {
        let before = usize::from(begins_with_row);
        Self {
            resistances: (before..before + count).collect(),
            row: begins_with_row.then_some(0),
            width: before + count,
        }
    }

    /// Returns `true` for a line that has a name of a resistance.
    pub fn has_name(fields: &CsvFields, channels: usize) -> bool {
        fields.iter().any(|name| channel_of(name, channels).is_some())
    }

    /// Returns `true` if lines say their row-wire.
    pub fn has_row(&self) -> bool {
        self.row.is_some()
    }

    /// Appends the resistances of a line.
    ///
    /// # Errors
    /// If the line has another number of columns, or a field is not a resistance.
    pub fn read(&self, line: u64, fields: &CsvFields, resistances_ohm: &mut Vec<f64>) -> Result<(), ReadError> {
        let (found, expected) = (fields.count(), self.width);
        if found != expected {
            return Err(ReadError::Width { line, found, expected });
        }
        for &column in &self.resistances {
            let field = fields.get(column);
            let value = number(field).filter(|ohm| *ohm > 0.0 && ohm.is_finite());
            resistances_ohm.push(value.ok_or_else(|| ReadError::Value {
                line,
                column: column + 1,
                text: excerpt(field),
            })?);
        }
        Ok(())
    }

    /// Returns the row-wire of a line, from 0, if lines say it; `rows` is the number of row-wires of the array.
    ///
    /// # Errors
    /// If the field is not the number of a row-wire.
    pub fn row_wire(&self, line: u64, fields: &CsvFields, rows: usize) -> Result<Option<usize>, ReadError> {
        let Some(column) = self.row else {
            return Ok(None);
        };
        let field = fields.get(column);
        let number: Option<usize> = std::str::from_utf8(field).ok().and_then(|text| text.parse().ok());
        match number.filter(|number| (1..=rows).contains(number)) {
            Some(number) => Ok(Some(number - 1)),
            None => Err(ReadError::RowWire {
                line,
                column: column + 1,
                text: excerpt(field),
                rows,
            }),
        }
    }
}

/// Returns the text of a field, shortened to 40 characters for a message, control characters escaped.
fn excerpt(field: &[u8]) -> String {
    let text: String = String::from_utf8_lossy(field).chars().take(40).collect();
    if text.contains(char::is_control) {
        text.escape_debug().to_string()
    } else {
        text
    }
}

/// Parses a number; `None` if the field is none.
pub fn number(field: &[u8]) -> Option<f64> {
    std::str::from_utf8(field).ok()?.trim().parse().ok()
}

/// Returns k for a column named `r_k`, with k from 1 to `channels`.
fn channel_of(name: &[u8], channels: usize) -> Option<usize> {
    let number = std::str::from_utf8(name).ok()?.strip_prefix("r_")?;
    number.parse().ok().filter(|channel| (1..=channels).contains(channel))
}
