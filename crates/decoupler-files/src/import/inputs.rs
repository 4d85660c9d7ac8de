use std::path::Path;

use decoupler_core::{
    dataset::RowOrder,
    problem::{Channel, Problem},
    text::{clean_name, counted},
};
use ndarray::Array2;
use thiserror::Error;

use super::{
    Column, Derived, ImportError, Recipe, TableError, Watch,
    csv_table::named,
    derived::{DerivedStream, TimeColumn},
    selection::{Rows, order_note, seconds},
    suggestion::Meanings,
    table::name_and_unit,
};

/// Inputs of a network, read from a file.
#[derive(Clone, Debug)]
pub struct InputTable {
    /// Samples × inputs of the network: the readings or, with a memory, their features.
    pub readings: Array2<f64>,
    /// Row-wire of each sample, from 0, if the recipe names a row-wire column and the file has it.
    pub row_wires: Option<Vec<usize>>,
    /// Time of each sample in seconds, if the recipe names a time column and the file has it; NaN where it is missing.
    pub times_s: Option<Vec<f64>>,
    /// Line of each sample, from 1.
    pub lines: Vec<u64>,
    /// Last line of a text file, if it is cut off and therefore left out.
    pub torn_line: Option<u64>,
    /// Notes on times, which a memory needs: lines that are left out, and the order of the lines.
    pub warnings: Vec<String>,
    /// Columns of the recipe that say when or to what a sample belongs, as far as the file has them: time, group and
    /// row-wire.
    pub kept: Vec<KeptColumn>,
}

/// Column that is copied from an input to the output.
#[derive(Clone, Debug)]
pub struct KeptColumn {
    /// Name, with the unit in brackets if there is one.
    pub title: String,
    /// Text of each cell; empty if it is missing.
    pub cells: Vec<String>,
}

/// Columns of a table that contain the inputs of a network.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct InputColumns {
    /// Column index of each input, in the order of the network.
    pub(super) inputs: Vec<usize>,
    /// Index of the row-wire column, if there is one.
    pub(super) row_wire: Option<usize>,
    /// Index of the time column and the seconds in its unit, if there is one.
    pub(super) time: Option<(usize, f64)>,
    /// Index of the group column, if a memory needs it and there is one.
    pub(super) group: Option<usize>,
    /// Columns copied to the output, with their titles.
    pub(super) kept: Vec<(usize, String)>,
    /// Number of columns of the table.
    pub(super) width: usize,
}

/// Names of the columns that contain no inputs of a network.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct OtherColumns {
    /// Column of row-wires.
    pub(super) row_wire: Option<String>,
    /// Time column, which a memory and derived columns need.
    pub(super) time: Option<String>,
    /// Unit of the times, if the header does not give it.
    pub(super) time_unit: Option<String>,
    /// Column of groups, which a memory needs.
    pub(super) group: Option<String>,
    /// Columns that say when or to what a sample belongs and are copied to the output.
    pub(super) kept: Vec<String>,
}

/// Reason why the columns of a table are not the inputs of a network.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum InputError {
    /// No column has the name of an input.
    #[error("there is no column '{name}', which is an input of the network; {near}")]
    Missing {
        /// Name of the input.
        name: String,
        /// Similar names, or all names, as a phrase.
        near: String,
    },
    /// The unit of a column differs from that of the input.
    #[error("column '{name}' is in {found}, and the network was trained on {expected}; convert it")]
    Unit {
        /// Name of the input.
        name: String,
        /// Unit in the header.
        found: String,
        /// Unit of the input.
        expected: String,
    },
    /// Two columns have the name of an input.
    #[error("there are two columns '{0}'; keep one")]
    Twice(String),
    /// A derived column cannot be computed.
    #[error("{0}")]
    Derived(String),
    /// There is no header, and the number of columns is wrong.
    #[error("{} where {expected} are needed, separated by commas; give the inputs of the network in their order, or a header", counted(*.found, "cell"))]
    Count {
        /// Number of columns.
        found: usize,
        /// Number needed.
        expected: usize,
    },
}

