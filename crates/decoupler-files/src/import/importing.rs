use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use decoupler_core::{
    dataset::{Dataset, DatasetError, History, Memory},
    problem::{Channel, Problem},
    text::{counted, in_one_line},
};
use ndarray::ArcArray2;
use serde::Serialize;

use super::{
    Cure, Derived, DialectChoice, FileSet, Format, ImportError, Joined, Recipe, Table, Watch,
    columns::{Files, Meanings},
    csv_table::Reading,
    format,
    join::{Partners, gather, median_interval, nearest},
    positions::read_positions,
    sentinel::{Sentinel, is_rounding, rounding_warning},
    table::stem,
};

impl Recipe {
    /// Imports the samples of the files, whose paths are relative to `folder`.
    ///
    /// # Errors
    /// If a file cannot be read, a column is missing, a used cell is not a number, no row is left, or `watch` breaks.
    pub fn import(&self, folder: &Path, watch: Watch<'_>) -> Result<Recording, ImportError> {
        self.import_sets(&self.files().flat(), self.memory.as_ref(), folder, watch)
    }

    /// Imports the samples of these files, one set after another, with the features of `memory`.
    pub(super) fn import_sets(
        &self,
        sets: &[FileSet],
        memory: Option<&Memory>,
        folder: &Path,
        watch: Watch<'_>,
    ) -> Result<Recording, ImportError> {
        let mut memory = memory.cloned();
        let (mut parts, mut damaged) = (Vec::new(), Vec::new());
        for set in sets {
            let imported = self.import_set(set, sets.len() == 1, memory.as_ref(), folder, watch);
            let part = match imported {
                Ok(part) => part,
                Err(error @ ImportError::File { .. }) if self.skip_damaged => {
                    damaged.push(error);
                    continue;
                }
                Err(error) if sets.len() > 1 => return Err(error.of_file(&set.data)),
                Err(error) => return Err(error),
            };
            // Lags in seconds have as many samples in all files.
            memory.clone_from(&part.problem.memory);
            parts.push(part);
        }
        let mut recording = match parts.len() {
            0 => return Err(damaged.remove(0)),
            1 => parts.remove(0),
            _ => Recording::joined(parts)?,
        };
        let left_out = damaged.iter().map(|error| format!("left out: {error}"));
        recording.warnings.extend(left_out);
        let values = recording.set.targets();
        let targets = recording.problem.targets.iter().zip(values.columns());
        let rounded = targets.filter(|(_, values)| is_rounding(&values.to_vec()));
        let warnings = Vec::from_iter(rounded.map(|(target, _)| rounding_warning(&target.name)));
        recording.warnings.extend(warnings);
        Ok(recording)
    }

