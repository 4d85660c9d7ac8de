use std::path::Path;

use super::Topic;
use crate::{
    evaluation::experiments::{ExperimentResults, verdicts},
    export::{WriteError, atomic_write, describe_conditions, write_cells, write_experiment_markdown, write_trials},
};

/// What can be written about an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ExperimentFile {
    /// The figures of every cell, as CSV.
    Cells,
    /// Every trial, as CSV.
    Trials,
    /// Table and verdicts, as Markdown.
    Markdown,
}

impl ExperimentFile {
    /// In the order offered.
    pub const ALL: [Self; 3] = [Self::Cells, Self::Trials, Self::Markdown];

    /// The words on its button.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cells => "Table as CSV…",
            Self::Trials => "Every trial as CSV…",
            Self::Markdown => "Table and verdicts as Markdown…",
        }
    }

    /// What the file holds, in a word or two.
    pub fn file_kind(self) -> &'static str {
        match self {
            Self::Cells => "table",
            Self::Trials => "trials",
            Self::Markdown => "table and verdicts",
        }
    }

    /// What the file is, in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Cells => "The figures of every cell with all their digits, as CSV.",
            Self::Trials => "Every trial with its seed and errors, as CSV.",
            Self::Markdown => "The table as it is shown, how it was made, and the verdicts, as Markdown.",
        }
    }

    /// File name extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Cells | Self::Trials => "csv",
            Self::Markdown => "md",
        }
    }

    /// The end of its name.
    pub(super) fn ending(self) -> &'static str {
        match self {
            Self::Cells => ".csv",
            Self::Trials => "_trials.csv",
            Self::Markdown => ".md",
        }
    }

    /// Writes the file.
    ///
    /// # Errors
    /// The file cannot be written; nothing is left half-written.
    pub fn write(self, topic: Topic, results: &ExperimentResults, path: &Path) -> Result<(), WriteError> {
        match self {
            Self::Cells => atomic_write(path, |writer| write_cells(results, writer)),
            Self::Trials => atomic_write(path, |writer| write_trials(results, writer)),
            Self::Markdown => {
                let conditions = describe_conditions(&results.experiment);
                let verdicts = verdicts(results);
                atomic_write(path, |writer| {
                    write_experiment_markdown(&topic.heading(), &conditions, results, &verdicts, writer)
                })
            }
        }
    }
}
