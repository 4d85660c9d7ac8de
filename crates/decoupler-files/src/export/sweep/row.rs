use std::{
    cmp::Ordering,
    collections::{BTreeMap, BTreeSet},
    io::{self, Write},
    path::{Path, PathBuf},
};

use decoupler_core::text::inert;
use serde::Serialize;
use serde_json::Value;
use thiserror::Error;

use super::{SweepFiles, Trial, TrialId, TrialOptions, options_text};
use crate::export::{DocumentError, write_csv_row};

/// Fields of a report that are times: they differ from run to run and are excluded from comparisons.
const TIMES: [&str; 4] = ["epoch_ms", "frame_us", "fit_seconds", "training_seconds"];

/// A trial in a table: its options, its results and its times.
#[derive(Clone, Debug, Serialize)]
pub struct SweepRow {
    pub(crate) trial: TrialId,
    pub(crate) program: String,
    /// Options that differ between the trials.
    pub options: TrialOptions,
    /// The report without its times.
    pub result: Value,
    /// Times by their place in the report, and the total time as `seconds`.
    pub time: BTreeMap<String, Value>,
}

impl From<Trial> for SweepRow {
    fn from(trial: Trial) -> Self {
        let mut row = Self {
            trial: trial.id(),
            program: trial.program,
            options: trial.options,
            result: trial.report,
            time: BTreeMap::from([("seconds".to_owned(), trial.seconds.into())]),
        };
        take_times(&mut row.result, "", &mut row.time);
        row
    }
}

/// Cells of a row by their columns, which are sorted by kind and heading.
type Cells = BTreeMap<(u8, String), String>;

impl SweepRow {
    /// The part by which tables of results are compared: options and result.
    fn compared(&self) -> String {
        format!("{}\n{}", options_text(&self.options), self.result)
    }

    /// Order in the table: by the options, in the order of their names; numbers by their size.
    fn order(&self, other: &Self) -> Ordering {
        let pairs = self.options.iter().zip(&other.options);
        let by_value = pairs.map(|((name, value), (other_name, other_value))| {
            let names = name.cmp(other_name);
            names.then_with(|| match (value.as_f64(), other_value.as_f64()) {
                // Integers beyond 2⁵³ are compared as floating-point numbers.
                (Some(one), Some(two)) => one.total_cmp(&two).then(value.as_u64().cmp(&other_value.as_u64())),
                _ => value.to_string().cmp(&other_value.to_string()),
            })
        });
        let decided = by_value.into_iter().find(|order| order.is_ne());
        let length = self.options.len().cmp(&other.options.len());
        decided.unwrap_or(length).then(self.trial.cmp(&other.trial))
    }

    /// Cells of the row. Results that repeat an option, and lists of objects, are left out.
    fn cells(&self) -> Cells {
        let mut cells = Cells::new();
        let mut add = |kind: u8, heading: String, value: Option<String>| {
            cells.extend(value.map(|value| ((kind, heading), value)));
        };
        add(0, "trial".to_owned(), Some(self.trial.to_string()));
        add(1, "program".to_owned(), Some(self.program.clone()));
        for (option, value) in &self.options {
            add(2, option.clone(), Some(text(value).unwrap_or_default()));
        }
        let fields = self.result.as_object().into_iter().flatten();
        for (name, value) in fields.filter(|(name, _)| !self.is_told_by_options(name)) {
            flatten(value, name, &mut |place, value| {
                add(3, format!("result.{place}"), text(value));
            });
        }
        for (place, value) in &self.time {
            add(4, format!("time.{place}"), Some(text(value).unwrap_or_default()));
        }
        cells
    }

    fn is_told_by_options(&self, field: &str) -> bool {
        let is_option = self.options.contains_key(&field.replace('_', "-"));
        // For epochs, the option is the maximum and the result the number run; for targets, the option has the names
        // and the result the errors.
        (is_option && !["epochs", "targets"].contains(&field)) || ["scene", "inputs"].contains(&field)
    }
}

/// Moves the times out of an object and the objects in it.
fn take_times(value: &mut Value, place: &str, times: &mut BTreeMap<String, Value>) {
    match value {
        Value::Object(fields) => {
            let found = |name: &str| Some((joined(place, name), fields.remove(name)?));
            times.extend(TIMES.into_iter().filter_map(found));
            for (name, value) in fields {
                take_times(value, &joined(place, name), times);
            }
        }
        Value::Array(values) => {
            for (index, value) in values.iter_mut().enumerate() {
                take_times(value, &joined(place, &index.to_string()), times);
            }
        }
        _ => {}
    }
}

