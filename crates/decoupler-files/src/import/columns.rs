//! Columns of the files of a recipe, found by their names.

use std::{
    collections::{HashMap, HashSet},
    ops::Range,
};

use decoupler_core::{
    problem::Channel,
    text::{clean_name, counted},
};

use super::{
    Column, Condition, Cure, ImportError, Meaning, Recipe, Table, expression::Expression, join::Partners,
    suggestion::is_group_name, table::name_and_unit, time_stamp::TimeStamp,
};

/// Number of names above which a message lists only names similar to the one given.
const FEW: usize = 24;

/// Returns the columns with this name, with or without the unit given in the header.
pub(super) fn called(columns: &[Column], given: &str) -> Vec<usize> {
    let name = clean_name(given.trim());
    let with = |name: &str| Vec::from_iter((0..columns.len()).filter(|&id| columns[id].name == name));
    let found = with(&name);
    if found.is_empty() {
        with(name_and_unit(&name).0)
    } else {
        found
    }
}

/// Returns the first column with this name.
pub(super) fn position(columns: &[Column], given: &str) -> Option<usize> {
    called(columns, given).first().copied()
}

/// Finds the column with this name.
pub(super) fn find(columns: &[Column], given: &str) -> Result<usize, ImportError> {
    let name = clean_name(given.trim());
    match called(columns, given)[..] {
        [id] => Ok(id),
        [] => Err(ImportError::Columns(format!(
            "there is no column '{name}'; {}",
            near(columns, &name)
        ))),
        _ => Err(ImportError::Columns(format!(
            "the name '{name}' is ambiguous: several columns have it; rename them in their files"
        ))),
    }
}

/// Lists the columns, or those with names similar to `name`.
pub(super) fn near(columns: &[Column], name: &str) -> String {
    let mut names = Vec::from_iter(columns.iter().map(|column| column.name.as_str()));
    if names.len() <= FEW {
        return format!("there are {}", names.join(", "));
    }
    names.sort_by_cached_key(|other| distance(name, other));
    let (count, near) = (names.len(), names[..6].join(", "));
    format!("of {count} columns, these have the most similar names: {near}")
}

/// Edit distance of two names, ignoring case: the number of letters to be inserted, removed or replaced.
fn distance(one: &str, other: &str) -> usize {
    let beginning = |text: &str| text.chars().take(64).collect::<String>().to_lowercase();
    strsim::levenshtein(&beginning(one), &beginning(other))
}

/// Files as one table: the columns of the joined files follow those of the first, under their full names.
pub(super) struct Files {
    /// The files, without their columns.
    pub(super) tables: Vec<Table>,
    pub(super) columns: Vec<Column>,
    /// Columns of each file.
    pub(super) ranges: Vec<Range<usize>>,
    /// Prefix of the columns of each joined file.
    stems: Vec<String>,
    pub(super) meanings: Meanings,
    /// Matching rows of each joined file; `None` if it is joined row by row.
    pub(super) joins: Vec<Option<Partners>>,
}

impl Files {
    /// `stems` are the prefixes of the columns of the joined files.
    pub(super) fn of(mut tables: Vec<Table>, stems: Vec<String>) -> Self {
        let (mut columns, mut ranges) = (Vec::new(), Vec::new());
        for (file, table) in tables.iter_mut().enumerate() {
            let first = columns.len();
            columns.extend(std::mem::take(&mut table.columns).into_iter().map(|mut column| {
                if let Some(joined) = file.checked_sub(1) {
                    column.name = format!("{}.{}", stems[joined], column.name);
                }
                column
            }));
            ranges.push(first..columns.len());
        }
        Self {
            tables,
            columns,
            ranges,
            stems,
            meanings: Meanings::default(),
            joins: Vec::new(),
        }
    }

    /// Returns the file of a column, and the index of the column in the file.
    pub(super) fn place(&self, id: usize) -> (usize, usize) {
        let file = self.ranges.partition_point(|range| range.start <= id) - 1;
        (file, id - self.ranges[file].start)
    }

    fn of_file(&self, file: usize) -> &[Column] {
        &self.columns[self.ranges[file].clone()]
    }

    /// Finds a column of a joined file by its name in the file.
    pub(super) fn find_joined(&self, file: usize, name: &str) -> Option<usize> {
        let full_name = format!("{}.{}", self.stems[file - 1], name.trim());
        let found = position(self.of_file(file), &full_name)?;
        Some(self.ranges[file].start + found)
    }

