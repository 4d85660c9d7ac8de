use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use super::{
    Channel, Dropped, FileReport, ImportError, JoinReport, Joined, Missing, Recipe, Recording, Table, Watch,
    column::Cells,
    condition::Comparison,
    csv_table::Reading,
    gather::{Source, gather},
    join::{Partners, median_interval, nearest},
    names::{ColumnId, Names},
    read::read,
    table::stem,
};
use crate::dataset::Dataset;

/// Largest number of a row-wire.
const LAST_ROW_WIRE: f64 = 10_000.0;

impl Recipe {
    /// Reads the files, relative to `folder`, and makes the samples.
    ///
    /// # Errors
    /// If a file cannot be read, a column is missing, a cell that is used is no number, or no row is left; or `watch` breaks.
    pub fn import(&self, folder: &Path, watch: Watch<'_>) -> Result<Recording, ImportError> {
        let stems = self.stems();
        let mut files = vec![self.read(folder, 0, &self.data, None, watch)?];
        for (number, (joined, stem)) in self.join.iter().zip(&stems).enumerate() {
            files.push(self.read(folder, number + 1, &joined.file, Some(stem), watch)?);
        }
        let tables: Vec<&Table> = files.iter().map(|(_, table)| table).collect();
        let names = Names::of(&tables, &stems);
        let meanings = Meanings::of(self, &names)?;
        let mut warnings = notes(&files);
        let mut joins = Vec::new();
        for (number, joined) in self.join.iter().enumerate() {
            joins.push(self.partners(number + 1, joined, &files, &names, &meanings, &mut warnings)?);
        }
        let rows = Rows {
            recipe: self,
            files: &files,
            names: &names,
            meanings: &meanings,
            joins: &joins,
        };
        rows.check_numbers()?;
        let (mut kept, dropped) = rows.select()?;
        if let Some(id) = meanings.time {
            warnings.extend(rows.put_in_order(id, &mut kept));
        }
        let times = meanings
            .time
            .map(|id| kept.iter().map(|&row| rows.number(id, row)).collect());
        let groups = rows.groups(&kept);
        let row_wires = rows.row_wires(&kept)?;
        let channels = |ids: &[ColumnId]| ids.iter().map(|id| rows.channel(*id)).collect::<Vec<Channel>>();
        let (inputs, targets) = (channels(&meanings.inputs), channels(&meanings.targets));
        let reports = rows.reports();
        let total = files[0].1.rows + files[0].1.too_long.rows;
        let partners: Vec<Option<Vec<Option<u32>>>> = joins
            .into_iter()
            .map(|partners| partners.map(|partners| partners.rows))
            .collect();
        let mut tables: Vec<Table> = files.into_iter().map(|(_, table)| table).collect();
        let mut source = Source {
            tables: &mut tables,
            partners: &partners,
            rows: &kept,
        };
        let targets_of_rows = gather(&mut source, &meanings.targets, &meanings.inputs);
        let readings = gather(&mut source, &meanings.inputs, &[]);
        Ok(Recording {
            set: Dataset::new(readings, targets_of_rows, row_wires.as_deref(), groups)?,
            inputs,
            targets,
            times,
            has_groups: self.group.is_some(),
            rows: total,
            dropped,
            files: reports,
            warnings,
        })
    }

    /// Names in front of the columns of the joined files.
    pub(super) fn stems(&self) -> Vec<String> {
        let mut stems: Vec<String> = Vec::new();
        for joined in &self.join {
            let wanted = joined.stem.clone().unwrap_or_else(|| stem(&joined.file));
            let same = stems.iter().filter(|other| **other == wanted).count();
            stems.push(if same == 0 {
                wanted
            } else {
                format!("{wanted}#{}", same + 1)
            });
        }
        stems
    }

    /// Reads one file; `prefix` is the stem of a joined one.
    pub(super) fn read(
        &self,
        folder: &Path,
        number: usize,
        file: &Path,
        prefix: Option<&String>,
        watch: Watch<'_>,
    ) -> Result<(PathBuf, Table), ImportError> {
        let own_name = |full: &str| match prefix {
            None => Some(full.trim().to_owned()),
            Some(stem) => full.trim().strip_prefix(stem)?.strip_prefix('.').map(str::to_owned),
        };
        let missing: Vec<(Option<String>, &Missing)> = self
            .missing
            .iter()
            .filter_map(|missing| match &missing.column {
                None => Some((None, missing)),
                Some(column) => Some((Some(own_name(column)?), missing)),
            })
            .collect();
        let path = folder.join(file);
        let reading = Reading {
            choice: self.dialect,
            missing,
            labels: self.group.iter().filter_map(|group| own_name(group)).collect(),
        };
        let mut table = read(&path, &reading, watch)?;
        if number == 0 {
            table.stem = stem(file);
        }
        Ok((path, table))
    }

