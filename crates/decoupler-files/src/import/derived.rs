//! Derived columns of tables and of streams of lines: those of a stream equal those of a file with the same lines.

use decoupler_core::dataset::Span;

use super::{
    Column, Derived, ImportError, Table,
    columns::position,
    expression::{Expression, Operand, Operator},
    selection::seconds,
};

/// Maximum number of cells of a stream that are kept until the start is over: 128 MB.
const MAX_CELLS: usize = 1 << 24;

/// Name of the time column within the file, and the unit given by the recipe instead of the header.
pub(super) type TimeColumn<'a> = (&'a str, Option<&'a str>);

/// Derived column with the places of its columns in a table or in the lines of a stream.
#[derive(Clone, Debug, PartialEq)]
struct Located {
    derived: Derived,
    expression: Expression<usize>,
    /// Time column and the seconds in its unit, for a mean over the first seconds.
    time: Option<(usize, f64)>,
}

impl Derived {
    /// Finds its columns among `columns`, and returns them with the new column; `None` if they have its name already or do not
    /// have its first column. `own` returns the name of a column within the file, and `time` is the time column there.
    ///
    /// # Errors
    /// If the other column or the time column is missing, or the times have no unit of time.
    fn located(
        &self,
        columns: &[Column],
        own: impl Fn(&str) -> Option<String>,
        time: Option<TimeColumn<'_>>,
    ) -> Result<Option<(Located, Column)>, ImportError> {
        let find = |name: &str| position(columns, &own(name)?);
        let name = own(&self.name).filter(|name| position(columns, name).is_none());
        let (Some(column), Some(name)) = (find(&self.expression.column), name) else {
            return Ok(None);
        };
        let operator = self.expression.operator;
        let (mut other, mut clock) = (column, None);
        let operand = match &self.expression.operand {
            Operand::Column(name) => {
                let missing = || self.refused(&format!("there is no column '{name}' in the same file"));
                other = find(name).ok_or_else(missing)?;
                Operand::Column(other)
            }
            Operand::Number(number) => Operand::Number(*number),
            Operand::Start(span) => {
                if self.needs_time() {
                    clock = Some(self.clock(columns, time)?);
                }
                Operand::Start(*span)
            }
        };
        let [one, two] = [column, other].map(|place| columns[place].unit.as_deref());
        let unit = match operator {
            Operator::Over if one == two => None,
            Operator::Over => one.zip(two).map(|(one, two)| format!("{one}/{two}")),
            _ => one.filter(|_| one == two).map(str::to_owned),
        };
        let located = Located {
            derived: self.clone(),
            expression: Expression {
                column,
                operator,
                operand,
            },
            time: clock,
        };
        let new = Column {
            name,
            unit,
            ..Column::default()
        };
        Ok(Some((located, new)))
    }

    /// Returns the place of the time column and the seconds in its unit.
    fn clock(&self, columns: &[Column], time: Option<TimeColumn<'_>>) -> Result<(usize, f64), ImportError> {
        let found = time.and_then(|(name, given_unit)| Some((position(columns, name)?, given_unit)));
        let (place, given_unit) =
            found.ok_or_else(|| self.refused("seconds need the time column; give a number of rows"))?;
        let Column { name, unit, start, .. } = &columns[place];
        let unit_s = seconds(start.map(|_| "s").or(given_unit).or(unit.as_deref()));
        let unit_s = unit_s.ok_or_else(|| self.refused(&format!("'{name}' has no unit of time")))?;
        Ok((place, unit_s))
    }

    /// Adds the column to a table, unless the table has its name already or does not have its first column; `own` and `time`
    /// are as for [`Self::located`].
    ///
    /// # Errors
    /// If another column is missing, a cell is not a number, or the mean cannot be computed.
    pub(super) fn add_to(
        &self,
        table: &mut Table,
        own: impl Fn(&str) -> Option<String>,
        time: Option<TimeColumn<'_>>,
    ) -> Result<(), ImportError> {
        let Some((mut located, new)) = self.located(&table.columns, own, time)? else {
            return Ok(());
        };
        let mut read = located.columns().map(|place| &table.columns[place]);
        if let Some(column) = read.find(|column| column.faults.count > 0 || column.wordy_label().is_some()) {
            return Err(self.refused(&format!("'{}' has text", column.name)));
        }
        let cell = |row: usize, column: usize| table.columns[column].numbers[row];
        located.take_start(table.rows, cell)?;
        let of_row = |row| located.value(|column| cell(row, column));
        let derived = Vec::from_iter((0..table.rows).map(of_row));
        table.columns.push(Column {
            missing: derived.iter().filter(|value| value.is_nan()).count(),
            numbers: derived,
            ..new
        });
        Ok(())
    }
}

impl Located {
    /// Places of the columns from which it is computed.
    fn columns(&self) -> impl Iterator<Item = usize> + use<> {
        let other = match self.expression.operand {
            Operand::Column(other) => Some(other),
            _ => self.time.map(|(time, _)| time),
        };
        std::iter::once(self.expression.column).chain(other)
    }