    /// Names of the columns of a joined file in the file.
    pub(super) fn names_in(&self, file: usize) -> impl Iterator<Item = &str> {
        let prefix = self.stems[file - 1].len() + 1;
        self.of_file(file).iter().map(move |column| &column.name[prefix..])
    }

    /// Returns the columns given by names and ranges such as `c2..c16`.
    fn find_all(&self, given: &[String]) -> Result<Vec<usize>, ImportError> {
        let mut all = Vec::new();
        for name in given {
            // A name may contain two points.
            match (find(&self.columns, name), name.split_once("..")) {
                (Ok(id), _) => all.push(id),
                (Err(error), None) => return Err(error),
                (Err(_), Some((first, last))) => {
                    let first_id = find(&self.columns, first)?;
                    let is_near = |id: &usize| self.place(*id).0 == self.place(first_id).0;
                    // `states.c2..c4` is short for `states.c2..states.c4`.
                    let prefix = first.trim().rsplit_once('.');
                    let last_id = match (find(&self.columns, last), prefix) {
                        (Ok(id), _) if is_near(&id) => id,
                        (_, Some((prefix, _))) => find(&self.columns, &format!("{prefix}.{}", last.trim()))?,
                        (found, None) => found?,
                    };
                    if !is_near(&last_id) || first_id > last_id {
                        return Err(ImportError::Columns(format!(
                            "'{name}' is not a range of columns: write FIRST..LAST, both in one file and in its order, for \
                             example c2..c16"
                        )));
                    }
                    all.extend(first_id..=last_id);
                }
            }
        }
        Ok(all)
    }

    /// Returns the columns with their meanings in the recipe, except the times of joined files.
    pub(super) fn meant(&self, recipe: &Recipe) -> Result<Vec<(usize, Meaning)>, ImportError> {
        let mut meant = Vec::new();
        for (several, meaning) in [(&recipe.inputs, Meaning::Input), (&recipe.targets, Meaning::Target)] {
            meant.extend(self.find_all(several)?.into_iter().map(|id| (id, meaning)));
        }
        for (one, meaning) in [
            (&recipe.time, Meaning::Time),
            (&recipe.group, Meaning::Group),
            (&recipe.row_wire, Meaning::RowWire),
        ] {
            if let Some(name) = one {
                meant.push((find(&self.columns, name)?, meaning));
            }
        }
        Ok(meant)
    }

    /// Warns of an unused column that looks like the group.
    pub(super) fn group_hint(&self) -> Option<String> {
        let is_used = |id: &usize| self.meanings.inputs.contains(id) || self.meanings.targets.contains(id);
        let mut own = self.ranges[0].clone().filter(|id| !is_used(id));
        let name = &self.columns[own.find(|&id| is_group_name(&self.columns[id].name))?].name;
        Some(format!(
            "the column {name} looks like a group of samples that belong together: choose it as the group (--group {name}), so \
             that training and test samples never share one"
        ))
    }

    /// Refuses columns with cells that are neither numbers nor missing, and labels where numbers are needed.
    pub(super) fn check_numbers(&self) -> Result<(), ImportError> {
        let meanings = &self.meanings;
        meanings.used().try_for_each(|id| self.check_cells(id))?;
        let compared = meanings.comparisons.iter().map(|(id, _)| *id);
        for id in compared.chain(meanings.time).chain(meanings.row_wire) {
            if let Some(label) = self.columns[id].wordy_label() {
                let reason = format!("the label '{label}' is not a number");
                return Err(Condition::refused(&self.columns[id].name, &reason));
            }
        }
        Ok(())
    }

    /// Refuses a column with cells that are neither numbers nor missing.
    pub(super) fn check_cells(&self, id: usize) -> Result<(), ImportError> {
        let Column {
            name, faults, start, ..
        } = &self.columns[id];
        let Some(first) = &faults.first else { return Ok(()) };
        let mut reason = not_understood(&first.text, *start).to_owned();
        if faults.count > 1 {
            let others = counted(faults.count - 1, "other cell");
            reason += &format!(", and {others} of the column cannot be read either");
        }
        let (file, column) = self.place(id);
        let (path, line, column, text) = (self.tables[file].path.display(), first.line, column + 1, &first.text);
        Err(ImportError::Curable {
            cause: format!("'{path}': line {line}, column {column} ('{name}'): '{text}' {reason}"),
            cure: Cure::CallMissing(text.clone()),
        })
    }