    /// Finds the partners in the joined file `number`; `None` if it is joined row by row.
    fn partners(
        &self,
        number: usize,
        joined: &Joined,
        files: &[(PathBuf, Table)],
        names: &Names,
        meanings: &Meanings,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Partners>, ImportError> {
        let (path, table) = &files[number];
        let refuse = |reason: String| ImportError::Join {
            path: path.clone(),
            reason,
        };
        let main = &files[0].1;
        let Some(time) = meanings.time else {
            if table.rows != main.rows {
                return Err(refuse(format!(
                    "it has {} rows and the other file {}; name the columns of their times with --time and --join-time",
                    table.rows, main.rows
                )));
            }
            return Ok(None);
        };
        let wanted = joined.time.as_deref().or(self.time.as_deref()).unwrap_or_default();
        let found = table.columns.iter().position(|column| column.name == wanted.trim());
        let Some(column) = found else {
            let all: Vec<&str> = table
                .columns
                .iter()
                .map(|column| column.name.as_str())
                .take(30)
                .collect();
            return Err(refuse(format!(
                "it has no column '{wanted}' for its times, but {}; name it with --join-time",
                all.join(", ")
            )));
        };
        let id = ColumnId { file: number, column };
        for id in [time, id] {
            not_a_number(files, names, id)?;
        }
        let (Cells::Numbers(times), Cells::Numbers(joined_times)) =
            (&main.columns[time.column].cells, &table.columns[column].cells)
        else {
            return Err(refuse(
                "its times are a group as well; give the column one meaning".to_owned(),
            ));
        };
        let Some(limit) = joined.limit.or_else(|| Some(median_interval(joined_times)? / 2.0)) else {
            return Err(refuse(
                "its times are all the same; give the limit with --join-limit".to_owned(),
            ));
        };
        let partners = nearest(times, joined_times, limit);
        let mut uses = vec![0_usize; table.rows];
        partners.rows.iter().flatten().for_each(|&row| uses[row as usize] += 1);
        let several = uses.iter().filter(|&&count| count > 1).count();
        if 10 * several > table.rows {
            let file = path.display();
            warnings.push(format!(
                "{several} of {} rows of '{file}' are partners of several rows each; it is slower, so its values are stale by up to {limit}",
                table.rows
            ));
        }
        Ok(Some(partners))
    }
}

/// Columns by their meaning.
struct Meanings {
    inputs: Vec<ColumnId>,
    targets: Vec<ColumnId>,
    time: Option<ColumnId>,
    group: Option<ColumnId>,
    row_wire: Option<ColumnId>,
    comparisons: Vec<(ColumnId, Comparison)>,
    units: HashMap<ColumnId, String>,
}

impl Meanings {
    fn of(recipe: &Recipe, names: &Names) -> Result<Self, ImportError> {
        let one = |name: &Option<String>| name.as_ref().map(|name| names.find(name)).transpose();
        let comparisons = recipe.conditions.iter().flat_map(|condition| condition.comparisons());
        for missing in recipe.missing.iter().filter_map(|missing| missing.column.as_deref()) {
            names.find(missing)?;
        }
        let units = recipe
            .units
            .iter()
            .map(|(name, unit)| Ok((names.find(name)?, unit.clone())));
        let meanings = Self {
            inputs: names.find_all(&recipe.inputs)?,
            targets: names.find_all(&recipe.targets)?,
            time: one(&recipe.time)?,
            group: one(&recipe.group)?,
            row_wire: one(&recipe.row_wire)?,
            comparisons: comparisons
                .map(|comparison| Ok((names.find(&comparison.column)?, comparison.clone())))
                .collect::<Result<_, ImportError>>()?,
            units: units.collect::<Result<_, ImportError>>()?,
        };
        for (columns, what) in [(&meanings.inputs, "an input"), (&meanings.targets, "a target")] {
            if columns.is_empty() {
                return Err(ImportError::NoColumns(what));
            }
        }
        let mut seen: HashMap<ColumnId, &'static str> = HashMap::new();
        let all = [
            ("an input", meanings.inputs.clone()),
            ("a target", meanings.targets.clone()),
            ("the group", Vec::from_iter(meanings.group)),
            ("the row-wire", Vec::from_iter(meanings.row_wire)),
        ];
        for (other, columns) in all {
            for id in columns {
                if let Some(one) = seen.insert(id, other) {
                    let name = names.name(id).to_owned();
                    return Err(ImportError::TwoMeanings { name, one, other });
                }
            }
        }
        Ok(meanings)
    }

