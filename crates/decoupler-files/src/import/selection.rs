use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
};

use super::{Dropped, FileReport, Format, ImportError, Table, columns::Files, join::Partners};
use decoupler_core::{
    dataset::{History, RowOrder, Series},
    text::counted,
};
use ndarray::Array2;

/// Largest number of a row-wire.
pub(super) const LAST_ROW_WIRE: usize = 10_000;

/// Why a row is dropped, and whether it is kept.
type Need<'a> = (String, Box<dyn Fn(usize) -> bool + 'a>);

/// Rows of the first file, with the cells of the joined files.
impl Files {
    fn main(&self) -> &Table {
        &self.tables[0]
    }

    /// Returns the cell of a row; NaN if it is missing or the row has no match.
    pub(super) fn number(&self, id: usize, row: usize) -> f64 {
        self.columns[id].numbers[row]
    }

    /// Returns the rows that are samples, and the dropped rows by reason, in order of first occurrence.
    pub(super) fn select(&self) -> Result<(Vec<usize>, Vec<Dropped>), ImportError> {
        let main = self.main();
        let mut needs = Vec::<Need<'_>>::new();
        for (join, table) in self.joins.iter().zip(&self.tables[1..]) {
            if let Some(Partners { rows, report, .. }) = join {
                let (file, limit) = (table.path.display(), report.limit);
                let reason = format!("no row of '{file}' within {limit} of its time");
                needs.push((reason, Box::new(|row| rows[row].is_some())));
            }
        }
        for (id, comparison) in &self.meanings.comparisons {
            let numbers = &self.columns[*id].numbers;
            let is_met = |row: usize| numbers[row].is_nan() || comparison.is_met(numbers[row]);
            needs.push((format!("{comparison} is not met"), Box::new(is_met)));
        }
        let mut seen = HashSet::new();
        for id in self.meanings.used().filter(|id| seen.insert(*id)) {
            let column = &self.columns[id];
            let reason = format!("{} is missing", column.name);
            needs.push((reason, Box::new(|row| !column.is_missing(row))));
        }
        let mut dropped = Vec::from_iter(main.too_long.first.as_ref().map(|first| Dropped {
            reason: format!("more cells than the {}", counted(self.ranges[0].len(), "column")),
            rows: main.too_long.count,
            first_line: first.line,
        }));
        let (mut kept, mut places) = (Vec::new(), vec![None; needs.len()]);
        for row in 0..main.rows {
            let Some(need) = needs.iter().position(|(_, is_met)| !is_met(row)) else {
                kept.push(row);
                continue;
            };
            let place = *places[need].get_or_insert(dropped.len());
            if place == dropped.len() {
                let (reason, first_line) = (needs[need].0.clone(), main.line(row));
                dropped.push(Dropped {
                    reason,
                    rows: 0,
                    first_line,
                });
            }
            dropped[place].rows += 1;
        }
        if kept.is_empty() {
            let reasons = dropped
                .iter()
                .map(|Dropped { rows, reason, .. }| format!("{rows}: {reason}"));
            let (rows, reasons) = (main.rows + main.too_long.count, Vec::from_iter(reasons).join("; "));
            return Err(ImportError::Samples(format!("no row of {rows} is left: {reasons}")));
        }
        Ok((kept, dropped))
    }

    /// Returns the rows with all readings and a time, including rows that are not samples.
    pub(super) fn with_readings(&self) -> Vec<usize> {
        let used = Vec::from_iter(self.meanings.placing().chain(self.meanings.inputs.iter().copied()));
        let has_row_wire = |row: usize| self.meanings.row_wire.is_none_or(|id| self.row_wire(id, row).is_ok());
        let is_complete = |&row: &usize| !used.iter().any(|id| self.columns[*id].is_missing(row)) && has_row_wire(row);
        (0..self.main().rows).filter(is_complete).collect()
    }