    /// Returns `true` if `rows` rows are the whole start, or all of it and more; `cell` returns a cell by row and column.
    fn has_start(&self, rows: usize, cell: impl Fn(usize, usize) -> f64) -> bool {
        match (&self.expression.operand, self.time) {
            (Operand::Start(Span::Samples(needed)), _) => rows as f64 >= *needed,
            (Operand::Start(Span::Seconds(limit_s)), Some((time, unit_s))) => {
                rows > 0 && unit_s * (cell(rows - 1, time) - cell(0, time)) > *limit_s
            }
            _ => true,
        }
    }

    /// Replaces a mean at the start of `rows` rows by its value. `cell` returns a cell by row and column.
    ///
    /// # Errors
    /// If no cell at the start is a number.
    fn take_start(&mut self, rows: usize, cell: impl Fn(usize, usize) -> f64) -> Result<(), ImportError> {
        let Operand::Start(span) = self.expression.operand else {
            return Ok(());
        };
        let mut start = Vec::from_iter(0..rows);
        match (span, self.time) {
            (Span::Seconds(limit_s), Some((time, unit_s))) => {
                let first = start.iter().map(|&row| cell(row, time)).fold(f64::INFINITY, f64::min);
                start.retain(|&row| unit_s * (cell(row, time) - first) <= limit_s);
            }
            (Span::Samples(rows) | Span::Seconds(rows), _) => start.truncate(rows as usize),
        }
        let present = start.into_iter().map(|row| cell(row, self.expression.column));
        let present = present.filter(|value| !value.is_nan());
        let (sum, count) = present.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
        if count == 0 {
            return Err(self.derived.refused("no cell at the start is a number"));
        }
        self.expression.operand = Operand::Number(sum / f64::from(count));
        Ok(())
    }

    /// Value in a row; NaN if there is none, such as for a quotient by zero. `cell` returns a cell of the row by column.
    fn value(&self, cell: impl Fn(usize) -> f64) -> f64 {
        let operand = match self.expression.operand {
            Operand::Column(other) => cell(other),
            Operand::Number(number) => number,
            Operand::Start(_) => f64::NAN,
        };
        let value = self.expression.operator.value(cell(self.expression.column), operand);
        if value.is_finite() { value } else { f64::NAN }
    }
}

/// Derived columns of a stream. Means at the start are known only after the start, whose lines are kept until then.
#[derive(Clone, Debug, Default)]
pub(super) struct DerivedStream {
    /// The columns in the order in which they are computed: a later one may be computed from an earlier one.
    columns: Vec<Located>,
    /// Cells of the lines of the start; `None` after it.
    start: Option<Vec<Vec<f64>>>,
}

impl DerivedStream {
    /// Finds the columns from which `derive` are computed, and adds the new ones to `columns`.
    ///
    /// # Errors
    /// If a column is missing, or the times have no unit of time.
    pub(super) fn new(
        derive: &[Derived],
        columns: &mut Vec<Column>,
        time: Option<TimeColumn<'_>>,
    ) -> Result<Self, ImportError> {
        let mut located = Vec::new();
        for derived in derive {
            let found = derived.located(columns, |name| Some(name.trim().to_owned()), time)?;
            if let Some((found, new)) = found {
                columns.push(new);
                located.push(found);
            }
        }
        Ok(Self {
            start: (!located.is_empty()).then(Vec::new),
            columns: located,
        })
    }

    /// Columns of the stream from which the new ones are computed; `width` is the number of its columns.
    pub(super) fn needed(&self, width: usize) -> impl Iterator<Item = usize> {
        let columns = self.columns.iter().flat_map(Located::columns);
        columns.filter(move |&column| column < width)
    }

    /// Name of a new column, by its place behind those of the stream.
    pub(super) fn name(&self, place: usize) -> &str {
        self.columns.get(place).map_or("", |column| &column.derived.name)
    }

    /// Adds the derived columns to the cells of the next line, and returns the lines of the start, with their derived columns,
    /// after the last of them; `None` for a line of the start, whose derived columns are not known yet.
    ///
    /// # Errors
    /// If no cell at the start is a number, or the start is too long.
    pub(super) fn take(&mut self, cells: &mut Vec<f64>) -> Result<Option<Vec<Vec<f64>>>, ImportError> {
        let Some(mut lines) = self.start.take() else {
            for column in &self.columns {
                cells.push(column.value(|place| cells[place]));
            }
            return Ok(Some(Vec::new()));
        };
        lines.push(cells.clone());
        // Times of derived columns do not exist: a span is over by the cells of the stream.
        let cell = |row: usize, place: usize| lines[row].get(place).copied().unwrap_or(f64::NAN);
        let mut columns = self.columns.iter();
        if let Some(column) = columns.find(|column| !column.has_start(lines.len(), cell)) {
            if lines.len().saturating_mul(cells.len()) > MAX_CELLS {
                let reason = "its start is too long for a stream; give fewer rows or seconds";
                return Err(column.derived.refused(reason));
            }
            self.start = Some(lines);
            return Ok(None);
        }
        for column in &mut self.columns {
            column.take_start(lines.len(), |row, place| lines[row][place])?;
            for line in &mut lines {
                let value = column.value(|place| line[place]);
                line.push(value);
            }
        }
        *cells = lines.pop().unwrap_or_default();
        Ok(Some(lines))
    }
}