    /// Columns whose cells must be numbers.
    fn used(&self) -> impl Iterator<Item = ColumnId> {
        let compared = self.comparisons.iter().map(|(id, _)| *id);
        let single = self.time.into_iter().chain(self.row_wire).chain(self.group);
        compared
            .chain(single)
            .chain(self.inputs.iter().copied())
            .chain(self.targets.iter().copied())
    }
}

/// Rows of the first file and their partners.
struct Rows<'a> {
    recipe: &'a Recipe,
    files: &'a [(PathBuf, Table)],
    names: &'a Names,
    meanings: &'a Meanings,
    joins: &'a [Option<Partners>],
}

impl Rows<'_> {
    fn check_numbers(&self) -> Result<(), ImportError> {
        self.meanings
            .used()
            .try_for_each(|id| not_a_number(self.files, self.names, id))?;
        let numbers = self.meanings.comparisons.iter().map(|(id, _)| *id);
        for id in numbers.chain(self.meanings.time).chain(self.meanings.row_wire) {
            if let Some(label) = self.column(id).wordy_label() {
                let name = self.names.name(id);
                return Err(ImportError::Condition {
                    text: name.to_owned(),
                    reason: format!("the label '{label}' is not a number"),
                });
            }
        }
        Ok(())
    }

    fn column(&self, id: ColumnId) -> &Cells {
        &self.files[id.file].1.columns[id.column].cells
    }

    /// Row of a file that belongs to a row of the first; `None` without a partner.
    fn partner(&self, file: usize, row: usize) -> Option<usize> {
        match file.checked_sub(1).and_then(|joined| self.joins[joined].as_ref()) {
            None => Some(row),
            Some(partners) => partners.rows[row].map(|partner| partner as usize),
        }
    }

    /// Cell of a row; NaN if it is missing, or the row has no partner.
    fn number(&self, id: ColumnId, row: usize) -> f64 {
        self.partner(id.file, row)
            .map_or(f64::NAN, |row| self.column(id).number(row))
    }

    fn is_missing(&self, id: ColumnId, row: usize) -> bool {
        self.partner(id.file, row)
            .is_none_or(|row| self.column(id).is_missing(row))
    }

    /// Rows that are samples, and the others by reason.
    fn select(&self) -> Result<(Vec<usize>, Vec<Dropped>), ImportError> {
        let main = &self.files[0].1;
        let mut used: Vec<ColumnId> = Vec::new();
        self.meanings.used().for_each(|id| {
            if !used.contains(&id) {
                used.push(id);
            }
        });
        let mut dropped = Counts::default();
        if main.too_long.rows > 0 {
            let reason = format!("more cells than the {} columns", main.columns.len());
            let first_line = main.too_long.first_line.unwrap_or(1);
            dropped.0.push((
                Reason::TooLong,
                Dropped {
                    reason,
                    rows: main.too_long.rows,
                    first_line,
                },
            ));
        }
        let mut kept = Vec::new();
        for row in 0..main.rows {
            let lonely = self
                .joins
                .iter()
                .position(|join| join.as_ref().is_some_and(|join| join.rows[row].is_none()));
            if let Some(join) = lonely {
                dropped.count(Reason::Lonely(join), main.line(row), || {
                    let limit = self.joins[join].as_ref().map_or(f64::NAN, |join| join.limit);
                    format!(
                        "no row of '{}' within {limit} of its time",
                        self.recipe.join[join].file.display()
                    )
                });
                continue;
            }
            let missing = |id: &&ColumnId| self.is_missing(**id, row);
            let compared = self.meanings.comparisons.iter();
            let unmet = compared.clone().position(|(id, comparison)| {
                let number = self.number(*id, row);
                !number.is_nan() && !comparison.is_met(number)
            });
            if let Some(unmet) = unmet {
                let comparison = &self.meanings.comparisons[unmet].1;
                dropped.count(Reason::Unmet(unmet), main.line(row), || {
                    format!("{comparison} is not met")
                });
            } else if let Some(id) = used.iter().find(missing) {
                dropped.count(Reason::Missing(*id), main.line(row), || {
                    format!("{} is missing", self.names.name(*id))
                });
            } else {
                kept.push(row);
            }
        }
        let dropped: Vec<Dropped> = dropped.0.into_iter().map(|(_, dropped)| dropped).collect();
        if kept.is_empty() {
            let reasons = dropped
                .iter()
                .map(|dropped| format!("{}: {}", dropped.rows, dropped.reason));
            return Err(ImportError::NoRows {
                rows: main.rows + main.too_long.rows,
                reasons: reasons.collect::<Vec<_>>().join("; "),
            });
        }
        Ok((kept, dropped))
    }

    /// Sorts the rows by their time; tells of rows that were not in this order.
    fn put_in_order(&self, time: ColumnId, kept: &mut [usize]) -> Option<String> {
        let falls = |pair: &[usize]| self.number(time, pair[1]) < self.number(time, pair[0]);
        let first = kept.windows(2).find(|pair| falls(pair))?[1];
        let count = kept.windows(2).filter(|pair| falls(pair)).count();
        kept.sort_by(|&one, &other| self.number(time, one).total_cmp(&self.number(time, other)));
        Some(format!(
            "the times run backwards {count} times, first on line {}; the samples are put in the order of their times",
            self.files[0].1.line(first)
        ))
    }

    /// Number of each sample's group, in the order in which groups first occur.
    fn groups(&self, kept: &[usize]) -> Vec<usize> {
        let Some(id) = self.meanings.group else {
            return (0..kept.len()).collect();
        };
        let mut known = HashMap::new();
        let numbers = kept.iter().map(|&row| {
            let next = known.len();
            let key = self.partner(id.file, row).map(|row| self.column(id).group(row));
            *known.entry(key).or_insert(next)
        });
        numbers.collect()
    }

    fn row_wires(&self, kept: &[usize]) -> Result<Option<Vec<usize>>, ImportError> {
        let Some(id) = self.meanings.row_wire else {
            return Ok(None);
        };
        let of = |&row: &usize| row_wire(self.names.name(id), self.number(id, row));
        kept.iter().map(of).collect::<Result<_, _>>().map(Some)
    }

    fn channel(&self, id: ColumnId) -> Channel {
        let column = &self.files[id.file].1.columns[id.column];
        Channel {
            name: self.names.name(id).to_owned(),
            unit: self.meanings.units.get(&id).or(column.unit.as_ref()).cloned(),
        }
    }

    fn reports(&self) -> Vec<FileReport> {
        let report = |(number, (path, table)): (usize, &(PathBuf, Table))| {
            let join = number.checked_sub(1).and_then(|join| self.joins[join].as_ref());
            FileReport {
                path: path.clone(),
                format: table.format.clone(),
                rows: table.rows,
                columns: table.columns.len(),
                too_short: table.too_short,
                join: join.map(|partners| {
                    let mut is_used = vec![false; table.rows];
                    partners
                        .rows
                        .iter()
                        .flatten()
                        .for_each(|&row| is_used[row as usize] = true);
                    JoinReport {
                        limit: partners.limit,
                        without_partner: partners.rows.iter().filter(|partner| partner.is_none()).count(),
                        unused: is_used.iter().filter(|is_used| !**is_used).count(),
                        median_offset: partners.median_offset,
                    }
                }),
            }
        };
        self.files.iter().enumerate().map(report).collect()
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Reason {
    TooLong,
    Lonely(usize),
    Unmet(usize),
    Missing(ColumnId),
}

/// Rows dropped, by reason in the order of their first.
#[derive(Default)]
struct Counts(Vec<(Reason, Dropped)>);

impl Counts {
    fn count(&mut self, reason: Reason, line: u64, words: impl FnOnce() -> String) {
        if let Some((_, dropped)) = self.0.iter_mut().find(|(other, _)| *other == reason) {
            dropped.rows += 1;
            return;
        }
        let dropped = Dropped {
            reason: words(),
            rows: 1,
            first_line: line,
        };
        self.0.push((reason, dropped));
    }
}

/// Refuses a column with cells that are neither numbers nor missing.
pub(super) fn not_a_number(files: &[(PathBuf, Table)], names: &Names, id: ColumnId) -> Result<(), ImportError> {
    let (path, table) = &files[id.file];
    let faults = &table.columns[id.column].faults;
    let Some(first) = &faults.first else { return Ok(()) };
    Err(ImportError::NotANumber {
        path: path.clone(),
        line: first.line,
        column: id.column + 1,
        name: names.name(id).to_owned(),
        text: first.text.clone(),
        others: match faults.count {
            1 => String::new(),
            count => format!(", nor are {} other cells of the column", count - 1),
        },
    })
}

/// Index of the row-wire with the number `value`.
pub(super) fn row_wire(name: &str, value: f64) -> Result<usize, ImportError> {
    if value.fract() == 0.0 && (1.0..=LAST_ROW_WIRE).contains(&value) {
        Ok(value as usize - 1)
    } else {
        let name = name.to_owned();
        Err(ImportError::RowWire { name, value })
    }
}

/// What is to be known of the files themselves.
fn notes(files: &[(PathBuf, Table)]) -> Vec<String> {
    let mut notes = Vec::new();
    for (path, table) in files {
        let file = path.display();
        notes.extend(table.notes.iter().map(|note| format!("'{file}': {note}")));
        for (excess, what) in [
            (
                table.too_short,
                "end before the last column; the cells they lack are missing",
            ),
            (
                table.too_long,
                "have more cells than there are columns and are left out",
            ),
        ] {
            if let Some(line) = excess.first_line {
                notes.push(format!(
                    "'{file}': {} rows, the first on line {line}, {what}",
                    excess.rows
                ));
            }
        }
    }
    notes
}
