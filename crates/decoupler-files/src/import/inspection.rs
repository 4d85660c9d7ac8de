use std::{
    collections::HashMap,
    hash::{BuildHasher as _, RandomState},
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{
    Column, Format, ImportError, Meaning, Recipe, Table, Variable, Watch,
    columns::{Files, find},
    join::median_interval,
    sentinel::{Sentinel, is_rounding, rounding_warning},
};

/// Number of bars of a histogram.
const BARS: usize = 16;
/// Length of an interval, as a multiple of the median, above which it is a gap.
const GAP: f64 = 5.0;

/// Summary of the columns of a file.
#[derive(Clone, Debug, Serialize)]
pub struct InspectedFile {
    /// The file, as it was named.
    #[serde(skip)]
    pub path: PathBuf,
    /// Prefix of the names of its columns; `None` for the first file.
    #[serde(skip)]
    pub stem: Option<String>,
    /// Format and layout of the file.
    #[serde(skip)]
    pub format: Format,
    /// Meaning of each column according to a recipe.
    #[serde(skip)]
    pub meanings: Vec<Meaning>,
    /// Number of rows.
    pub rows: usize,
    /// Columns. Markers of missing values in the recipe count as missing.
    pub columns: Vec<ColumnSummary>,
    /// Named arrays of numbers in the file, such as the variables of a workspace.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub variables: Vec<Variable>,
    /// Intervals of the time column, if there is one.
    pub time: Option<TimeSummary>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Summary of a column.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColumnSummary {
    /// Name.
    pub name: String,
    /// Unit, if the header has one.
    pub unit: Option<String>,
    /// Header in the file, with unprintable characters escaped, if the name lacks some of its characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub original: Option<String>,
    /// Kind of the cells.
    pub kind: ColumnKind,
    /// Number of missing cells.
    pub missing: usize,
    /// Number of cells that are neither numbers nor missing.
    pub texts: usize,
    /// Line and text of the first such cell.
    pub first_text: Option<(u64, String)>,
    /// Smallest number.
    pub min: Option<f64>,
    /// Largest number.
    pub max: Option<f64>,
    /// `true` if all numbers are equal.
    pub is_constant: bool,
    /// `true` if the numbers differ by rounding only: they are few and within a hundred-thousandth of their value, or up
    /// to three values within a thousandth.
    pub is_rounding: bool,
    /// Number that seems to mean "none".
    pub sentinel: Option<Sentinel>,
    /// Name of an earlier column with the same cells.
    pub duplicate_of: Option<String>,
    /// Histogram: number of cells in each bin, from the smallest to the largest number.
    pub histogram: Vec<usize>,
}

/// Kind of the cells of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ColumnKind {
    /// Numbers, not all of them whole.
    Number,
    /// Whole numbers.
    Integer,
    /// Mostly text.
    Text,
    /// No values.
    Empty,
}

/// Intervals of a time column.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TimeSummary {
    /// Name of the column.
    pub column: String,
    /// `true` if the column was guessed to be the time.
    pub is_guessed: bool,
    /// Median interval, in the unit of the column.
    pub median_interval: Option<f64>,
    /// Number of intervals longer than five times the median.
    pub gaps: usize,
    /// Longest interval.
    pub longest: Option<f64>,
    /// Line before the longest interval.
    pub longest_after_line: Option<u64>,
    /// Number of times that are earlier than the time on the line above.
    pub backwards: usize,
}

impl InspectedFile {
    /// Summarises each column of `table`, from the file at `path`. `time` is the time column; if absent, a first column that
    /// always increases is assumed to be the time.
    ///
    /// # Errors
    /// If there is no column `time`.
    pub fn of(table: &Table, path: &Path, time: Option<&str>) -> Result<Self, ImportError> {
        let mut columns: Vec<ColumnSummary> = table.columns.iter().map(ColumnSummary::of).collect();
        name_duplicates(table, &mut columns);
        let chosen = match time {
            Some(name) => Some((find(&table.columns, name)?, false)),
            None => guess_time(table, &columns).map(|column| (column, true)),
        };
        let mut warnings = table.notes.clone();
        let sentinels = columns
            .iter()
            .filter_map(|column| Some(column.sentinel?.warning(&column.name)));
        warnings.extend(sentinels);
        let rounded = columns.iter().filter(|column| column.is_rounding);
        warnings.extend(rounded.map(|column| rounding_warning(&column.name)));
        Ok(Self {
            path: path.to_owned(),
            stem: None,
            format: table.format.clone(),
            meanings: vec![Meaning::Unused; columns.len()],
            rows: table.rows,
            columns,
            variables: table.variables.clone(),
            time: chosen.map(|(column, is_guessed)| TimeSummary::of(table, column, is_guessed)),
            warnings,
        })
    }

    /// Returns the full name of a column; a column of a joined file is prefixed with the stem.
    pub fn full_name(&self, column: usize) -> String {
        let name = &self.columns[column].name;
        match &self.stem {
            None => name.clone(),
            Some(stem) => format!("{stem}.{name}"),
        }
    }
}

