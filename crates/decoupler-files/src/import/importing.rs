use std::{
    borrow::Cow,
    fs::File,
    io::{self, BufReader, Read, Seek},
    path::{Path, PathBuf},
};

use decoupler_core::{
    dataset::{Dataset, DatasetError, History, Memory},
    problem::{Channel, Problem, TargetPosition},
    text::{counted, in_one_line},
};
use serde::Serialize;

use super::{
    Cells, Cure, Derived, DialectChoice, FileSet, Format, ImportError, Joined, Missing, Recipe, Table, TableError,
    Watch, arrays,
    csv_table::{self, Reading},
    derived::TimeColumn,
    format::Contents,
    inputs::{ColumnId, Names},
    join::{Partners, Source, gather, median_interval, nearest},
    matlab, numpy,
    part::Part,
    positions::read_positions,
    progress::Watched,
    selection::{Rows, not_a_number},
    sentinel::{Sentinel, is_rounding, rounding_warning},
    sheet::Spreadsheet,
    suggestion::{Meanings, is_group_name},
    table::{column_called, stem},
};
use crate::machine::ReadingBudget;

impl Recipe {
    /// Imports the samples of the files, whose paths are relative to `folder`.
    ///
    /// # Errors
    /// If a file cannot be read, a column is missing, a used cell is not a number, no row is left, or `watch` breaks.
    pub fn import(&self, folder: &Path, watch: Watch<'_>) -> Result<Recording, ImportError> {
        let mut recording = self.import_all(folder, watch)?;
        let values = recording.set.targets();
        let targets = recording.targets.iter().zip(values.columns());
        let rounded = targets.filter(|(_, values)| is_rounding(&values.to_vec()));
        let warnings = Vec::from_iter(rounded.map(|(target, _)| rounding_warning(&target.name)));
        recording.warnings.extend(warnings);
        Ok(recording)
    }

    /// Imports the samples of all files.
    fn import_all(&self, folder: &Path, watch: Watch<'_>) -> Result<Recording, ImportError> {
        let first = self.import_set(folder, watch);
        if self.append.is_empty() {
            return first.map(|part| part.recording);
        }
        let mut parts = vec![first.map_err(|error| error.of_file(&self.data))?];
        // Lags in seconds have as many samples in all files.
        let memory = parts[0].recording.memory().cloned();
        // Without the further files, of which each recipe of one of them would have a copy.
        let of_one = Self {
            append: Vec::new(),
            ..self.clone()
        };
        for FileSet { data, join } in &self.append {
            let mut recipe = of_one.of_files(data, join)?;
            recipe.memory.clone_from(&memory);
            let part = recipe.import_set(folder, watch);
            parts.push(part.map_err(|error| error.of_file(data))?);
        }
        Part::joined(parts, self.group.is_some())
    }

    /// Imports the samples of the first file, without those of appended files.
    fn import_set(&self, folder: &Path, watch: Watch<'_>) -> Result<Part, ImportError> {
        let stems = self.stems();
        let mut files = vec![self.read(folder, 0, &self.data, None, watch)?];
        for (number, (joined, stem)) in self.join.iter().zip(&stems).enumerate() {
            files.push(self.read(folder, number + 1, &joined.file, Some(stem), watch)?);
        }
        let columns = Vec::from_iter(files.iter().map(|(_, table)| table.columns.as_slice()));
        let names = Names::of(&columns, &stems);
        let meanings = Meanings::of(self, &names)?;
        let mut warnings = notes(&files);
        let used = |id: &ColumnId| meanings.inputs.contains(id) || meanings.targets.contains(id);
        let groups = names
            .all()
            .find(|(name, id)| id.file == 0 && is_group_name(name) && !used(id));
        if let Some((name, _)) = groups.filter(|_| meanings.group.is_none() && self.append.is_empty()) {
            warnings.push(format!(
                "the column {name} looks like a group of samples that belong together: choose it as the group (--group \
                 {name}), so that training and test samples never share one"
            ));
        }
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
        // The past includes rows that are no samples.
        let mut read = rows.with_readings();
        if let Some(id) = meanings.time {
            warnings.extend(rows.put_in_order(id, &mut kept, &mut read)?);
        }
        let times: Option<Vec<f64>> = meanings
            .time
            .map(|id| kept.iter().map(|&row| rows.number(id, row)).collect());
        let lines = kept.iter().map(|&row| files[0].1.line(row)).collect();
        let (groups, group_names) = rows.groups(&kept);
        let row_wires = rows.row_wires(&kept)?;
        let past = rows.past(&read, &kept)?;
        let channels = |ids: &[ColumnId]| ids.iter().map(|id| rows.channel(*id)).collect::<Vec<Channel>>();
        let (inputs, targets) = (channels(&meanings.inputs), channels(&meanings.targets));
        let positions = match &self.positions {
            Some(file) => read_positions(&folder.join(file), &targets, watch)?,
            None => Vec::new(),
        };
        for &id in meanings.inputs.iter().chain(&meanings.targets) {
            let used = Vec::from_iter(kept.iter().map(|&row| rows.number(id, row)));
            warnings.extend(Sentinel::find(&used).map(|found| found.warning(names.name(id))));
        }
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
        source.rows = &read;
        let history = past.with_readings(gather(&mut source, &meanings.inputs, &[]));
        let memory = self.memory.as_ref().filter(|memory| !memory.is_empty());
        let memory = memory.map(|memory| history.checked(memory)).transpose()?;
        let readings = history.features(memory.as_ref().unwrap_or(&Memory::default()))?;
        let problem = Problem {
            inputs,
            targets,
            memory,
            positions,
            sensor: None,
        };
        let recording = Recording {
            set: Dataset::new(readings, targets_of_rows, row_wires.as_deref(), groups)?,
            inputs: problem.features(),
            targets: problem.targets.clone(),
            positions: problem.positions.clone(),
            problem,
            history,
            parts: vec![(0, reports[0].path.clone())],
            lines,
            times,
            has_groups: self.group.is_some(),
            rows: total,
            dropped,
            files: reports,
            warnings,
        };
        Ok(Part { recording, group_names })
    }

