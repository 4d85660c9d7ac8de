//! Positions of targets on the skin, read from a table with the columns target, x and y.

use std::{
    collections::{BTreeMap, HashMap},
    ops::ControlFlow,
    path::Path,
};

use thiserror::Error;

use super::{
    Cells, Column, DialectChoice, Format, ImportError, Table, TableError, Watch, csv_table::Reading, importing::read,
};
use decoupler_core::problem::{Channel, TargetPosition};

/// Columns of the table.
const COLUMNS: [&str; 3] = ["target", "x", "y"];

/// Error in a table of positions. Lines are counted from 1.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PositionsError {
    /// A column is missing.
    #[error("it has no column '{missing}'; positions of targets are text with the header target,x,y")]
    NoColumn {
        /// Name of the column.
        missing: &'static str,
    },
    /// A coordinate is not in millimetres.
    #[error("column '{column}' is in {unit}; give millimetres")]
    Unit {
        /// Name of the column.
        column: &'static str,
        /// Its unit.
        unit: String,
    },
    /// A cell is missing or not a number.
    #[error("line {line}: {column} is {cell}; each line needs the name of a target, and its x and y in millimetres")]
    Cell {
        /// Line of the cell.
        line: u64,
        /// Name of its column.
        column: &'static str,
        /// The cell, as a phrase.
        cell: String,
    },
    /// There is no target of this name.
    #[error("line {line}: there is no target '{name}'; the targets are {targets}")]
    NoTarget {
        /// Line of the name.
        line: u64,
        /// The name.
        name: String,
        /// Names of all targets, or the first of them.
        targets: String,
    },
    /// A target has two positions.
    #[error("lines {first} and {second}: both are the position of '{name}'; leave one out")]
    SameTarget {
        /// Line of the first.
        first: u64,
        /// Line of the second.
        second: u64,
        /// Name of the target.
        name: String,
    },
    /// Two targets have the same position.
    #[error("lines {first} and {second}: two targets have the same position; correct one")]
    SamePlace {
        /// Line of the first.
        first: u64,
        /// Line of the second.
        second: u64,
    },
    /// Targets with positions have different units.
    #[error(
        "{one} and {other} have positions but different units, so they cannot share a surface; leave one out, or \
         correct its unit"
    )]
    Units {
        /// Name and unit of the first.
        one: String,
        /// Name and unit of another.
        other: String,
    },
}

/// Returns `true` if the file contains positions of targets: a text table with exactly the columns target, x and y.
pub fn holds_positions(path: &Path) -> bool {
    /// Enough for a hundred thousand targets.
    const LARGEST: u64 = 4 << 20;
    let is_small = path
        .metadata()
        .is_ok_and(|metadata| metadata.is_file() && metadata.len() <= LARGEST);
    if !is_small {
        return false;
    }
    let table = table(path, &mut |_| ControlFlow::Continue(()));
    table.is_ok_and(|table| table.columns.iter().map(|column| column.name.as_str()).eq(COLUMNS))
}

/// Reads the positions of `targets` from the file at `path`.
pub(super) fn read_positions(
    path: &Path,
    targets: &[Channel],
    watch: Watch<'_>,
) -> Result<Vec<TargetPosition>, ImportError> {
    let table = table(path, watch)?;
    if let Some(line) = table.too_long.first_line {
        return Err(TableError::Uneven { line }.in_file(path));
    }
    positions(&table, targets).map_err(|error| TableError::Positions(error).in_file(path))
}

fn table(path: &Path, watch: Watch<'_>) -> Result<Table, ImportError> {
    let reading = Reading {
        choice: DialectChoice {
            header: Some(true),
            ..DialectChoice::default()
        },
        label: Some(COLUMNS[0].to_owned()),
        ..Reading::default()
    };
    read(path, &reading, watch)
}

fn positions(table: &Table, targets: &[Channel]) -> Result<Vec<TargetPosition>, PositionsError> {
    let column = |missing| {
        let found = table.columns.iter().find(|column| column.name == missing);
        found.ok_or(PositionsError::NoColumn { missing })
    };
    let [names, x, y] = COLUMNS;
    let [names, x, y] = [column(names)?, column(x)?, column(y)?];
    let (Cells::Labels { numbers, texts }, Format::Text(_)) = (&names.cells, &table.format) else {
        return Err(PositionsError::NoColumn { missing: COLUMNS[0] });
    };
    for (column, name) in [(x, COLUMNS[1]), (y, COLUMNS[2])] {
        check_numbers(table, column, name)?;
    }
    let places: HashMap<&str, usize> = targets
        .iter()
        .enumerate()
        .map(|(index, target)| (target.name.as_str(), index))
        .collect();
    let mut found: Vec<TargetPosition> = Vec::new();
    let (mut line_of_target, mut line_of_place) = (HashMap::new(), BTreeMap::new());
    for (row, label) in numbers.iter().enumerate() {
        let line = table.line(row);
        let label = label.map(|label| texts[label as usize].0.trim());
        let name = label.ok_or_else(|| PositionsError::Cell {
            line,
            column: COLUMNS[0],
            cell: "missing".to_owned(),
        })?;
        let &target = places.get(name).ok_or_else(|| PositionsError::NoTarget {
            line,
            name: name.to_owned(),
            targets: listed(targets),
        })?;
        let (x_mm, y_mm) = (x.cells.number(row), y.cells.number(row));
        if let Some(first) = line_of_target.insert(target, line) {
            return Err(PositionsError::SameTarget {
                first,
                second: line,
                name: name.to_owned(),
            });
        }
        // −0 and 0 are the same position.
        if let Some(first) = line_of_place.insert([x_mm, y_mm].map(|mm| (mm + 0.0).to_bits()), line) {
            return Err(PositionsError::SamePlace { first, second: line });
        }
        if let Some(first) = found.first().map(|first| &targets[first.target])
            && first.unit != targets[target].unit
        {
            return Err(PositionsError::Units {
                one: first.title(),
                other: targets[target].title(),
            });
        }
        found.push(TargetPosition { target, x_mm, y_mm });
    }
    Ok(found)
}

/// Checks that the column contains a number in every row, in millimetres.
fn check_numbers(table: &Table, column: &Column, name: &'static str) -> Result<(), PositionsError> {
    if let Some(unit) = column.unit.as_ref().filter(|unit| *unit != "mm") {
        return Err(PositionsError::Unit {
            column: name,
            unit: unit.clone(),
        });
    }
    if let Some(fault) = &column.faults.first {
        return Err(PositionsError::Cell {
            line: fault.line,
            column: name,
            cell: format!("'{}', which is not a finite number", fault.text),
        });
    }
    match (0..table.rows).find(|&row| column.cells.is_missing(row)) {
        Some(row) => Err(PositionsError::Cell {
            line: table.line(row),
            column: name,
            cell: "missing".to_owned(),
        }),
        None => Ok(()),
    }
}

/// Lists the names of the targets, or the first of them.
fn listed(targets: &[Channel]) -> String {
    const MAX: usize = 12;
    let mut names = Vec::from_iter(targets.iter().take(MAX).map(|target| target.name.as_str()));
    if targets.len() > MAX {
        names.push("…");
    }
    names.join(", ")
}