    /// Puts the cells of joined files into the rows of the first, and frees columns that are not used.
    pub(super) fn join(&mut self) {
        let used: HashSet<usize> = self.meanings.used().collect();
        for id in 0..self.columns.len() {
            let (file, _) = self.place(id);
            if !used.contains(&id) {
                self.columns[id].clear();
            } else if let Some(Some(partners)) = file.checked_sub(1).map(|joined| &self.joins[joined]) {
                self.columns[id].take_rows(&partners.rows);
            }
        }
    }

    /// Gives the columns their units in the recipe, except time stamps.
    pub(super) fn give_units(&mut self, recipe: &Recipe) -> Result<(), ImportError> {
        for (name, unit) in &recipe.units {
            let id = find(&self.columns, name)?;
            if self.columns[id].start.is_none() {
                self.columns[id].unit = Some(unit.clone());
            }
        }
        Ok(())
    }

    /// Name and unit of a column.
    pub(super) fn channel(&self, id: usize) -> Channel {
        let column = &self.columns[id];
        Channel {
            original: column.original.clone(),
            ..Channel::new(&column.name, column.unit.as_deref())
        }
    }
}

/// Describes what is wrong with a cell of a column whose first time stamp is `start`.
fn not_understood(cell: &str, start: Option<TimeStamp>) -> &'static str {
    let is_meant_as_stamp = cell.contains(':') || ["-", "/"].iter().any(|sign| cell.matches(sign).count() == 2);
    match (TimeStamp::parse(cell.as_bytes()), start) {
        (Some(TimeStamp { has_zone: true, .. }), Some(_)) => {
            "has a time zone, and the first time stamp of the column has none"
        }
        (Some(_), Some(_)) => "has no time zone, and the first time stamp of the column has one",
        (Some(_), None) => "is a time stamp after numbers",
        (None, start) if start.is_some() || is_meant_as_stamp => {
            "is not a time stamp such as 2026-11-24T12:00:00.5+01:00 or 2026-11-24 12:00"
        }
        (None, _) => "is not a finite number",
    }
}

/// Columns by their meaning.
#[derive(Default)]
pub(super) struct Meanings {
    pub(super) inputs: Vec<usize>,
    pub(super) targets: Vec<usize>,
    pub(super) time: Option<usize>,
    pub(super) group: Option<usize>,
    pub(super) row_wire: Option<usize>,
    pub(super) comparisons: Vec<(usize, Expression)>,
}

impl Meanings {
    pub(super) fn of(recipe: &Recipe, files: &Files) -> Result<Self, ImportError> {
        let find = |name: &str| find(&files.columns, name);
        let meant = files.meant(recipe)?;
        let of = |meaning| {
            let found = meant.iter().filter(|(_, other)| *other == meaning);
            Vec::from_iter(found.map(|(id, _)| *id))
        };
        let comparisons = recipe.conditions.iter().flat_map(|condition| &condition.comparisons);
        let comparisons = comparisons.map(|comparison| Ok((find(&comparison.column)?, comparison.clone())));
        let meanings = Self {
            inputs: of(Meaning::Input),
            targets: of(Meaning::Target),
            time: of(Meaning::Time).pop(),
            group: of(Meaning::Group).pop(),
            row_wire: of(Meaning::RowWire).pop(),
            comparisons: comparisons.collect::<Result<_, ImportError>>()?,
        };
        for missing in recipe.missing.iter().filter_map(|missing| missing.column.as_deref()) {
            find(missing)?;
        }
        for (columns, meaning) in [(&meanings.inputs, Meaning::Input), (&meanings.targets, Meaning::Target)] {
            if columns.is_empty() {
                let what = meaning.with_article();
                return Err(ImportError::Columns(format!("no column is {what}; name at least one")));
            }
        }
        let mut seen = HashMap::new();
        for (id, meaning) in meant.into_iter().filter(|(_, meaning)| *meaning != Meaning::Time) {
            if let Some(first) = seen.insert(id, meaning) {
                let (one, other) = (Meaning::with_article(first), meaning.with_article());
                let name = &files.columns[id].name;
                let reason = format!("column '{name}' is both {one} and {other}; give it one meaning");
                return Err(ImportError::Columns(reason));
            }
        }
        Ok(meanings)
    }

    /// Columns that place a row in its series: time, row-wire and group.
    pub(super) fn placing(&self) -> impl Iterator<Item = usize> {
        self.time.into_iter().chain(self.row_wire).chain(self.group)
    }

    /// Columns whose cells must be numbers.
    pub(super) fn used(&self) -> impl Iterator<Item = usize> {
        let compared = self.comparisons.iter().map(|(id, _)| *id);
        let channels = self.inputs.iter().chain(&self.targets).copied();
        compared.chain(self.placing()).chain(channels)
    }
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