impl ColumnSummary {
    fn of(column: &Column) -> Self {
        let numbers = &column.numbers;
        let present = || numbers.iter().copied().filter(|number| !number.is_nan());
        let (mut min, mut max, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0);
        for number in present() {
            (min, max, count) = (min.min(number), max.max(number), count + 1);
        }
        let kind = match count {
            0 if column.faults.count > 0 => ColumnKind::Text,
            0 => ColumnKind::Empty,
            _ if column.faults.count > count => ColumnKind::Text,
            _ if present().all(|number| number.fract() == 0.0) => ColumnKind::Integer,
            _ => ColumnKind::Number,
        };
        Self {
            name: column.name.clone(),
            unit: column.unit.clone(),
            original: column.original.clone(),
            kind,
            missing: column.missing,
            texts: column.faults.count,
            first_text: column.faults.first.clone().map(|fault| (fault.line, fault.text)),
            min: (count > 0).then_some(min),
            max: (count > 0).then_some(max),
            is_constant: count > 0 && min == max,
            is_rounding: is_rounding(numbers),
            sentinel: Sentinel::find(numbers),
            duplicate_of: None,
            histogram: histogram(present(), min, max),
        }
    }
}

fn histogram(numbers: impl Iterator<Item = f64>, min: f64, max: f64) -> Vec<usize> {
    if min >= max {
        return Vec::new();
    }
    let mut bars = vec![0; BARS];
    for number in numbers {
        // Halved, because the range of the largest numbers would overflow.
        let share = (number / 2.0 - min / 2.0) / (max / 2.0 - min / 2.0);
        bars[((share * BARS as f64) as usize).min(BARS - 1)] += 1;
    }
    bars
}

/// Marks the columns that have the same cells as an earlier one.
fn name_duplicates(table: &Table, columns: &mut [ColumnSummary]) {
    let bits = |column: usize| table.columns[column].numbers.iter().map(|number| number.to_bits());
    let (state, mut known) = (RandomState::new(), HashMap::<u64, Vec<usize>>::new());
    for index in 0..columns.len() {
        if columns[index].min.is_none() {
            continue;
        }
        let hash = state.hash_one(Vec::from_iter(bits(index)));
        let earlier = known.entry(hash).or_default();
        match earlier.iter().find(|other| bits(**other).eq(bits(index))) {
            Some(&other) => columns[index].duplicate_of = Some(columns[other].name.clone()),
            None => earlier.push(index),
        }
    }
}

/// Returns the column that is named like a time, or else the first column if it always increases.
fn guess_time(table: &Table, columns: &[ColumnSummary]) -> Option<usize> {
    let is_time = |column: &ColumnSummary| {
        ["time", "timestamp", "t"].contains(&column.name.to_lowercase().as_str()) && column.min.is_some()
    };
    let first = &table.columns.first()?.numbers;
    let grows = first.len() > 2 && first.windows(2).all(|pair| pair[0] < pair[1]);
    columns.iter().position(is_time).or(grows.then_some(0))
}

impl TimeSummary {
    fn of(table: &Table, column: usize, is_guessed: bool) -> Self {
        let times = &table.columns[column].numbers;
        let intervals = || times.windows(2).map(|pair| pair[1] - pair[0]).enumerate();
        let median = median_interval(times);
        let growing = intervals().filter(|(_, interval)| *interval > 0.0);
        let longest = growing.max_by(|one, other| one.1.total_cmp(&other.1));
        let gaps = |median| intervals().filter(|(_, interval)| *interval > GAP * median).count();
        Self {
            column: table.columns[column].name.clone(),
            is_guessed,
            median_interval: median,
            gaps: median.map_or(0, gaps),
            longest: longest.map(|(_, interval)| interval),
            longest_after_line: longest.map(|(row, _)| table.line(row)),
            backwards: intervals().filter(|(_, interval)| *interval < 0.0).count(),
        }
    }
}

impl Recipe {
    /// Reads the files, whose paths are relative to `folder`, and summarises each column; the recipe need not be complete. The
    /// rows of `variables`, with their full names, are samples, as are those of the variables whose columns the recipe uses.
    ///
    /// # Errors
    /// If a file cannot be read, the recipe names a column that does not exist, or `watch` breaks.
    pub fn inspect(
        &self,
        folder: &Path,
        variables: &[String],
        watch: Watch<'_>,
    ) -> Result<Vec<InspectedFile>, ImportError> {
        // Group labels are summarised like any other cells.
        let plain = Self {
            group: None,
            ..self.clone()
        };
        let set = self.files();
        let stems = self.stems();
        let mut tables = plain.read_set(&set, variables, folder, watch)?;
        let mut inspected = Vec::new();
        let of_tables = std::iter::once(None).chain(stems.iter().cloned().map(Some));
        for ((table, path), stem) in tables.iter_mut().zip(set.files()).zip(of_tables) {
            let file = InspectedFile::of(table, path, None)?;
            inspected.push(InspectedFile { stem, ..file });
            // Only their names are needed from here on.
            table.columns.iter_mut().for_each(Column::clear);
        }
        let files = Files::of(tables, stems);
        let mut meant = files.meant(self)?;
        for (joined, file) in self.join.iter().zip(1..) {
            let time = joined.time.as_ref().or(self.time.as_ref());
            let found = time.and_then(|time| files.find_joined(file, time));
            meant.splice(..0, found.map(|id| (id, Meaning::Time)));
        }
        for (id, meaning) in meant.into_iter().rev() {
            let (file, column) = files.place(id);
            inspected[file].meanings[column] = meaning;
        }
        Ok(inspected)
    }
}
