use std::path::Path;

use ndarray::Array2;

use super::{Channel, ImportError, Recipe, TableError, Watch, names::Names};

/// Readings of a file for a network that was trained on others of its kind.
#[derive(Clone, Debug)]
pub struct InputTable {
    /// Samples × inputs.
    pub readings: Array2<f64>,
    /// Row-wire of each sample, from 0, if the recipe names a column of them and the file has it.
    pub row_wires: Option<Vec<usize>>,
    /// Line of each sample, from 1.
    pub lines: Vec<u64>,
}

impl Recipe {
    /// Reads the inputs from the file at `path`: columns of their names or, without a header, as many columns as there are inputs.
    ///
    /// # Errors
    /// If the file cannot be read, lacks a column, or a cell is missing or no number.
    pub fn read_inputs(&self, path: &Path, inputs: &[Channel], watch: Watch<'_>) -> Result<InputTable, ImportError> {
        let file = (path.to_owned(), self.read(Path::new(""), 0, path, None, watch)?.1);
        let table = &file.1;
        if let Some(line) = table.too_long.first_line {
            return Err(self.uneven(path, line));
        }
        let names = Names::of(&[table], &[]);
        let named: Result<Vec<usize>, ImportError> =
            inputs.iter().map(|input| Ok(names.find(&input.name)?.column)).collect();
        let has_header = table.dialect().is_none_or(|dialect| dialect.header);
        let columns = match named {
            Ok(columns) => columns,
            Err(_) if !has_header && table.columns.len() == inputs.len() => (0..inputs.len()).collect(),
            Err(error) => return Err(error),
        };
        let row_wire = self
            .row_wire
            .as_ref()
            .and_then(|name| names.find(name).ok())
            .map(|id| id.column);
        let files = [file];
        for &column in columns.iter().chain(&row_wire) {
            super::selection::not_a_number(&files, &names, super::names::ColumnId { file: 0, column })?;
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