    /// Imports the samples of one set of files.
    fn import_set(
        &self,
        set: &FileSet,
        is_alone: bool,
        memory: Option<&Memory>,
        folder: &Path,
        watch: Watch<'_>,
    ) -> Result<Recording, ImportError> {
        let mut tables = self.read_set(set, &[], folder, watch)?;
        let mut warnings = Vec::new();
        if self.truncate && self.time.is_none() {
            let shortest = tables.iter().map(|table| table.rows).min().unwrap_or_default();
            for table in tables.iter_mut().filter(|table| table.rows > shortest) {
                let (rows, path) = (counted(table.rows - shortest, "row"), table.path.display());
                warnings.push(format!(
                    "'{path}': the last {rows} are left out; the other file ends before them"
                ));
                table.truncate(shortest);
            }
        }
        let mut files = Files::of(tables, self.stems());
        files.meanings = Meanings::of(self, &files)?;
        files.give_units(self)?;
        for Table { path, notes, .. } in &files.tables {
            warnings.extend(notes.iter().map(|note| format!("'{}': {note}", path.display())));
        }
        if is_alone && self.group.is_none() {
            warnings.extend(files.group_hint());
        }
        for file in 1..files.tables.len() {
            let partners = self.partners(file, &files, &mut warnings)?;
            files.joins.push(partners);
        }
        files.check_numbers()?;
        files.join();
        let (mut kept, dropped) = files.select()?;
        // The past includes rows that are no samples.
        let mut read = files.with_readings();
        if let Some(id) = files.meanings.time {
            warnings.extend(files.put_in_order(id, &mut kept, &mut read)?);
        }
        let of_samples = |id: usize| Vec::from_iter(kept.iter().map(|&row| files.number(id, row)));
        let (groups, group_names) = files.groups(&kept);
        let row_wires = files.row_wires(&kept)?;
        let past = files.past(&read, &kept, self.memory.as_ref().is_some_and(Memory::needs_clock))?;
        let channels = |ids: &[usize]| Vec::from_iter(ids.iter().map(|id| files.channel(*id)));
        let mut problem = Problem {
            inputs: channels(&files.meanings.inputs),
            targets: channels(&files.meanings.targets),
            memory: None,
            positions: Vec::new(),
            sensor: None,
        };
        if let Some(file) = &self.positions {
            problem.positions = read_positions(&folder.join(file), &problem.targets, watch)?;
        }
        for &id in files.meanings.inputs.iter().chain(&files.meanings.targets) {
            let found = Sentinel::find(&of_samples(id));
            warnings.extend(found.map(|found| found.warning(&files.columns[id].name)));
        }
        let main = &files.tables[0];
        let lines = kept.iter().map(|&row| main.line(row)).collect();
        let total = main.rows + main.too_long.count;
        let (times, reports) = (files.meanings.time.map(of_samples), files.reports());
        let (columns, meanings) = (&mut files.columns, &files.meanings);
        let targets = gather(columns, &meanings.targets, &kept, &meanings.inputs);
        let history = past(gather(columns, &meanings.inputs, &read, &[]));
        let readings;
        (problem.memory, readings) = remembered(&history, memory)?;
        Ok(Recording {
            set: Dataset::new(readings, targets, row_wires.as_deref(), groups)?,
            problem,
            history,
            parts: vec![(0, reports[0].path.clone())],
            group_names,
            lines,
            times,
            clock: files.meanings.time.map(|id| files.channel(id)),
            rows: total,
            dropped,
            files: reports,
            warnings,
        })
    }

    /// Returns the name prefixed to the columns of each joined file.
    pub fn stems(&self) -> Vec<String> {
        let mut wanted: Vec<String> = Vec::new();
        let numbered = |joined: &Joined| {
            let stem = joined.stem.clone().unwrap_or_else(|| stem(&joined.file));
            wanted.push(stem.clone());
            match wanted.iter().filter(|other| **other == stem).count() {
                1 => stem,
                count => format!("{stem}#{count}"),
            }
        };
        self.join.iter().map(numbered).collect()
    }

    /// Reads the files of a set; columns or variables with the names `more` are used, too.
    pub(super) fn read_set(
        &self,
        set: &FileSet,
        more: &[String],
        folder: &Path,
        watch: Watch<'_>,
    ) -> Result<Vec<Table>, ImportError> {
        if set.join.len() != self.join.len() {
            let needed = counted(self.join.len(), "joined file");
            let reason = format!("it needs {needed} and has {}", set.join.len());
            return Err(not_joined(&set.data, &reason, Cure::GiveJoinedFiles));
        }
        let stems = self.stems();
        let joined = self.join.iter().zip(&stems).map(Some);
        let files = set.files().zip(std::iter::once(None).chain(joined));
        files
            .map(|(file, joined)| self.read(&folder.join(file), joined, more, watch))
            .collect()
    }

