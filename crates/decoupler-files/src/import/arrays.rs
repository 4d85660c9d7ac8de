//! Tables of the arrays in a file: those with one row per sample, chosen by the columns that are used.

use std::{collections::BTreeMap, path::Path};

use decoupler_core::text::{clean_name, original_name};

use super::{
    Column, Encoding, Format, Table, TableError, Variable,
    csv_table::Reading,
    format::{Array, Cell, written},
    rows::MAX_CELLS,
};
use crate::machine::ReadingBudget;

/// Maximum number of rows of an array that are one sample, such as two readings per press.
const MAX_ROWS_PER_SAMPLE: usize = 16;
/// Minimum number of samples for which rows are taken together unless the user names the arrays.
const MIN_SAMPLES: usize = 10;

/// Combines arrays with the same number of rows into a table, and notes those left out. An array with a multiple of these rows
/// has several rows per sample, which are put side by side. If columns are used, the arrays that they name determine the number
/// of rows; else, those with most numbers. A single array without a name has the columns c1, c2, …; the columns of an array X
/// are X.c1, X.c2, …, or X if there is only one.
pub(super) fn table(
    path: &Path,
    (arrays, left_out): (Vec<Array>, Vec<String>),
    format: Format,
    reading: &Reading<'_>,
    budget: &mut ReadingBudget,
) -> Result<Table, TableError> {
    let (arrays, wide): (Vec<_>, Vec<_>) = arrays.into_iter().partition(|array| array.width() <= MAX_CELLS);
    let wide = wide.iter().map(|Array { name, shape, .. }| {
        let (name, shape) = (if name.is_empty() { "the array" } else { name }, written(shape));
        format!("{name} is {shape}, more than {MAX_CELLS} columns; transpose it")
    });
    let left_out = left_out.into_iter().chain(wide);
    let mut notes = Vec::from_iter(left_out.map(|what| format!("left out: {}", clean_name(&what))));
    let Some(rows) = rows_of_samples(&arrays, &reading.used) else {
        let found = if notes.is_empty() {
            "it is empty".to_owned()
        } else {
            notes.join("; ")
        };
        return Err(TableError::array("there is no array of numbers", found));
    };
    let (mut columns, mut variables) = (Vec::new(), Vec::new());
    for array in arrays {
        let (name, original) = (clean_name(&array.name), original_name(&array.name));
        let (first, shape, each) = (columns.len(), written(&array.shape), array.rows() / rows);
        if array.rows() % rows != 0 || each > MAX_ROWS_PER_SAMPLE {
            notes.push(format!(
                "left out: {name} is {shape}, and a sample is one of {rows} rows; name its columns to use it instead"
            ));
        } else {
            if each > 1 {
                notes.push(format!("{name} is {shape}: {each} rows per sample, side by side"));
            } else if array.shape.len() > 2 {
                notes.push(format!("{name} is {shape}, read as {rows} × {}", array.width()));
            }
            let numbers = array.columns(each, budget)?;
            let width = numbers.len();
            columns.extend(numbers.into_iter().enumerate().map(|(index, numbers)| Column {
                original: original.clone(),
                name: match (name.as_str(), width) {
                    ("", _) => format!("c{}", index + 1),
                    (name, 1) => name.to_owned(),
                    (name, _) => format!("{name}.c{}", index + 1),
                },
                numbers,
                ..Column::default()
            }));
        }
        let columns = first..columns.len();
        variables.push(Variable { name, shape, columns });
    }
    let markers = reading.give_roles(&mut columns);
    for (column, markers) in columns.iter_mut().zip(markers) {
        let numbers = std::mem::take(&mut column.numbers);
        column.numbers.reserve_exact(numbers.len());
        for (line, number) in (1..).zip(numbers) {
            let found = match number {
                _ if number.is_nan() || markers.iter().any(|missing| missing.is_number(number)) => Cell::Missing,
                _ if number.is_infinite() => Cell::Text,
                number => Cell::Number(number),
            };
            let is_plain = column.labels.is_none() && found != Cell::Text;
            let text = if is_plain { String::new() } else { number.to_string() };
            column.push(line, text.as_bytes(), found, Encoding::Utf8);
        }
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
            let of_array = name.strip_prefix(&clean_name(&array.name));
            of_array.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        !array.name.is_empty() && used.iter().any(is_of)
    };
    if let Some(rows) = arrays.iter().filter(is_used).map(Array::rows).min() {
        return Some(rows);
    }
    let mut numbers: BTreeMap<usize, usize> = BTreeMap::new();
    for array in arrays {
        *numbers.entry(array.rows()).or_default() += array.numbers.len();
    }
    let (&most, _) = numbers.iter().max_by_key(|(_, count)| **count)?;
    let is_per_sample = |rows: &&usize| {
        **rows >= MIN_SAMPLES && **rows < most && most % **rows == 0 && most / **rows <= MAX_ROWS_PER_SAMPLE
    };
    Some(numbers.keys().rev().find(is_per_sample).copied().unwrap_or(most))
}