/// Visits every value in `value` that is not an object, with its place. Objects of a list are identified by their
/// names, if they have any.
pub(in crate::export) fn flatten(value: &Value, place: &str, visit: &mut impl FnMut(&str, &Value)) {
    match value {
        Value::Object(fields) => {
            for (name, value) in fields {
                flatten(value, &joined(place, name), visit);
            }
        }
        Value::Array(values) if values.iter().any(|value| value["name"].is_string()) => {
            for value in values {
                let Value::Object(fields) = value else { continue };
                let place = joined(place, value["name"].as_str().unwrap_or_default());
                for (field, value) in fields.iter().filter(|(field, _)| *field != "name") {
                    flatten(value, &joined(&place, field), visit);
                }
            }
        }
        value => visit(place, value),
    }
}

fn joined(place: &str, name: &str) -> String {
    if place.is_empty() {
        name.to_owned()
    } else {
        format!("{place}.{name}")
    }
}

/// Returns the text of a cell: numbers read back bit for bit, `null` is empty; `None` for a list of objects.
fn text(value: &Value) -> Option<String> {
    match value {
        Value::Null => Some(String::new()),
        Value::String(text) => Some(text.clone()),
        Value::Array(values) => {
            let texts = values.iter().map(Value::as_str).collect::<Option<Vec<_>>>()?;
            // Remarks are sentences; values of an option are words.
            let has_sentences = texts.iter().any(|text| text.contains(' '));
            Some(texts.join(if has_sentences { "; " } else { " " }))
        }
        Value::Object(_) => None,
        value => Some(value.to_string()),
    }
}

/// Layout of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SweepTableFormat {
    /// One line per trial.
    Csv,
    /// One object with every field of the results, and the missing and conflicting trials.
    Json,
}

impl SweepTableFormat {
    /// Returns the format given by the extension of `path`.
    pub fn of(path: &Path) -> Option<Self> {
        let ends_with = |ending| path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending));
        match ends_with("csv") {
            true => Some(Self::Csv),
            false => ends_with("json").then_some(Self::Json),
        }
    }

    /// Writes the rows of a sweep as a table.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write(self, merged: &MergedSweep, writer: &mut dyn Write) -> io::Result<()> {
        match self {
            Self::Csv => write_csv(merged, writer),
            Self::Json => {
                serde_json::to_writer_pretty(&mut *writer, merged)?;
                writeln!(writer)
            }
        }
    }
}

fn write_csv(merged: &MergedSweep, writer: &mut dyn Write) -> io::Result<()> {
    let rows: Vec<Cells> = merged.trials.iter().map(SweepRow::cells).collect();
    let columns: BTreeSet<_> = rows.iter().flat_map(Cells::keys).collect();
    write_csv_row(columns.iter().map(|(_, heading)| heading), writer)?;
    for cells in &rows {
        let cell = |column| cells.get(column).map_or("", String::as_str);
        write_csv_row(columns.iter().map(|&column| inert(cell(column))), writer)?;
    }
    writer.flush()
}

/// Reasons why a folder has no table.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SweepFolderError {
    /// No sweep has begun to fill it.
    #[error("no sweep in '{}': give a folder that decoupler sweep has filled", .0.display())]
    NoSweep(PathBuf),
    /// It cannot be read.
    #[error(transparent)]
    Unreadable(#[from] DocumentError),
}

/// The trials of several folders.
#[derive(Default, Serialize)]
pub struct MergedSweep {
    /// Identifies the options and results of all rows, without times: two merges with the same digest have the same
    /// results to the last bit.
    pub digest: String,
    /// Trials that have no result. [`Self::read`] lists those begun in one of the folders: it does not know the others.
    pub missing: Vec<String>,
    /// Trials with the same options and different results, none of which is in the table.
    pub conflicting: Vec<String>,
    /// Files that cannot be read.
    pub damaged: Vec<String>,
    /// Rows of the trials, in order.
    pub trials: Vec<SweepRow>,
    #[serde(skip)]
    finished: BTreeSet<TrialId>,
}