    /// Returns the name prefixed to the columns of each joined file.
    pub fn stems(&self) -> Vec<String> {
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
        self.read_using(&[], folder, (number, file, prefix), watch)
    }

    /// As [`Self::read`] for the file with this number, path and prefix; columns or variables with the names `more` are used,
    /// too.
    pub(super) fn read_using(
        &self,
        more: &[String],
        folder: &Path,
        (number, file, prefix): (usize, &Path, Option<&String>),
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
        let columns = self.inputs.iter().chain(&self.targets);
        let columns = columns.chain(self.derive.iter().flat_map(Derived::columns));
        let used = columns
            .chain(&self.time)
            .chain(&self.group)
            .chain(&self.row_wire)
            .chain(more);
        let reading = Reading {
            choice: self.dialect,
            missing,
            labels: self.group.iter().filter_map(|group| own_name(group)).collect(),
            used: used.filter_map(|name| own_name(name)).collect(),
        };
        let mut table = read(&path, &reading, watch)?;
        let time = match number.checked_sub(1).and_then(|joined| self.join.get(joined)) {
            Some(joined) => joined.time.clone().or_else(|| self.time.clone()),
            None => self.time.clone(),
        };
        let time = time.as_deref().map(|name| TimeColumn {
            name,
            given_unit: match prefix {
                None => self.unit_of(name),
                Some(stem) => self.unit_of(&format!("{stem}.{name}")),
            },
        });
        for derived in &self.derive {
            derived.add_to(&mut table, own_name, time)?;
        }
        if number == 0 {
            table.stem = stem(file);
        }
        Ok((path, table))
    }

    /// Returns the matching rows of the joined file `number`; `None` if it is joined row by row.
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
        let refuse = |reason: String, cure: Cure| ImportError::Join {
            path: path.clone(),
            reason: in_one_line(&reason),
            cure,
        };
        let main = &files[0].1;
        let Some(time) = meanings.time else {
            if table.rows != main.rows {
                let reason = format!("it has {} and the other file {}", counted(table.rows, "row"), main.rows);
                return Err(refuse(reason, Cure::NameTimes));
            }
            return Ok(None);
        };
        let wanted = joined.time.as_deref().or(self.time.as_deref()).unwrap_or_default();
        let Some(column) = column_called(&table.columns, wanted) else {
            let all: Vec<&str> = table
                .columns
                .iter()
                .map(|column| column.name.as_str())
                .take(30)
                .collect();
            let reason = format!("it has no time column '{wanted}', only {}", all.join(", "));
            return Err(refuse(reason, Cure::NameJoinedTime));
        };
        let id = ColumnId { file: number, column };
        for id in [time, id] {
            not_a_number(files, names, id)?;
        }
        let (Cells::Numbers(times), Cells::Numbers(joined_times)) =
            (&main.columns[time.column].cells, &table.columns[column].cells)
        else {
            let reason = "its times are a group as well".to_owned();
            return Err(refuse(reason, Cure::GiveOneMeaning));
        };
        let joined_times = match (main.columns[time.column].start, table.columns[column].start) {
            (None, None) => Cow::Borrowed(joined_times),
            (Some(start), Some(joined_start)) if start.has_zone == joined_start.has_zone => {
                let later = joined_start.seconds_since(start);
                Cow::Owned(joined_times.iter().map(|time| later + time).collect())
            }
            _ => {
                let reason = "only one of the two files has time stamps, or only one has a time zone".to_owned();
                return Err(refuse(reason, Cure::NameJoinedTime));
            }
        };
        let Some(limit) = joined.limit.or_else(|| Some(median_interval(&joined_times)? / 2.0)) else {
            return Err(refuse("its times are all the same".to_owned(), Cure::GiveLimit));
        };
        let partners = nearest(times, &joined_times, limit);
        let mut uses = vec![0_usize; table.rows];
        partners.rows.iter().flatten().for_each(|&row| uses[row as usize] += 1);
        let several = uses.iter().filter(|&&count| count > 1).count();
        if 10 * several > table.rows {
            let file = path.display();
            warnings.push(format!(
                "{several} of {} rows of '{file}' are joined to several rows each; it is slower, so its values are stale by up to {limit}",
                table.rows
            ));
        }
        Ok(Some(partners))
    }
}

