//! Derived columns of a stream of lines, equal to those of a file with the same lines.

use super::{
    Column, Derived, ImportError,
    derived::{LocatedDerived, NOTHING_AT_START, TimeColumn},
};

/// Maximum number of cells kept until the start is over: 128 MB.
const MAX_CELLS: usize = 1 << 24;

/// Derived columns of a stream. Means at the start are known only after the start, whose lines are kept until then.
#[derive(Clone, Debug)]
pub(super) struct DerivedStream {
    /// The columns in the order in which they are computed: a later one may be computed from an earlier one.
    columns: Vec<(Derived, LocatedDerived)>,
    state: State,
}

#[derive(Clone, Debug)]
enum State {
    /// Cells of the lines of the start.
    Start(Vec<Vec<f64>>),
    /// Mean at the start of each column that needs one.
    Running(Vec<Option<f64>>),
}

/// Reason why the start of a stream is not waited for.
const TOO_LONG: &str = "its start is too long for a stream; give fewer rows or seconds";

/// What a line is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Progress {
    /// Part of the start: its derived columns are not known yet.
    Start {
        /// `true` for the first line.
        is_first: bool,
    },
    /// Complete. The lines of the start, with their derived columns, come with the first such line.
    Complete(Vec<Vec<f64>>),
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
            if let Some(found) = found {
                columns.push(found.column_of());
                located.push((derived.clone(), found));
            }
        }
        Ok(Self {
            columns: located,
            state: State::Start(Vec::new()),
        })
    }

    /// Columns of the stream from which the new ones are computed; `width` is the number of its columns.
    pub(super) fn needed(&self, width: usize) -> impl Iterator<Item = usize> {
        let columns = self.columns.iter().flat_map(|(_, column)| column.columns());
        columns.filter(move |&column| column < width)
    }

    /// Name of a new column, by its place behind those of the stream.
    pub(super) fn name(&self, place: usize) -> &str {
        self.columns.get(place).map_or("", |(derived, _)| &derived.name)
    }

    /// Adds the derived columns to the cells of the next line.
    ///
    /// # Errors
    /// If no cell at the start is a number, or the start is too long.
    pub(super) fn take(&mut self, cells: &mut Vec<f64>) -> Result<Progress, ImportError> {
        match &mut self.state {
            State::Running(means) => {
                for ((_, column), mean) in self.columns.iter().zip(means) {
                    cells.push(column.value(|place| cells[place], *mean));
                }
                Ok(Progress::Complete(Vec::new()))
            }
            State::Start(lines) => {
                lines.push(cells.clone());
                // Times of derived columns do not exist: a span is over by the cells of the stream.
                let has_start = |(_, column): &(_, LocatedDerived)| {
                    column.has_start(lines.len(), |row, place| {
                        lines[row].get(place).copied().unwrap_or(f64::NAN)
                    })
                };
                if let Some((derived, _)) = self.columns.iter().find(|column| !has_start(column)) {
                    if lines.len().saturating_mul(cells.len()) > MAX_CELLS {
                        return Err(derived.refused(TOO_LONG.to_owned()));
                    }
                    let is_first = lines.len() == 1;
                    return Ok(Progress::Start { is_first });
                }
                let mut lines = std::mem::take(lines);
                let mut means = Vec::with_capacity(self.columns.len());
                for (derived, column) in &self.columns {
                    let mean = column.mean_at_start(lines.len(), |row, place| lines[row][place]);
                    if mean.is_some_and(f64::is_nan) {
                        return Err(derived.refused(NOTHING_AT_START.to_owned()));
                    }
                    for line in &mut lines {
                        let value = column.value(|place| line[place], mean);
                        line.push(value);
                    }
                    means.push(mean);
                }
                self.state = State::Running(means);
                *cells = lines.pop().unwrap_or_default();
                Ok(Progress::Complete(lines))
            }
        }
    }
}
