use std::path::Path;

use decoupler_core::{evaluation::Channel, text::clean_name};
use ndarray::Array2;
use thiserror::Error;

use super::{Column, ImportError, Recipe, Table, TableError, Watch, csv_table::named, table::name_and_unit};

/// Inputs of a network, read from a file.
#[derive(Clone, Debug)]
pub struct InputTable {
    /// Samples × inputs.
    pub readings: Array2<f64>,
    /// Row-wire of each sample, from 0, if the recipe names a row-wire column and the file has it.
    pub row_wires: Option<Vec<usize>>,
    /// Line of each sample, from 1.
    pub lines: Vec<u64>,
}

/// Columns of a table that contain the inputs of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputColumns {
    /// Column index of each input, in the order of the network.
    pub inputs: Vec<usize>,
    /// Index of the row-wire column, if there is one.
    pub row_wire: Option<usize>,
    /// Number of columns of the table.
    pub width: usize,
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
    /// There is no header, and the number of columns is wrong.
    #[error("{found} cells where {expected} are needed; give the inputs of the network in their order, or a header")]
    Count {
        /// Number of columns.
        found: usize,
        /// Number needed.
        expected: usize,
    },
}

impl InputColumns {
    /// Finds the inputs and the column `row_wire` in the cells of a header.
    ///
    /// # Errors
    /// If an input has no column of its name, or a column with a different unit.
    pub fn of_header(header: &[String], inputs: &[Channel], row_wire: Option<&str>) -> Result<Self, InputError> {
        Self::find(&named(header, header.len()), inputs, row_wire)
    }

    /// Finds the inputs among `width` columns without names, which are called c1, c2, … as in a recording without a header. If
    /// the inputs have other names, the columns are the inputs in their order, after the number of the row-wire if
    /// `has_row_wire`.
    ///
    /// # Errors
    /// If the number of columns is wrong.
    pub fn unnamed(
        width: usize,
        inputs: &[Channel],
        row_wire: Option<&str>,
        has_row_wire: bool,
    ) -> Result<Self, InputError> {
        if let Ok(found) = Self::find(&named(&[], width), inputs, row_wire)
            && found.row_wire.is_some() >= has_row_wire
        {
            return Ok(found);
        }
        let before = usize::from(has_row_wire);
        let expected = before + inputs.len();
        if width != expected {
            return Err(InputError::Count { found: width, expected });
        }
        Ok(Self {
            inputs: (before..width).collect(),
            row_wire: has_row_wire.then_some(0),
            width,
        })
    }

    /// Returns `true` if the cells are a header: the names of all inputs, the names of some inputs among other texts, or only
    /// texts, as many as there are inputs. A single text is a header in the first line only: elsewhere it may be garbage.
    pub fn is_header(cells: &[String], inputs: &[Channel], is_first_line: bool) -> bool {
        let is_name = |cell: &String| inputs.iter().any(|input| input.name == name_and_unit(cell).0);
        let is_text = |cell: &&String| !cell.trim().is_empty() && cell.trim().parse::<f64>().is_err();
        let (names, texts) = (
            cells.iter().filter(|cell| is_name(cell)).count(),
            cells.iter().filter(is_text).count(),
        );
        let has_all = names >= inputs.len() && Self::of_header(cells, inputs, None).is_ok();
        has_all
            || (names > 0 && texts > 0)
            || (texts == cells.len() && texts >= inputs.len() && (texts > 1 || is_first_line))
    }

    fn find(columns: &[Column], inputs: &[Channel], row_wire: Option<&str>) -> Result<Self, InputError> {
        let names = Names::of_columns(&[columns], &[]);
        let mut found = Vec::with_capacity(inputs.len());
        for Channel { name, unit } in inputs {
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
        Ok(Self {
            inputs: found,
            row_wire: row_wire.and_then(|name| Some(names.find(name).ok()?.column)),
            width: columns.len(),
        })
    }
}

impl Recipe {
    /// Reads the inputs from the file at `path`: the columns with their names or, without a header, as many columns as there
    /// are inputs, after the number of the row-wire if `has_row_wire`.
    ///
    /// # Errors
    /// If the file cannot be read, a column is missing or has a different unit, or a cell is missing or not a number.
    pub fn read_inputs(
        &self,
        path: &Path,
        inputs: &[Channel],
        has_row_wire: bool,
        watch: Watch<'_>,
    ) -> Result<InputTable, ImportError> {
        let file = (path.to_owned(), self.read(Path::new(""), 0, path, None, watch)?.1);
        let table = &file.1;
        if let Some(line) = table.too_long.first_line {
            return Err(self.uneven(path, line));
        }
        let names = Names::of(&[table], &[]);
        let has_header = table.dialect().is_none_or(|dialect| dialect.header);
        let found = if has_header {
            InputColumns::find(&table.columns, inputs, self.row_wire.as_deref())
        } else {
            InputColumns::unnamed(table.columns.len(), inputs, self.row_wire.as_deref(), has_row_wire)
        };
        let InputColumns {
            inputs: columns,
            row_wire,
            ..
        } = found.map_err(|source| ImportError::Inputs {
            path: path.to_owned(),
            source,
        })?;
        let files = [file];
        for &column in columns.iter().chain(&row_wire) {
            super::selection::not_a_number(&files, &names, ColumnId { file: 0, column })?;
        }
        let table = &files[0].1;
        for &column in columns.iter().chain(&row_wire) {
            let cells = &table.columns[column].cells;
            if let Some(row) = (0..table.rows).find(|&row| cells.is_missing(row)) {
                return Err(ImportError::MissingInput {
                    path: path.to_owned(),
                    line: table.line(row),
                    name: table.columns[column].name.clone(),
                });
            }
        }
        let readings = Array2::from_shape_fn((table.rows, columns.len()), |(row, input)| {
            table.columns[columns[input]].cells.number(row)
        });
        let row_wires = match row_wire {
            None => None,
            Some(column) => {
                let name = &table.columns[column].name;
                let of = |row| super::selection::row_wire(name, table.columns[column].cells.number(row));
                Some((0..table.rows).map(of).collect::<Result<_, _>>()?)
            }
        };
        Ok(InputTable {
            readings,
            row_wires,
            lines: (0..table.rows).map(|row| table.line(row)).collect(),
        })
    }

    fn uneven(&self, path: &Path, line: u64) -> ImportError {
        ImportError::File {
            path: path.to_owned(),
            source: TableError::Uneven { line },
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
    /// Names the columns of the files; `stems` are the stems of the joined files.
    pub(super) fn of(files: &[&Table], stems: &[String]) -> Self {
        let columns: Vec<&[Column]> = files.iter().map(|table| table.columns.as_slice()).collect();
        Self::of_columns(&columns, stems)
    }

    /// Names the columns of each file; `stems` are the stems of the joined files.
    pub(super) fn of_columns(files: &[&[Column]], stems: &[String]) -> Self {
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