    /// Reads one file, with its derived columns; `joined` gives the stem of a joined one.
    pub(super) fn read(
        &self,
        path: &Path,
        joined: Option<(&Joined, &String)>,
        more: &[String],
        watch: Watch<'_>,
    ) -> Result<Table, ImportError> {
        let prefix = joined.map_or_else(String::new, |(_, stem)| format!("{stem}."));
        let own_name = |full: &str| full.trim().strip_prefix(&*prefix).map(str::to_owned);
        let missing = self.missing.iter().filter_map(|missing| match &missing.column {
            None => Some((None, missing)),
            Some(column) => Some((Some(own_name(column)?), missing)),
        });
        let channels = self.inputs.iter().chain(&self.targets);
        let single = self.time.iter().chain(&self.group).chain(&self.row_wire);
        let derived = self.derive.iter().flat_map(Derived::columns);
        let used = channels.chain(single).chain(derived).chain(more);
        let reading = Reading {
            choice: self.dialect,
            missing: missing.collect(),
            label: self.group.as_deref().and_then(own_name),
            used: used.filter_map(|name| own_name(name)).collect(),
        };
        let mut table = read(path, &reading, watch)?;
        let time = joined.and_then(|(joined, _)| joined.time.as_deref());
        let time = time.or(self.time.as_deref());
        let time = time.map(|name| (name, self.unit_of(&format!("{prefix}{name}"))));
        for derived in &self.derive {
            derived.add_to(&mut table, own_name, time)?;
        }
        Ok(table)
    }

    /// Returns the matching rows of the joined file number `file`; `None` if it is joined row by row.
    fn partners(
        &self,
        file: usize,
        files: &Files,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Partners>, ImportError> {
        let (main, table, joined) = (&files.tables[0], &files.tables[file], &self.join[file - 1]);
        let refuse = |reason: &str, cure| not_joined(&table.path, reason, cure);
        let Some(time) = files.meanings.time else {
            if table.rows != main.rows && !self.truncate {
                let reason = format!("it has {} and the other file {}", counted(table.rows, "row"), main.rows);
                return Err(refuse(&reason, Cure::NameTimes));
            }
            return Ok(None);
        };
        let wanted = joined.time.as_deref().or(self.time.as_deref()).unwrap_or_default();
        let Some(column) = files.find_joined(file, wanted) else {
            let names = Vec::from_iter(files.names_in(file).take(30));
            let reason = format!("it has no time column '{wanted}', only {}", names.join(", "));
            return Err(refuse(&reason, Cure::NameJoinedTime));
        };
        [time, column].into_iter().try_for_each(|id| files.check_cells(id))?;
        let [of_main, of_joined] = [time, column].map(|id| &files.columns[id]);
        let later = match (of_main.start, of_joined.start) {
            (None, None) => 0.0,
            (Some(start), Some(joined)) if start.has_zone == joined.has_zone => joined.seconds_since(start),
            _ => {
                let reason = "only one of the two files has time stamps, or only one has a time zone";
                return Err(refuse(reason, Cure::NameJoinedTime));
            }
        };
        let joined_times = Vec::from_iter(of_joined.numbers.iter().map(|time| later + time));
        let Some(limit) = joined.limit.or_else(|| Some(median_interval(&joined_times)? / 2.0)) else {
            return Err(refuse("its times are all the same", Cure::GiveLimit));
        };
        let partners = nearest(&of_main.numbers, &joined_times, limit);
        let several = partners.shared;
        if 10 * several > table.rows {
            let (rows, file) = (table.rows, table.path.display());
            warnings.push(format!(
                "{several} of {rows} rows of '{file}' are joined to several rows each; it is slower, so its values are stale by up to {limit}"
            ));
        }
        Ok(Some(partners))
    }
}

fn not_joined(file: &Path, reason: &str, cure: Cure) -> ImportError {
    let cause = format!("'{}' cannot be joined: {}", file.display(), in_one_line(reason));
    ImportError::Curable { cause, cure }
}

/// Returns the memory with its usual interval, and the features of the samples with it.
fn remembered(history: &History, memory: Option<&Memory>) -> Result<(Option<Memory>, ArcArray2<f64>), DatasetError> {
    let memory = memory.filter(|memory| !memory.is_empty());
    let memory = memory.map(|memory| history.checked(memory)).transpose()?;
    let features = history.features(memory.as_ref().unwrap_or(&Memory::default()))?;
    Ok((memory, features))
}

/// Reads the table in the file at `path`; a file that does not start like a known array format is read as text.
///
/// # Errors
/// If the file cannot be read or does not contain a table, or `watch` breaks.
pub fn read_table(path: &Path, choice: DialectChoice, watch: Watch<'_>) -> Result<Table, ImportError> {
    let reading = Reading {
        choice,
        ..Reading::default()
    };
    read(path, &reading, watch)
}

pub(super) fn read(path: &Path, reading: &Reading<'_>, watch: Watch<'_>) -> Result<Table, ImportError> {
    let mut table = format::read(path, reading, watch).map_err(|error| error.in_file(path))?;
    table.notes.extend(table.transposed_note());
    Ok(table)
}

/// Measured samples with a description of their channels.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Samples of one file after another, within a file in order of time, or of the file where its clock restarts; readings and targets in the order of
    /// the features and targets of [`Self::problem`]. Without a group column, each of several files is a group, or each sample of a
    /// single file.
    pub set: Dataset,
    /// Description of the readings, the targets and the memory.
    pub problem: Problem,
    /// Readings in order of time, for [other memories](Self::with_memory).
    pub history: History,
    /// Index of the first sample of each data file, and the file.
    pub(super) parts: Vec<(usize, PathBuf)>,
    /// Name of each group of a group column.
    pub group_names: Vec<String>,
    /// Line of each sample in its file, from 1.
    pub lines: Vec<u64>,
    /// Time of each sample, if there is a time column.
    pub times: Option<Vec<f64>>,
    /// Name and unit of the time column.
    pub clock: Option<Channel>,
    /// Number of rows in the file, including dropped rows.
    pub rows: usize,
    /// Dropped rows, by reason.
    pub dropped: Vec<Dropped>,
    /// The files read: the first, then those joined; then those appended, likewise.
    pub files: Vec<FileReport>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// Rows dropped for one reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Dropped {
    /// The reason.
    pub reason: String,
    /// Number of rows.
    pub rows: usize,
    /// Line of the first of them, from 1.
    pub first_line: u64,
}