impl InputColumns {
    /// Finds the inputs and the `others` in the cells of a header.
    ///
    /// # Errors
    /// If an input has no column of its name, or a column with a different unit.
    pub(super) fn of_header(header: &[String], inputs: &[Channel], others: &OtherColumns) -> Result<Self, InputError> {
        Self::find(&named(header, header.len()), inputs, others)
    }

    /// Finds the inputs among `width` columns with these names, or without names, and those of `derive`, whose cells follow
    /// those of a line.
    ///
    /// # Errors
    /// If an input has no column of its name, or a derived column cannot be computed from the others.
    pub(super) fn with_derived(
        header: &[String],
        width: usize,
        inputs: &[Channel],
        others: &OtherColumns,
        derive: &[Derived],
    ) -> Result<(Self, DerivedStream), InputError> {
        let mut columns = named(header, width);
        let time = others.time.as_deref().map(|name| TimeColumn {
            name,
            given_unit: others.time_unit.as_deref(),
        });
        let derived =
            DerivedStream::new(derive, &mut columns, time).map_err(|error| InputError::Derived(error.to_string()))?;
        let found = Self::find(&columns, inputs, others)?;
        Ok((Self { width, ..found }, derived))
    }

    /// Finds the inputs among `width` columns without names, which are called c1, c2, … as in a recording without a header. If
    /// the inputs have other names, the columns are the inputs in their order, after the number of the row-wire if
    /// `has_row_wire`.
    ///
    /// # Errors
    /// If the number of columns is wrong.
    pub(super) fn unnamed(
        width: usize,
        inputs: &[Channel],
        others: &OtherColumns,
        has_row_wire: bool,
    ) -> Result<Self, InputError> {
        if let Ok(found) = Self::find(&named(&[], width), inputs, others)
            && found.row_wire.is_some() >= has_row_wire
        {
            return Ok(found);
        }
        let before = usize::from(has_row_wire);
        let expected = before + inputs.len();
        if width != expected {
            return Err(InputError::Count { found: width, expected });
        }
        Ok(Self::in_order(inputs.len(), has_row_wire))
    }

    /// Returns the first `count` columns or, if the first has the row-wire, those after it.
    pub(super) fn in_order(count: usize, begins_with_row_wire: bool) -> Self {
        let before = usize::from(begins_with_row_wire);
        Self {
            inputs: (before..before + count).collect(),
            row_wire: begins_with_row_wire.then_some(0),
            time: None,
            group: None,
            kept: Vec::new(),
            width: before + count,
        }
    }

    /// Returns the first input that several cells of a header name.
    pub(super) fn named_twice(header: &[String], inputs: &[Channel]) -> Option<String> {
        let count = |input: &&Channel| header.iter().filter(|cell| name_and_unit(cell).0 == input.name).count();
        Some(inputs.iter().find(|input| count(input) > 1)?.name.clone())
    }

    /// Returns `true` if the cells are a header: the names of all inputs, the names of some inputs among other texts, or only
    /// texts, as many as there are inputs. A single text is a header in the first line only: elsewhere it may be garbage.
    pub(super) fn is_header(cells: &[String], inputs: &[Channel], is_first_line: bool) -> bool {
        let is_name = |cell: &String| inputs.iter().any(|input| input.name == name_and_unit(cell).0);
        let is_text = |cell: &&String| !cell.trim().is_empty() && cell.trim().parse::<f64>().is_err();
        let (names, texts) = (
            cells.iter().filter(|cell| is_name(cell)).count(),
            cells.iter().filter(is_text).count(),
        );
        (names >= inputs.len() && Self::has_all(cells, inputs))
            || (names > 0 && texts > 0)
            || (texts == cells.len() && texts >= inputs.len() && (texts > 1 || is_first_line))
    }

    /// Returns `true` if the cells are a header with the names of all inputs.
    pub(super) fn has_all(cells: &[String], inputs: &[Channel]) -> bool {
        Self::of_header(cells, inputs, &OtherColumns::default()).is_ok()
    }

    /// Replaces `readings` by the inputs of a line.
    pub(super) fn gather(&self, cells: &[f64], readings: &mut Vec<f64>) {
        readings.clear();
        readings.extend(self.inputs.iter().map(|&column| cells[column]));
    }

