//! Tables of the arrays in a file: those with one row per sample, chosen by the columns that are used.

use std::{collections::BTreeMap, path::Path};

use decoupler_core::text::{clean_name, original_name};

use super::{Column, Format, Missing, Table, TableError, Variable, csv_table::Reading, format::Array, table::Labels};

/// Maximum number of rows of an array that are one sample, such as two readings per press.
const MAX_ROWS_PER_SAMPLE: usize = 16;
/// Minimum number of samples for which rows are taken together unless the user names the arrays.
const MIN_SAMPLES: usize = 10;

/// Combines arrays with the same number of rows into a table. An array with a multiple of these rows has several rows per
/// sample, which are put side by side. If columns are used, the arrays that they name determine the number of rows; else,
/// those with most numbers. A single array without a name has the columns c1, c2, …; the columns of an array X are X.c1,
/// X.c2, …, or X if there is only one.
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
    let originals = Vec::from_iter(arrays.iter().map(|array| original_name(&array.name)));
    let arrays = Vec::from_iter(arrays.into_iter().map(|array| Array {
        name: clean_name(&array.name),
        ..array
    }));
    let Some(rows) = rows_of_samples(&arrays, &reading.used) else {
        let found = if notes.is_empty() {
            "it is empty".to_owned()
        } else {
            notes.join("; ")
        };
        return Err(TableError::array("there is no array of numbers", found));
    };
    let (mut columns, mut variables) = (Vec::new(), Vec::new());
    for (array, original) in arrays.into_iter().zip(originals) {
        let (name, shape, first) = (array.name.clone(), array.shape.clone(), columns.len());
        let variable = |end| Variable {
            name,
            shape,
            columns: first..end,
        };
        if array.rows % rows != 0 || array.rows / rows > MAX_ROWS_PER_SAMPLE {
            notes.push(format!(
                "left out: {} is {}, and a sample is one of {rows} rows; name its columns to use it instead",
                array.name, array.shape
            ));
            variables.push(variable(first));
            continue;
        }
        let each = array.rows / rows;
        if each > 1 {
            notes.push(format!(
                "{} is {}: {each} rows per sample, side by side",
                array.name, array.shape
            ));
        } else if array.is_reshaped {
            let width = array.columns.len();
            notes.push(format!("{} is {}, read as {rows} × {width}", array.name, array.shape));
        }
        let numbers = side_by_side(array.columns, each);
        let width = numbers.len();
        for (index, numbers) in numbers.into_iter().enumerate() {
            let name = match (array.name.as_str(), width) {
                ("", _) => format!("c{}", index + 1),
                (name, 1) => name.to_owned(),
                (name, _) => format!("{name}.c{}", index + 1),
            };
            columns.push(Column {
                original: original.clone(),
                name,
                numbers,
                ..Column::default()
            });
        }
        variables.push(variable(columns.len()));
    }
    let roles = reading.roles(&columns);
    for (column, (missing, has_labels)) in columns.iter_mut().zip(roles) {
        give_role(column, &missing, has_labels);
    }
    variables.retain(|variable| !variable.name.is_empty());
    Ok(Table {
        columns,
        variables,
        rows,
        notes,
        ..Table::new(path, format)
    })
}

/// Returns the number of samples: the rows of the shortest array with a used column or, without one, the number of rows with
/// most numbers. If other arrays have one row for a fixed number of these, they determine it; `None` without arrays.
fn rows_of_samples(arrays: &[Array], used: &[String]) -> Option<usize> {
    let is_used = |array: &&Array| {
        let is_of = |name: &String| {
            let of_array = name.strip_prefix(array.name.as_str());
            of_array.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        !array.name.is_empty() && used.iter().any(is_of)
    };
    if let Some(rows) = arrays.iter().filter(is_used).map(|array| array.rows).min() {
        return Some(rows);
    }
    let mut numbers: BTreeMap<usize, usize> = BTreeMap::new();
    for array in arrays {
        *numbers.entry(array.rows).or_default() += array.rows * array.columns.len();
    }
    let (&most, _) = numbers.iter().max_by_key(|(_, count)| **count)?;
    let is_per_sample = |rows: &&usize| {
        **rows >= MIN_SAMPLES && **rows < most && most % **rows == 0 && most / **rows <= MAX_ROWS_PER_SAMPLE
    };
    Some(numbers.keys().rev().find(is_per_sample).copied().unwrap_or(most))
}

/// Puts every `each` rows side by side.
fn side_by_side(columns: Vec<Vec<f64>>, each: usize) -> Vec<Vec<f64>> {
    if each == 1 {
        return columns;
    }
    let part = |first: usize| {
        let of_row = move |column: &Vec<f64>| column.iter().skip(first).step_by(each).copied().collect();
        columns.iter().map(of_row)
    };
    (0..each).flat_map(part).collect()
}

/// Marks the cells that are missing or infinite, and labels the cells of a group.
fn give_role(column: &mut Column, missing: &[&Missing], has_labels: bool) {
    let mut labels = has_labels.then(Labels::default);
    for (row, number) in column.numbers.iter_mut().enumerate() {
        if number.is_nan() || missing.iter().any(|rule| rule.is_number(*number)) {
            column.missing += 1;
            *number = f64::NAN;
        } else if number.is_infinite() {
            column.faults.add(row as u64 + 1, || number.to_string());
            *number = f64::NAN;
        }
        if let Some(labels) = &mut labels {
            labels.push((!number.is_nan()).then(|| number.to_string()).as_deref());
        }
    }
    column.labels = labels;
}