impl MergedSweep {
    /// Reads all trials of `folders`.
    ///
    /// # Errors
    /// A folder cannot be read, or no sweep has begun to fill it.
    pub fn read(folders: &[PathBuf]) -> Result<Self, SweepFolderError> {
        let mut merged = Self::default();
        // Different results of the same options. Of the same results, those of the latest program version are kept, in any
        // order of the folders.
        let mut found: BTreeMap<String, BTreeMap<String, (PathBuf, SweepRow)>> = BTreeMap::new();
        let mut unfinished = BTreeSet::new();
        for folder in folders {
            let files = SweepFiles::list(folder)?;
            if files.trials.is_empty() && files.unfinished.is_empty() {
                return Err(SweepFolderError::NoSweep(folder.clone()));
            }
            unfinished.extend(files.unfinished);
            for path in files.trials {
                match Trial::load(&path) {
                    Ok(trial) => {
                        merged.finished.insert(trial.id());
                        let row = SweepRow::from(trial);
                        let same = found.entry(options_text(&row.options)).or_default();
                        let (kept_path, kept) = same.entry(row.compared()).or_insert((path.clone(), row.clone()));
                        if (&row.program, &path) > (&kept.program, kept_path) {
                            (*kept_path, *kept) = (path, row);
                        }
                    }
                    Err(error) => merged.damaged.push(error.to_string()),
                }
            }
        }
        let unfinished =
            { unfinished.difference(&merged.finished) }.map(|id| format!("trial {id} (begun, not finished)"));
        merged.missing = unfinished.collect();
        for results in found.into_values() {
            if results.len() == 1 {
                merged.trials.extend(results.into_values().map(|(_, row)| row));
                continue;
            }
            let files = results.values();
            let files = files.map(|(path, row)| format!("'{}' ({})", path.display(), row.program));
            merged.conflicting.push(Vec::from_iter(files).join(" and "));
        }
        merged.trials.sort_by(SweepRow::order);
        let compared: Vec<_> = merged.trials.iter().map(SweepRow::compared).collect();
        merged.digest = TrialId::of(&compared.join("\n\n\n")).to_string();
        Ok(merged)
    }

    /// Returns true if one of the folders has a result of the trial.
    pub fn has(&self, trial: TrialId) -> bool {
        self.finished.contains(&trial)
    }

    /// Returns true if no trial is known to be missing from the table.
    pub fn is_whole(&self) -> bool {
        self.missing.is_empty() && self.conflicting.is_empty() && self.damaged.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn row(options: Value, report: Value) -> SweepRow {
        let options = serde_json::from_value(options).unwrap();
        SweepRow::from(Trial::new(options, report, 1.5))
    }

    #[test]
    fn times_are_separate_and_options_are_listed_once() {
        let report = json!({
            "epochs": 20, "hidden": 8, "scene": {"rows": "all"}, "epoch_ms": 2.5, "published": null,
            "warnings": ["first of two", "second"], "starts": [{"epochs": 20}],
            "decoders": {"ridge": {"z_mm": 0.5, "frame_us": 3.0}},
        });
        let row = row(json!({"epochs": 100, "hidden": 8, "decoder": ["ridge"]}), report);
        let cells = row.cells();
        let texts: Vec<_> = cells
            .iter()
            .map(|((_, heading), text)| (heading.clone(), text.as_str()))
            .collect();
        let texts: Vec<_> = texts
            .iter()
            .map(|(heading, text)| (heading.as_str(), *text))
            .skip(2)
            .collect();
        assert_eq!(
            texts,
            [
                ("decoder", "ridge"),
                ("epochs", "100"),
                ("hidden", "8"),
                ("result.decoders.ridge.z_mm", "0.5"),
                ("result.epochs", "20"),
                ("result.published", ""),
                ("result.warnings", "first of two; second"),
                ("time.decoders.ridge.frame_us", "3.0"),
                ("time.epoch_ms", "2.5"),
                ("time.seconds", "1.5"),
            ]
        );
    }

    #[test]
    fn errors_of_targets_are_columns_by_their_names() {
        let report = json!({
            "targets": [{"name": "fx", "unit": null, "rmse": 0.5}, {"name": "fz", "unit": "N", "rmse": 0.25}],
            "baselines": {"ridge": [{"name": "fx", "rmse": 0.75}]},
        });
        let cells = row(json!({"targets": ["fx", "fz"]}), report).cells();
        let of_results = cells.iter().filter(|((kind, _), _)| *kind == 3);
        let of_results: Vec<_> = of_results
            .map(|((_, heading), text)| (heading.clone(), text.as_str()))
            .collect();
        let expected = [
            ("result.baselines.ridge.fx.rmse", "0.75"),
            ("result.targets.fx.rmse", "0.5"),
            ("result.targets.fx.unit", ""),
            ("result.targets.fz.rmse", "0.25"),
            ("result.targets.fz.unit", "N"),
        ];
        assert_eq!(of_results, expected.map(|(heading, text)| (heading.to_owned(), text)));
    }

    #[test]
    fn rows_are_in_the_order_of_numbers() {
        let with = |hidden: u64, seed: u64| row(json!({"hidden": hidden, "seed": seed}), json!({}));
        let mut rows = [
            with(10, 2),
            with(6, 18_446_744_073_709_551_615),
            with(6, 18_446_744_073_709_551_614),
            with(8, 0),
        ];
        rows.sort_by(SweepRow::order);
        let options = rows.map(|row| (row.options["hidden"].as_u64(), row.options["seed"].as_u64()));
        assert_eq!(
            options,
            [
                (Some(6), Some(18_446_744_073_709_551_614)),
                (Some(6), Some(18_446_744_073_709_551_615)),
                (Some(8), Some(0)),
                (Some(10), Some(2))
            ]
        );
    }
}