    /// Time of a line in seconds; `None` without a time.
    pub(super) fn time_s(&self, cells: &[f64]) -> Option<f64> {
        let time_s = self.time.map(|(column, unit_s)| unit_s * cells[column]);
        time_s.filter(|time_s| time_s.is_finite())
    }

    fn find(columns: &[Column], inputs: &[Channel], others: &OtherColumns) -> Result<Self, InputError> {
        let names = Names::of(&[columns], &[]);
        let mut found = Vec::with_capacity(inputs.len());
        for Channel { name, unit, .. } in inputs {
            let column = match names.find(name) {
                Ok(id) => id.column,
                Err(ImportError::Unknown { name, near }) => return Err(InputError::Missing { name, near }),
                Err(error) => {
                    let (name, near) = (name.clone(), error.to_string());
                    return Err(InputError::Missing { name, near });
                }
            };
            if let (Some(found), Some(expected)) = (&columns[column].unit, unit)
                && found != expected
            {
                return Err(InputError::Unit {
                    name: name.clone(),
                    found: found.clone(),
                    expected: expected.clone(),
                });
            }
            found.push(column);
        }
        let other = |name: &Option<String>| Some(names.find(name.as_ref()?).ok()?.column);
        let time = other(&others.time).and_then(|column| {
            let unit = columns[column].unit.as_deref().or(others.time_unit.as_deref());
            let unit_s = seconds(unit)?;
            Some((column, unit_s))
        });
        let kept = others
            .kept
            .iter()
            .filter_map(|name| Some(names.find(name).ok()?.column));
        let kept = kept.filter(|column| !found.contains(column)).map(|column| {
            let Column { name, unit, .. } = &columns[column];
            (column, Channel::new(name, unit.as_deref()).title())
        });
        Ok(Self {
            kept: kept.collect(),
            row_wire: other(&others.row_wire),
            group: other(&others.group),
            inputs: found,
            time,
            width: columns.len(),
        })
    }
}