    /// Describes the rows `read` in order of time, of which those in `kept` are samples: returns the history of their readings,
    /// once these are moved. With `needs_clock`, a memory needs the times in seconds.
    pub(super) fn past(
        &self,
        read: &[usize],
        kept: &[usize],
        needs_clock: bool,
    ) -> Result<impl FnOnce(Array2<f64>) -> History + use<>, ImportError> {
        let mut places = vec![0; self.main().rows];
        read.iter().enumerate().for_each(|(place, &row)| places[row] = place);
        let mut times_s = None;
        if let Some(id) = self.meanings.time {
            let channel = self.channel(id);
            let factor = seconds(channel.unit.as_deref());
            if factor.is_none() && needs_clock {
                let (name, unit) = (channel.name, channel.unit.unwrap_or_default());
                return Err(ImportError::Samples(format!(
                    "the times in '{name}' are in {unit}, and a history needs times in s, ms, us, ns, min or h: give the unit \
                     of the column"
                )));
            }
            times_s = factor.map(|factor| read.iter().map(|&row| factor * self.number(id, row)).collect());
        }
        let (groups, row_wires) = (self.group_keys(read), self.row_wires(read)?);
        let samples = kept.iter().map(|&row| places[row]).collect();
        Ok(move |readings| History::new(readings, groups.as_deref(), row_wires.as_deref(), times_s, samples))
    }

    /// Puts the samples `kept` and the rows `read` in order of time, unless the clock restarts; returns a note if they were
    /// not in order.
    pub(super) fn put_in_order(
        &self,
        time: usize,
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
            return Ok(order_note(order, self.main().line(read[first_row])));
        }
        let falls = |pair: &&[usize]| self.number(time, pair[1]) < self.number(time, pair[0]);
        let falls = Vec::from_iter(kept.windows(2).filter(falls).map(|pair| pair[1]));
        let note = falls.first().map(|&row| {
            let (times, line) = (counted(falls.len(), "time"), self.main().line(row));
            format!("the times go backwards {times}, first on line {line}; the samples are sorted by time")
        });
        for rows in [kept, read] {
            rows.sort_by(|&one, &other| self.number(time, one).total_cmp(&self.number(time, other)));
        }
        Ok(note)
    }

    /// Returns the group of each sample, numbered in order of first occurrence, and the name of each group. Without a group
    /// column, each sample is a group without a name.
    pub(super) fn groups(&self, kept: &[usize]) -> (Vec<usize>, Vec<String>) {
        let Some(id) = self.meanings.group else {
            return ((0..kept.len()).collect(), Vec::new());
        };
        let (mut known, mut names) = (HashMap::<Cow<'_, str>, usize>::new(), Vec::new());
        let numbers = kept.iter().map(|&row| {
            let name = self.columns[id].text(row);
            *known.entry(name).or_insert_with_key(|name| {
                names.push(name.clone().into_owned());
                names.len() - 1
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
        let of = |id| kept.iter().map(|&row| self.row_wire(id, row)).collect();
        self.meanings.row_wire.map(of).transpose()
    }

    fn row_wire(&self, id: usize, row: usize) -> Result<usize, ImportError> {
        let value = self.number(id, row);
        row_wire(value).ok_or_else(|| {
            let name = &self.columns[id].name;
            ImportError::Samples(format!(
                "'{name}': {value} is not the number of a row-wire; give whole numbers from 1 to {LAST_ROW_WIRE}"
            ))
        })
    }

    pub(super) fn reports(&self) -> Vec<FileReport> {
        let report = |(file, table): (usize, &Table)| {
            let join = file.checked_sub(1).and_then(|join| self.joins[join].as_ref());
            FileReport {
                path: table.path.clone(),
                format: table.format.clone(),
                rows: table.rows,
                columns: self.ranges[file].len(),
                has_names: table.has_header() && table.format != Format::Npy,
                join: join.map(|partners| partners.report),
            }
        };
        self.tables.iter().enumerate().map(report).collect()
    }
}

/// Returns a note on times that step back, first on `line`.
pub(super) fn order_note(order: RowOrder, line: u64) -> Option<String> {
    let (count, what) = match order {
        RowOrder::ByTime => return None,
        RowOrder::Restarts { count, .. } => (
            count,
            ", as where a clock is restarted: the rows keep their order, and no history of readings goes across",
        ),
        RowOrder::Shuffled { count, .. } => (count, ": the rows are taken in order of time"),
    };
    let times = counted(count, "time");
    Some(format!("the times go backwards {times}, first on line {line}{what}"))
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

/// Returns the index of the row-wire with this number.
pub(super) fn row_wire(number: f64) -> Option<usize> {
    let is_number = number.fract() == 0.0 && (1.0..=LAST_ROW_WIRE as f64).contains(&number);
    is_number.then(|| number as usize - 1)
}
