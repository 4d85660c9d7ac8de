use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use serde::Serialize;

use thiserror::Error;

use super::{SweepFiles, SweepPlan, Trial, TrialId, row::SweepRow};
pub use crate::export::DocumentError;

/// Reasons for which a folder has no table.
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
    /// Options that plans of the folders vary, each once.
    #[serde(skip)]
    pub axes: Vec<String>,
    /// Identifies the options and results of all rows, without times: two merges with the same digest have the same
    /// results to the last bit.
    pub digest: String,
    /// Trials that are planned in one of the folders and finished in none.
    pub missing: Vec<String>,
    /// Trials with the same options and different results, none of which is in the table.
    pub conflicting: Vec<String>,
    /// Files that cannot be read.
    pub damaged: Vec<String>,
    /// Rows of the trials, in order.
    pub trials: Vec<SweepRow>,
}

impl MergedSweep {
    /// Reads all trials of `folders`.
    ///
    /// # Errors
    /// A folder cannot be read, or no sweep has begun to fill it.
    pub fn read(folders: &[PathBuf]) -> Result<Self, SweepFolderError> {
        let mut merged = Self::default();
        let mut found: BTreeMap<String, Vec<Found>> = BTreeMap::new();
        let mut finished = BTreeSet::new();
        let mut plans = Vec::new();
        for folder in folders {
            let files = SweepFiles::list(folder)?;
            if files.trials.is_empty() && files.plans.is_empty() {
                return Err(SweepFolderError::NoSweep(folder.clone()));
            }
            for path in files.plans {
                match SweepPlan::load(&path) {
                    Ok(plan) => plans.push(plan),
                    Err(error) => merged.damaged.push(error.to_string()),
                }
            }
            for path in files.trials {
                match Trial::load(&path) {
                    Ok(trial) => {
                        finished.insert(trial.id());
                        let row = SweepRow::from(trial);
                        found.entry(row.key()).or_default().push(Found { path, row });
                    }
                    Err(error) => merged.damaged.push(error.to_string()),
                }
            }
        }
        for axis in plans.iter().flat_map(|plan| &plan.axes) {
            if !merged.axes.contains(&axis.option) {
                merged.axes.push(axis.option.clone());
            }
        }
        merged.missing = missing(&plans, &finished);
        for same in found.into_values() {
            merged.add(same);
        }
        merged.trials.sort_by(SweepRow::order);
        let compared: Vec<_> = merged.trials.iter().map(SweepRow::compared).collect();
        merged.digest = TrialId::of(&compared.join("\n\n\n")).to_string();
        Ok(merged)
    }

    /// Adds trials with the same options: one row if their results are the same.
    fn add(&mut self, same: Vec<Found>) {
        let mut by_result: BTreeMap<String, Found> = BTreeMap::new();
        for found in same {
            let kept = by_result.entry(found.row.compared()).or_insert_with(|| found.clone());
            // Of several versions of the program the last, whatever the order of the folders.
            if (&found.row.program, &found.path) > (&kept.row.program, &kept.path) {
                *kept = found;
            }
        }
        if by_result.len() == 1 {
            self.trials.extend(by_result.into_values().map(|found| found.row));
            return;
        }
        let files: Vec<_> = by_result.values().map(Found::describe).collect();
        self.conflicting.push(files.join(" and "));
    }

    /// Returns true if the table has every trial.
    pub fn is_whole(&self) -> bool {
        self.missing.is_empty() && self.conflicting.is_empty() && self.damaged.is_empty()
    }
}

#[derive(Clone)]
struct Found {
    path: PathBuf,
    row: SweepRow,
}

impl Found {
    fn describe(&self) -> String {
        format!("'{}' ({})", Path::display(&self.path), self.row.program)
    }
}

/// Trials of `plans` that are not finished, each once.
fn missing(plans: &[SweepPlan], finished: &BTreeSet<TrialId>) -> Vec<String> {
    let mut told = BTreeSet::new();
    let mut missing = Vec::new();
    for plan in plans {
        for (position, id) in plan.trials.iter().enumerate() {
            if !finished.contains(id) && told.insert(id) {
                missing.push(format!("trial {} ({})", position + 1, plan.describe(position)));
            }
        }
    }
    missing
}