impl Recipe {
    /// Reads the inputs of a network of `problem` from the file at `path`: the columns with their names or, without a header,
    /// as many columns as there are inputs, after the number of the row-wire if `has_row_wire`. A memory continues as in
    /// training, by the group, row-wire and time of each line, if the file has these columns.
    ///
    /// # Errors
    /// If the file cannot be read, a column is missing or has a different unit, or a cell is missing or not a number.
    pub fn read_inputs(
        &self,
        path: &Path,
        problem: &Problem,
        has_row_wire: bool,
        watch: Watch<'_>,
    ) -> Result<InputTable, ImportError> {
        let (inputs, others) = (&problem.inputs, &self.other_columns(problem));
        let files = [(path.to_owned(), self.read(Path::new(""), 0, path, None, watch)?.1)];
        let table = &files[0].1;
        if let Some(line) = table.too_long.first_line {
            return Err(TableError::Uneven { line }.in_file(path));
        }
        // Derived columns have names.
        let has_header = table.has_header() || !self.derive.is_empty();
        let found = if has_header {
            InputColumns::find(&table.columns, inputs, others)
        } else {
            InputColumns::unnamed(table.columns.len(), inputs, others, has_row_wire)
        };
        let found = found.map_err(|error| TableError::Inputs(error).in_file(path))?;
        let id = |column: usize| ColumnId { file: 0, column };
        // A memory cannot place a row without a time.
        let time = found
            .time
            .filter(|_| problem.memory.is_some())
            .map(|(column, _)| id(column));
        let given_unit = time.zip(others.time_unit.clone());
        let meanings = Meanings {
            inputs: found.inputs.iter().copied().map(id).collect(),
            time,
            group: found.group.map(id),
            row_wire: found.row_wire.map(id),
            units: given_unit
                .into_iter()
                .filter(|(id, _)| table.columns[id.column].unit.is_none())
                .collect(),
            ..Meanings::default()
        };
        let names = Names::of(&[&table.columns], &[]);
        let rows = Rows {
            recipe: self,
            files: &files,
            names: &names,
            meanings: &meanings,
            joins: &[],
        };
        rows.check_numbers()?;
        let cells = |column: usize| &table.columns[column].cells;
        for &column in found.inputs.iter().chain(&found.row_wire) {
            if let Some(row) = (0..table.rows).find(|&row| cells(column).is_missing(row)) {
                return Err(ImportError::MissingInput {
                    path: path.to_owned(),
                    line: table.line(row),
                    name: table.columns[column].name.clone(),
                });
            }
        }
        let is_placed = |row: &usize| time.is_none_or(|id| !cells(id.column).is_missing(*row));
        let (placed, without_time): (Vec<usize>, Vec<usize>) = (0..table.rows).partition(is_placed);
        let mut warnings = Vec::new();
        if let Some(&row) = without_time.first() {
            let verb = if without_time.len() == 1 { "is" } else { "are" };
            warnings.push(format!(
                "{} without a time, which the history of readings needs, {verb} left out; the first is line {}",
                counted(without_time.len(), "line"),
                table.line(row)
            ));
        }
        let mut readings = Array2::from_shape_fn((placed.len(), inputs.len()), |(row, input)| {
            cells(found.inputs[input]).number(placed[row])
        });
        let times_s = self.time.as_ref().and_then(|name| {
            let Column { cells, unit, .. } = &table.columns[names.find(name).ok()?.column];
            let unit_s = seconds(unit.as_deref().or_else(|| self.unit_of(name)))?;
            Some(placed.iter().map(|&row| unit_s * cells.number(row)).collect())
        });
        if let Some(memory) = &problem.memory {
            let history = rows.past(&placed, &placed)?.with_readings(readings);
            if let order @ (RowOrder::Restarts { first_row, .. } | RowOrder::Shuffled { first_row, .. }) =
                history.order()
            {
                warnings.extend(order_note(order, table.line(placed[first_row])));
            }
            let features = history.features(memory);
            readings = features
                .map_err(|error| ImportError::from(error).of_file(path))?
                .into_owned();
        }
        let kept = found.kept.iter().map(|(column, title)| KeptColumn {
            title: title.clone(),
            cells: placed.iter().map(|&row| cells(*column).text(row)).collect(),
        });
        Ok(InputTable {
            readings,
            row_wires: rows.row_wires(&placed)?,
            times_s,
            lines: placed.iter().map(|&row| table.line(row)).collect(),
            torn_line: table.torn_line,
            warnings,
            kept: kept.collect(),
        })
    }

    /// Names of the columns that contain no inputs of a network of `problem`; times are used only by a memory and by derived
    /// columns.
    pub(super) fn other_columns(&self, problem: &Problem) -> OtherColumns {
        let needs_time = problem.memory.is_some() || self.derive.iter().any(Derived::needs_time);
        let time = self.time.clone().filter(|_| needs_time);
        let kept = [&self.time, &self.group, &self.row_wire].into_iter().flatten();
        OtherColumns {
            kept: kept.cloned().collect(),
            row_wire: self.row_wire.clone(),
            group: self.group.clone().filter(|_| problem.memory.is_some()),
            time_unit: time.as_deref().and_then(|time| self.unit_of(time)).map(str::to_owned),
            time,
        }
    }
}

/// Column of one of the files of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct ColumnId {
    /// Number of the file: 0, or the number of the joined file from 1.
    pub(super) file: usize,
    /// Index of the column in its file.
    pub(super) column: usize,
}

/// Full names of all columns; the columns of a joined file are prefixed with its stem.
pub(super) struct Names {
    names: Vec<(String, ColumnId)>,
}

/// Number of names above which a message lists only names similar to the one given.
const FEW: usize = 24;

impl Names {
    /// Names the columns of each file; `stems` are the stems of the joined files.
    pub(super) fn of(files: &[&[Column]], stems: &[String]) -> Self {
        let mut names = Vec::new();
        for (file, columns) in files.iter().enumerate() {
            for (index, column) in columns.iter().enumerate() {
                let name = match file.checked_sub(1) {
                    None => column.name.clone(),
                    Some(joined) => format!("{}.{}", stems[joined], column.name),
                };
                names.push((name, ColumnId { file, column: index }));
            }
        }
        Self { names }
    }

