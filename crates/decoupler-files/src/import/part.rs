//! Samples of the files of one experiment, one file after another.

use std::{collections::HashMap, path::Path};

use decoupler_core::{dataset::Dataset, text::counted};
use ndarray::{Array2, ArrayView2, Axis, concatenate};

use super::{FileReport, ImportError, Recording};

impl Recording {
    /// Appends the samples of one part after another. Groups of the same name are one group, in whatever files; without a group
    /// column, each part is a group.
    ///
    /// # Errors
    /// If the parts have different columns.
    pub(super) fn joined(parts: Vec<Self>) -> Result<Self, ImportError> {
        for part in &parts[1..] {
            check_same(&parts[0], part)?;
        }
        let mut known: HashMap<&str, usize> = HashMap::new();
        let (mut groups, mut row_wires) = (Vec::new(), Vec::new());
        for (number, Self { set, group_names, .. }) in parts.iter().enumerate() {
            groups.extend(set.groups().iter().map(|&group| {
                let next = known.len();
                let name = group_names.get(group);
                name.map_or(number, |name| *known.entry(name).or_insert(next))
            }));
            row_wires.extend((0..set.samples()).filter_map(|sample| set.row_wire(sample)));
        }
        let rows = |of: for<'a> fn(&'a Dataset) -> ArrayView2<'a, f64>| -> Array2<f64> {
            let views = Vec::from_iter(parts.iter().map(|part| of(&part.set)));
            concatenate(Axis(0), &views).expect("the parts have the same columns")
        };
        let (readings, targets) = (rows(Dataset::readings), rows(Dataset::targets));
        let row_wires = (row_wires.len() == readings.nrows()).then_some(row_wires);
        let set = Dataset::new(readings, targets, row_wires.as_deref(), groups)?;
        let mut parts = parts.into_iter().map(Self::naming_its_file);
        let mut whole = parts.next().expect("there is a part");
        for part in parts {
            let before = whole.lines.len();
            let starts = part.parts.into_iter().map(|(first, path)| (before + first, path));
            whole.parts.extend(starts);
            whole.lines.extend(part.lines);
            whole.times = whole.times.zip(part.times).map(|(times, more)| [times, more].concat());
            whole.history.append(&part.history);
            whole.rows += part.rows;
            whole.dropped.extend(part.dropped);
            whole.files.extend(part.files);
            whole.warnings.extend(part.warnings);
        }
        Ok(Self { set, ..whole })
    }

    /// Returns the file of a sample, whose line is in [`Self::lines`].
    pub fn file_of(&self, sample: usize) -> &Path {
        let after = self.parts.partition_point(|(first, _)| *first <= sample);
        &self.parts[after - 1].1
    }

    /// Names the file in remarks on its rows, which are those of one of several files.
    fn naming_its_file(mut self) -> Self {
        let file = self.files[0].path.display().to_string();
        for dropped in &mut self.dropped {
            dropped.reason = format!("{} in '{file}'", dropped.reason);
        }
        for warning in self.warnings.iter_mut().filter(|warning| !warning.contains('\'')) {
            *warning = format!("'{file}': {warning}");
        }
        self
    }
}

/// Refuses a file whose columns are not those of the first.
fn check_same(first: &Recording, other: &Recording) -> Result<(), ImportError> {
    let refuse = |found: String, expected: String| {
        let [path, first] = [other, first].map(|recording| recording.files[0].path.display());
        ImportError::Samples(format!(
            "'{path}': {found}, and '{first}': {expected}; files of one experiment need the same columns"
        ))
    };
    let [channels, others] =
        [first, other].map(|Recording { problem, .. }| problem.inputs.iter().chain(&problem.targets));
    for (one, another) in channels.zip(others) {
        if one != another {
            return Err(refuse(another.title(), one.title()));
        }
    }
    // Columns without names are known by their numbers only.
    for (one, another) in first.files.iter().zip(&other.files) {
        if one.columns != another.columns && !(one.has_names && another.has_names) {
            let of = |file: &FileReport| format!("{} in '{}'", counted(file.columns, "column"), file.path.display());
            return Err(refuse(of(another), of(one)));
        }
    }
    Ok(())
}
