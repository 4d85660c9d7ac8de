use std::{collections::HashMap, path::PathBuf};

use super::{
    Cells, Column, Dropped, FileReport, Format, ImportError, JoinReport, Recipe, Table,
    inputs::{ColumnId, Names},
    join::Partners,
    suggestion::Meanings,
    time_stamp::TimeStamp,
};
use decoupler_core::{
    dataset::{History, Memory, RowOrder, Series},
    problem::Channel,
    text::counted,
};
use ndarray::Array2;

/// Largest number of a row-wire.
pub(super) const LAST_ROW_WIRE: usize = 10_000;

/// Rows of the first file and their matches in the joined files.
pub(super) struct Rows<'a> {
    pub(super) recipe: &'a Recipe,
    pub(super) files: &'a [(PathBuf, Table)],
    pub(super) names: &'a Names,
    pub(super) meanings: &'a Meanings,
    pub(super) joins: &'a [Option<Partners>],
}

impl Rows<'_> {
    pub(super) fn check_numbers(&self) -> Result<(), ImportError> {
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

    /// Returns the row of a file that is joined to a row of the first; `None` without a match.
    fn partner(&self, file: usize, row: usize) -> Option<usize> {
        match file.checked_sub(1).and_then(|joined| self.joins[joined].as_ref()) {
            None => Some(row),
            Some(partners) => partners.rows[row].map(|partner| partner as usize),
        }
    }

    /// Returns the cell of a row; NaN if it is missing or the row has no match.
    pub(super) fn number(&self, id: ColumnId, row: usize) -> f64 {
        self.partner(id.file, row)
            .map_or(f64::NAN, |row| self.column(id).number(row))
    }

    fn is_missing(&self, id: ColumnId, row: usize) -> bool {
        self.partner(id.file, row)
            .is_none_or(|row| self.column(id).is_missing(row))
    }

    /// Returns the rows that are samples, and the dropped rows by reason.
    pub(super) fn select(&self) -> Result<(Vec<usize>, Vec<Dropped>), ImportError> {
        let main = &self.files[0].1;
        let mut used: Vec<ColumnId> = Vec::new();
        self.meanings.used().for_each(|id| {
            if !used.contains(&id) {
                used.push(id);
            }
        });
        let mut dropped = Counts::default();
        if main.too_long.rows > 0 {
            let reason = format!("more cells than the {}", counted(main.columns.len(), "column"));
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

    /// Returns the rows with all readings and a time, including rows that are not samples.
    pub(super) fn with_readings(&self) -> Vec<usize> {
        let single = self
            .meanings
            .time
            .into_iter()
            .chain(self.meanings.row_wire)
            .chain(self.meanings.group);
        let used = Vec::from_iter(single.chain(self.meanings.inputs.iter().copied()));
        let has_row_wire = |id: ColumnId, row: usize| row_wire(self.names.name(id), self.number(id, row)).is_ok();
        let is_complete = |&row: &usize| {
            !used.iter().any(|id| self.is_missing(*id, row))
                && self.meanings.row_wire.is_none_or(|id| has_row_wire(id, row))
        };
        (0..self.files[0].1.rows).filter(is_complete).collect()
    }

    /// Describes the rows `read` in order of time, of which those in `kept` are samples.
    pub(super) fn past(&self, read: &[usize], kept: &[usize]) -> Result<Past, ImportError> {
        let mut places = vec![0; self.files[0].1.rows];
        read.iter().enumerate().for_each(|(place, &row)| places[row] = place);
        let times_s = match self.meanings.time {
            None => None,
            Some(id) => {
                let Channel { name, unit, .. } = self.channel(id);
                let factor = seconds(unit.as_deref());
                if factor.is_none() && self.recipe.memory.as_ref().is_some_and(Memory::needs_clock) {
                    let unit = unit.unwrap_or_default();
                    return Err(ImportError::TimeUnit { name, unit });
                }
                factor.map(|factor| read.iter().map(|&row| factor * self.number(id, row)).collect())
            }
        };
        Ok(Past {
            groups: self.group_keys(read),
            row_wires: self.row_wires(read)?,
            times_s,
            samples: kept.iter().map(|&row| places[row]).collect(),
        })
    }

    /// Puts the samples `kept` and the rows `read` in order of time, unless the clock restarts; returns a note if they were
    /// not in order.
    pub(super) fn put_in_order(
        &self,
        time: ColumnId,
        kept: &mut [usize],
        read: &mut [usize],
    ) -> Result<Option<String>, ImportError> {
        let (groups, row_wires) = (self.group_keys(read), self.row_wires(read)?);
        let rows = read.iter().enumerate().map(|(place, &row)| {
            let series = Series {
                group: groups.as_ref().map_or(0, |groups| groups[place]),
                row_wire: row_wires.as_ref().map_or(0, |row_wires| row_wires[place]),
            };
            (series, self.number(time, row))
        });
        let order = RowOrder::of(rows);
        if let RowOrder::Restarts { first_row, .. } = order {
            return Ok(order_note(order, self.files[0].1.line(read[first_row])));
        }
        let note = self.sort(time, kept);
        self.sort(time, read);
        Ok(note)
    }

    fn sort(&self, time: ColumnId, kept: &mut [usize]) -> Option<String> {
        let falls = |pair: &[usize]| self.number(time, pair[1]) < self.number(time, pair[0]);
        let first = kept.windows(2).find(|pair| falls(pair))?[1];
        let count = kept.windows(2).filter(|pair| falls(pair)).count();
        kept.sort_by(|&one, &other| self.number(time, one).total_cmp(&self.number(time, other)));
        Some(format!(
            "the times go backwards {}, first on line {}; the samples are sorted by time",
            counted(count, "time"),
            self.files[0].1.line(first)
        ))
    }

    /// Returns the group of each sample, numbered in order of first occurrence, and the name of each group. Without a group
    /// column, each sample is a group without a name.
    pub(super) fn groups(&self, kept: &[usize]) -> (Vec<usize>, Vec<String>) {
        let Some(id) = self.meanings.group else {
            return ((0..kept.len()).collect(), Vec::new());
        };
        let (mut known, mut names) = (HashMap::new(), Vec::new());
        let numbers = kept.iter().map(|&row| {
            let next = known.len();
            let partner = self.partner(id.file, row);
            let key = partner.map(|row| self.column(id).group(row));
            *known.entry(key).or_insert_with(|| {
                names.push(partner.map_or_else(String::new, |row| self.column(id).name_of_group(row)));
                next
            })
        });
        (numbers.collect(), names)
    }

    /// Number of the group of each row, if there is a group column.
    fn group_keys(&self, rows: &[usize]) -> Option<Vec<u64>> {
        self.meanings.group?;
        Some(self.groups(rows).0.into_iter().map(|group| group as u64).collect())
    }

    pub(super) fn row_wires(&self, kept: &[usize]) -> Result<Option<Vec<usize>>, ImportError> {
        let Some(id) = self.meanings.row_wire else {
            return Ok(None);
        };
        let of = |&row: &usize| row_wire(self.names.name(id), self.number(id, row));
        kept.iter().map(of).collect::<Result<_, _>>().map(Some)
    }

    pub(super) fn channel(&self, id: ColumnId) -> Channel {
        let column = &self.files[id.file].1.columns[id.column];
        Channel {
            name: self.names.name(id).to_owned(),
            unit: match column.start {
                Some(_) => column.unit.clone(),
                None => self.meanings.units.get(&id).or(column.unit.as_ref()).cloned(),
            },
            original: column.original.clone(),
        }
    }

    pub(super) fn reports(&self) -> Vec<FileReport> {
        let report = |(number, (path, table)): (usize, &(PathBuf, Table))| {
            let join = number.checked_sub(1).and_then(|join| self.joins[join].as_ref());
            FileReport {
                path: path.clone(),
                format: table.format.clone(),
                rows: table.rows,
                columns: table.columns.len(),
                has_names: table.has_header() && table.format != Format::Npy,
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

/// Rows of a history, before their readings are moved.
pub(super) struct Past {
    groups: Option<Vec<u64>>,
    row_wires: Option<Vec<usize>>,
    times_s: Option<Vec<f64>>,
    samples: Vec<usize>,
}

impl Past {
    pub(super) fn with_readings(self, readings: Array2<f64>) -> History {
        let (groups, row_wires) = (self.groups.as_deref(), self.row_wires.as_deref());
        History::new(readings, groups, row_wires, self.times_s, self.samples)
    }
}

/// Returns a note on times that step back, first on `line`.
pub(super) fn order_note(order: RowOrder, line: u64) -> Option<String> {
    match order {
        RowOrder::ByTime => None,
        RowOrder::Restarts { count, .. } => Some(format!(
            "the times go backwards {}, first on line {line}, as where a clock is restarted: the rows keep their order, and no \
             history of readings goes across",
            counted(count, "time")
        )),
        RowOrder::Shuffled { count, .. } => Some(format!(
            "the times go backwards {}, first on line {line}: the rows are taken in order of time",
            counted(count, "time")
        )),
    }
}

/// Returns the number of seconds in the unit of a time column; times without a unit, or with a time zone or clock in its place,
/// are in seconds.
pub(super) fn seconds(unit: Option<&str>) -> Option<f64> {
    Some(match unit.map(str::trim) {
        None | Some("" | "s" | "sec" | "secs" | "second" | "seconds") => 1.0,
        Some("UTC" | "utc" | "GMT" | "gmt" | "Unix" | "unix" | "local") => 1.0,
        Some("ms" | "msec" | "millisecond" | "milliseconds") => 1e-3,
        Some("us" | "µs" | "μs" | "usec" | "microsecond" | "microseconds") => 1e-6,
        Some("ns" | "nanosecond" | "nanoseconds") => 1e-9,
        Some("min" | "minute" | "minutes") => 60.0,
        Some("h" | "hour" | "hours") => 3600.0,
        Some(_) => return None,
    })
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Reason {
    TooLong,
    Lonely(usize),
    Unmet(usize),
    Missing(ColumnId),
}

/// Dropped rows by reason, in order of first occurrence.
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
    let Column { faults, start, .. } = &table.columns[id.column];
    let Some(first) = &faults.first else { return Ok(()) };
    let mut reason = not_understood(&first.text, *start).to_owned();
    if faults.count > 1 {
        let others = counted(faults.count - 1, "other cell");
        reason += &format!(", and {others} of the column cannot be read either");
    }
    Err(ImportError::NotANumber {
        path: path.clone(),
        line: first.line,
        column: id.column + 1,
        name: names.name(id).to_owned(),
        text: first.text.clone(),
        reason,
    })
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

/// Returns the index of the row-wire with the number `value`.
pub(super) fn row_wire(name: &str, value: f64) -> Result<usize, ImportError> {
    if value.fract() == 0.0 && (1.0..=LAST_ROW_WIRE as f64).contains(&value) {
        Ok(value as usize - 1)
    } else {
        let name = name.to_owned();
        Err(ImportError::RowWire { name, value })
    }
}
