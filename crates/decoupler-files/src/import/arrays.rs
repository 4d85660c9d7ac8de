use std::path::Path;

use super::{
    Cells, Column, Fault, Format, Table, TableError,
    column::Labels,
    csv_table::Reading,
    element::Array,
    table::{Excess, Lines, stem},
};
use decoupler_core::text::clean_name;

/// Puts the arrays of one file side by side: those with as many rows as the longest. A single array without a name has the columns
/// c1, c2, …; the columns of an array X are X.c1, X.c2, …, or X if there is one.
pub(super) fn table(
    path: &Path,
    arrays: Vec<Array>,
    format: Format,
    left_out: Vec<String>,
    reading: &Reading<'_>,
) -> Result<Table, TableError> {
    let mut notes: Vec<String> = left_out
        .into_iter()
        .map(|what| format!("left out: {}", clean_name(&what)))
        .collect();
    let Some(rows) = arrays.iter().map(|array| array.rows).max() else {
        let found = if notes.is_empty() {
            "nothing is in it".to_owned()
        } else {
            notes.join("; ")
        };
        return Err(TableError::array("there is no array of numbers", found));
    };
    let mut columns = Vec::new();
    for mut array in arrays {
        array.name = clean_name(&array.name);
        if array.rows != rows {
            notes.push(format!("left out: {} has {} rows, not {rows}", array.name, array.rows));
            continue;
        }
        let width = array.columns.len();
        for (index, numbers) in array.columns.into_iter().enumerate() {
            let name = match (array.name.as_str(), width) {
                ("", _) => format!("c{}", index + 1),
                (name, 1) => name.to_owned(),
                (name, _) => format!("{name}.c{}", index + 1),
            };
            columns.push(column(name, numbers, reading));
        }
    }
    Ok(Table {
        stem: stem(path),
        columns,
        rows,
        format,
        notes,
        too_long: Excess::default(),
        too_short: Excess::default(),
        lines: Lines::default(),
    })
}

fn column(name: String, mut numbers: Vec<f64>, reading: &Reading<'_>) -> Column {
    let rules = reading
        .missing
        .iter()
        .filter(|(column, _)| column.as_ref().is_none_or(|column| *column == name));
    let rules: Vec<_> = rules.map(|(_, rule)| *rule).collect();
    let mut column = Column {
        name,
        ..Column::default()
    };
    for (row, number) in numbers.iter_mut().enumerate() {
        if number.is_nan() || rules.iter().any(|rule| rule.is_number(*number)) {
            column.missing += 1;
            *number = f64::NAN;
        } else if number.is_infinite() {
            column.faults.count += 1;
            column.faults.first.get_or_insert(Fault {
                line: row as u64 + 1,
                text: number.to_string(),
            });
            *number = f64::NAN;
        }
    }
    if reading.labels.contains(&column.name) {
        let mut labels = Labels::default();
        for &number in &numbers {
            labels.push((!number.is_nan()).then_some((&number.to_string(), Some(number))));
        }
        column.cells = labels.into_cells();
    } else {
        column.cells = Cells::Numbers(numbers);
    }
    column
}
