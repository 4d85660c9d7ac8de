//! Positions of targets on the skin, read from a table with the columns target, x and y.

use std::{
    collections::{BTreeMap, HashMap},
    ops::ControlFlow,
    path::Path,
};

use super::{
    Column, DialectChoice, Format, ImportError, Table, TableError, Watch, columns::position, csv_table::Reading,
    importing::read,
};
use decoupler_core::problem::{Channel, TargetPosition};

/// Columns of the table.
const COLUMNS: [&str; 3] = ["target", "x", "y"];
/// Maximum number of targets that a message lists.
const MAX_LISTED: usize = 12;

/// Returns `true` if the file contains positions of targets: a text table with exactly the columns target, x and y.
pub fn holds_positions(path: &Path) -> bool {
    /// Enough for a hundred thousand targets.
    const LARGEST: u64 = 4 << 20;
    let metadata = path.metadata();
    let is_small = metadata.is_ok_and(|metadata| metadata.is_file() && metadata.len() <= LARGEST);
    let has_columns = |table: Table| table.columns.iter().map(|column| column.name.as_str()).eq(COLUMNS);
    is_small && table(path, &mut |_| ControlFlow::Continue(())).is_ok_and(has_columns)
}

/// Reads the positions of `targets` from the file at `path`.
pub(super) fn read_positions(
    path: &Path,
    targets: &[Channel],
    watch: Watch<'_>,
) -> Result<Vec<TargetPosition>, ImportError> {
    let table = table(path, watch)?;
    positions(&table, targets).map_err(|error| error.in_file(path))
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

fn positions(table: &Table, targets: &[Channel]) -> Result<Vec<TargetPosition>, TableError> {
    table.check_widths()?;
    let [names, x, y] = COLUMNS.map(|name| column(table, name));
    let (names, x, y) = (names?, x?, y?);
    let places = HashMap::<&str, usize>::from_iter(targets.iter().map(|target| target.name.as_str()).zip(0..));
    let mut found: Vec<TargetPosition> = Vec::new();
    let (mut line_of_target, mut line_of_place) = (HashMap::new(), BTreeMap::new());
    for row in 0..table.rows {
        let line = table.line(row);
        let (label, x_mm, y_mm) = (names.text(row), x.numbers[row], y.numbers[row]);
        let name = label.trim();
        let Some(&target) = places.get(name) else {
            let listed = targets.iter().take(MAX_LISTED).map(|target| target.name.as_str());
            let listed = Vec::from_iter(listed.chain((targets.len() > MAX_LISTED).then_some("…"))).join(", ");
            let reason = format!("there is no target '{name}'; the targets are {listed}");
            return Err(TableError::in_row(line, reason));
        };
        // −0 and 0 are the same position.
        let place = [x_mm, y_mm].map(|mm| (mm + 0.0).to_bits());
        let same_place = line_of_place.insert(place, line);
        let twice = match (line_of_target.insert(target, line), same_place) {
            (Some(first), _) => Some((first, format!("both are the position of '{name}'; leave one out"))),
            (_, Some(first)) => Some((first, "two targets have the same position; correct one".to_owned())),
            _ => None,
        };
        if let Some((first, reason)) = twice {
            return Err(TableError::Contents(format!("lines {first} and {line}: {reason}")));
        }
        if let Some(first) = found.first().map(|first| &targets[first.target])
            && first.unit != targets[target].unit
        {
            let (one, other) = (first.title(), targets[target].title());
            return Err(TableError::Contents(format!(
                "{one} and {other} have positions but different units, so they cannot share a surface; leave one out, or \
                 correct its unit"
            )));
        }
        found.push(TargetPosition { target, x_mm, y_mm });
    }
    Ok(found)
}

/// Returns a column that is complete, and has numbers in millimetres except for the names.
fn column<'a>(table: &'a Table, name: &str) -> Result<&'a Column, TableError> {
    let found = position(&table.columns, name).filter(|_| matches!(table.format, Format::Text(_)));
    let Some(column) = found.map(|id| &table.columns[id]) else {
        let reason = format!("it has no column '{name}'; positions of targets are text with the header target,x,y");
        return Err(TableError::Contents(reason));
    };
    if let Some(unit) = column.unit.as_ref().filter(|unit| *unit != "mm" && name != COLUMNS[0]) {
        let reason = format!("column '{name}' is in {unit}; give millimetres");
        return Err(TableError::Contents(reason));
    }
    let fault = column.faults.first.as_ref();
    let fault = fault.map(|fault| (fault.line, format!("'{}', which is not a finite number", fault.text)));
    let missing = (0..table.rows).find(|&row| column.is_missing(row));
    let missing = missing.map(|row| (table.line(row), "missing".to_owned()));
    let Some((line, cell)) = fault.or(missing) else {
        return Ok(column);
    };
    let reason = "each line needs the name of a target, and its x and y in millimetres";
    Err(TableError::in_row(line, format!("{name} is {cell}; {reason}")))
}