    /// Returns the full name of a column.
    pub(super) fn name(&self, id: ColumnId) -> &str {
        let found = self.names.iter().find(|(_, other)| *other == id);
        found.map_or("", |(name, _)| name)
    }

    /// Names of all columns.
    pub(super) fn all(&self) -> impl Iterator<Item = (&str, ColumnId)> {
        self.names.iter().map(|(name, id)| (name.as_str(), *id))
    }

    /// Finds a column by its full name, with or without the unit given in the header.
    pub(super) fn find(&self, given: &str) -> Result<ColumnId, ImportError> {
        let name = &clean_name(given.trim());
        let bare = super::table::name_and_unit(name).0;
        let with = |name: &str| -> Vec<ColumnId> {
            let found = self.names.iter().filter(|(other, _)| other == name);
            found.map(|(_, id)| *id).collect()
        };
        let mut found = with(name);
        if found.is_empty() {
            found = with(bare);
        }
        match found[..] {
            [id] => Ok(id),
            [] => Err(ImportError::Unknown {
                name: name.to_owned(),
                near: self.near(name),
            }),
            _ => Err(ImportError::Ambiguous {
                name: name.to_owned(),
                candidates: found
                    .iter()
                    .map(|id| format!("column {} of file {}", id.column + 1, id.file + 1))
                    .collect::<Vec<_>>()
                    .join(", "),
            }),
        }
    }

    /// Returns the columns given by names and ranges such as `c2..c16`.
    pub(super) fn find_all(&self, given: &[String]) -> Result<Vec<ColumnId>, ImportError> {
        let mut all = Vec::new();
        for name in given {
            // A name may contain two points.
            match (self.find(name), name.split_once("..")) {
                (Ok(id), _) => all.push(id),
                (Err(error), None) => return Err(error),
                (Err(_), Some((first, last))) => all.extend(self.range(name, first, last)?),
            }
        }
        Ok(all)
    }

    fn range(&self, given: &str, first: &str, last: &str) -> Result<Vec<ColumnId>, ImportError> {
        let first_id = self.find(first)?;
        // `states.c2..c4` is short for `states.c2..states.c4`.
        let prefix = first
            .trim()
            .rsplit_once('.')
            .map(|(prefix, _)| format!("{prefix}.{}", last.trim()));
        let last_id = match (self.find(last), prefix) {
            (Ok(id), _) if id.file == first_id.file => id,
            (_, Some(prefixed)) => self.find(&prefixed)?,
            (found, None) => found?,
        };
        if first_id.file != last_id.file || first_id.column > last_id.column {
            return Err(ImportError::Range(given.to_owned()));
        }
        let file = first_id.file;
        Ok((first_id.column..=last_id.column)
            .map(|column| ColumnId { file, column })
            .collect())
    }

    /// Lists the columns, or the names similar to `name`.
    fn near(&self, name: &str) -> String {
        if self.names.len() <= FEW {
            let all: Vec<&str> = self.names.iter().map(|(name, _)| name.as_str()).collect();
            return format!("there are {}", all.join(", "));
        }
        let mut by_distance: Vec<(usize, &str)> = self
            .names
            .iter()
            .map(|(other, _)| (distance(name, other), other.as_str()))
            .collect();
        by_distance.sort_by_key(|(distance, _)| *distance);
        let near: Vec<&str> = by_distance.into_iter().take(6).map(|(_, name)| name).collect();
        format!(
            "of {} columns, these have the most similar names: {}",
            self.names.len(),
            near.join(", ")
        )
    }
}

/// Edit distance of two names, ignoring case: the number of letters to be inserted, removed or replaced.
fn distance(one: &str, other: &str) -> usize {
    let beginning = |text: &str| text.chars().take(64).collect::<String>().to_lowercase();
    strsim::levenshtein(&beginning(one), &beginning(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_edit_distance_ignores_case() {
        for (one, other, expected) in [
            ("force", "force", 0),
            ("force", "Forec", 2),
            ("", "abc", 3),
            ("kitten", "sitting", 3),
        ] {
            assert_eq!(distance(one, other), expected, "{one} {other}");
        }
    }
}