/// Returns the notes on each file.
fn notes(files: &[(PathBuf, Table)]) -> Vec<String> {
    let of_file = |(path, table): &(PathBuf, Table)| {
        let file = path.display().to_string();
        Vec::from_iter(table.notes.iter().map(|note| format!("'{file}': {note}")))
    };
    files.iter().flat_map(of_file).collect()
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
    read_file(path, reading, watch).map_err(|error| error.in_file(path))
}

fn read_file(path: &Path, reading: &Reading<'_>, watch: Watch<'_>) -> Result<Table, TableError> {
    let mut file = File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        return Err(io::Error::from(io::ErrorKind::IsADirectory).into());
    }
    let size = metadata.is_file().then_some(metadata.len());
    let mut start = Vec::new();
    let budget = &mut ReadingBudget::now();
    if size.is_none() {
        // A pipe can be read only once.
        return csv_table::read(path, Watched::new(file, None, watch), reading, budget);
    }
    (&file).take(Format::BEGINNING).read_to_end(&mut start)?;
    file.rewind()?;
    let (found, left_out, format) = match Contents::of(path, &start)? {
        Contents::Text => return csv_table::read(path, Watched::new(file, size, watch), reading, budget),
        Contents::Zip => {
            let kind = Spreadsheet::of_zip(&file)?;
            file.rewind()?;
            if let Some(kind) = kind {
                return kind.read(path, file, reading, budget, watch);
            }
            let (found, left_out) = numpy::read_archive(BufReader::new(file), budget, watch)?;
            (found, left_out, Format::Npz)
        }
        Contents::Npy => {
            let array = numpy::read("", BufReader::new(Watched::new(file, size, watch)), budget)?;
            (vec![array], Vec::new(), Format::Npy)
        }
        Contents::Matlab => {
            let (found, left_out) = matlab::read(BufReader::new(Watched::new(file, size, watch)), budget)?;
            (found, left_out, Format::Matlab)
        }
    };
    arrays::table(path, found, format, left_out, reading)
}

/// Measured samples with a description of their channels.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Samples of one file after another, within a file in order of time, or of the file where its clock restarts; readings and targets in the order of
    /// [`Self::inputs`] and [`Self::targets`]. Without a group column, each of several files is a group, or each sample of a
    /// single file.
    pub set: Dataset,
    /// Names and units of the channels of [`Self::set`]: the readings and, with a memory, the values from their past.
    pub inputs: Vec<Channel>,
    /// Names and units of the targets.
    pub targets: Vec<Channel>,
    /// Positions of targets on the skin, for those that have one.
    pub positions: Vec<TargetPosition>,
    /// Description of the readings, the targets and the memory.
    problem: Problem,
    /// Readings in order of time, for [other memories](Self::with_memory).
    pub(super) history: History,
    /// Index of the first sample of each data file, and the file.
    pub(super) parts: Vec<(usize, PathBuf)>,
    /// Line of each sample in its file, from 1.
    pub lines: Vec<u64>,
    /// Time of each sample, if there is a time column.
    pub times: Option<Vec<f64>>,
    /// `true` if there is a group column, or several files.
    pub has_groups: bool,
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
    /// Returns the description of the channels.
    pub fn problem(&self) -> Problem {
        self.problem.clone()
    }

    /// Returns the warnings of several recordings, such as for training and for testing, which often share them.
    pub fn warnings_of<'a>(recordings: impl IntoIterator<Item = &'a Self>) -> Vec<String> {
        let all = recordings.into_iter().flat_map(|recording| &recording.warnings);
        let mut warnings = Vec::new();
        for warning in all {
            if !warnings.contains(warning) {
                warnings.push(warning.clone());
            }
        }
        warnings
    }

    /// Memory whose features are the channels of the samples, with its usual interval.
    pub fn memory(&self) -> Option<&Memory> {
        self.problem.memory.as_ref()
    }

    /// Readings in order of time, from which the features of any memory are computed.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Returns the recording with another memory, or without one.
    ///
    /// # Errors
    /// If the memory is invalid for the readings, such as one in seconds without times.
    pub fn with_memory(&self, memory: Option<&Memory>) -> Result<Self, DatasetError> {
        let memory = memory
            .filter(|memory| !memory.is_empty())
            .map(|memory| self.history.checked(memory))
            .transpose()?;
        let features = self.history.features(memory.as_ref().unwrap_or(&Memory::default()))?;
        let problem = Problem {
            memory,
            ..self.problem.clone()
        };
        Ok(Self {
            set: self.set.with_readings(features),
            inputs: problem.features(),
            problem,
            ..self.clone()
        })
    }
}
