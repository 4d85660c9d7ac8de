use std::path::{Path, PathBuf};

use super::{
    Cells, Cure, ImportError, Joined, Missing, Recipe, Recording, Table, Watch,
    csv_table::Reading,
    join::{Partners, Source, gather, median_interval, nearest},
    meanings::Meanings,
    names::{ColumnId, Names},
    positions::read_positions,
    read::read,
    selection::{Rows, not_a_number},
    table::stem,
};
use decoupler_core::{dataset::Dataset, evaluation::Channel};

impl Recipe {
    /// Reads the files, relative to `folder`, and makes the samples.
    ///
    /// # Errors
    /// If a file cannot be read, a column is missing, a cell that is used is not a number, or no row is left; or `watch` breaks.
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
        let lines = kept.iter().map(|&row| files[0].1.line(row)).collect();
        let groups = rows.groups(&kept);
        let row_wires = rows.row_wires(&kept)?;
        let channels = |ids: &[ColumnId]| ids.iter().map(|id| rows.channel(*id)).collect::<Vec<Channel>>();
        let (inputs, targets) = (channels(&meanings.inputs), channels(&meanings.targets));
        let positions = match &self.positions {
            Some(file) => read_positions(&folder.join(file), &targets, watch)?,
            None => Vec::new(),
        };
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
            positions,
            lines,
            times,
            has_groups: self.group.is_some(),
            rows: total,
            dropped,
            files: reports,
            warnings,
        })
    }

    /// Names in front of the columns of the joined files.
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
        let refuse = |reason: String, cure: Cure| ImportError::Join {
            path: path.clone(),
            reason,
            cure,
        };
        let main = &files[0].1;
        let Some(time) = meanings.time else {
            if table.rows != main.rows {
                let reason = format!("it has {} rows and the other file {}", table.rows, main.rows);
                return Err(refuse(reason, Cure::NameTimes));
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
            let reason = format!("it has no column '{wanted}' for its times, but {}", all.join(", "));
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
        let Some(limit) = joined.limit.or_else(|| Some(median_interval(joined_times)? / 2.0)) else {
            return Err(refuse("its times are all the same".to_owned(), Cure::GiveLimit));
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

/// Notes on the files themselves.
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