/// Summary of a file that was read.
#[derive(Clone, Debug)]
pub struct FileReport {
    /// The file.
    pub path: PathBuf,
    /// Format and layout of the file.
    pub format: Format,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// `true` if the file names its columns.
    pub(super) has_names: bool,
    /// The join by time; `None` for the first file and for files joined row by row.
    pub join: Option<JoinReport>,
}

/// Result of a join by time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct JoinReport {
    /// Maximum time difference between joined rows, in the unit of the times.
    pub limit: f64,
    /// Number of rows without a match in the joined file.
    pub without_partner: usize,
    /// Number of rows of the joined file that match no row.
    pub unused: usize,
    /// Median of the time of a row minus the time of its match.
    pub median_offset: Option<f64>,
}

impl Recording {
    /// Returns the warnings of several recordings, such as for training and for testing, which often share them.
    pub fn warnings_of<'a>(recordings: impl IntoIterator<Item = &'a Self>) -> Vec<String> {
        let all = recordings.into_iter().flat_map(|recording| &recording.warnings);
        let mut seen = HashSet::new();
        all.filter(|warning| seen.insert(*warning)).cloned().collect()
    }

    /// Returns the recording with another memory, or without one.
    ///
    /// # Errors
    /// If the memory is invalid for the readings, such as one in seconds without times.
    pub fn with_memory(&self, memory: Option<&Memory>) -> Result<Self, ImportError> {
        let (memory, features) = remembered(&self.history, memory)?;
        let problem = Problem {
            memory,
            ..self.problem.clone()
        };
        Ok(Self {
            set: self.set.with_readings(features),
            problem,
            ..self.clone()
        })
    }
}
