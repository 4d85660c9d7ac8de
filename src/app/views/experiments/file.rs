use std::path::Path;

use super::Topic;
use crate::{
    evaluation::experiments::{ExperimentResults, verdicts},
    export::{
        atomic_write, describe_conditions, draw_experiment,
        figures::{PictureError, PictureFormat},
        write_cells, write_experiment_markdown, write_trials,
    },
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
    /// The picture at publication size.
    Figure(PictureFormat),
}

impl ExperimentFile {
    /// In the order offered.
    pub const ALL: [Self; 5] = [
        Self::Cells,
        Self::Trials,
        Self::Markdown,
        Self::Figure(PictureFormat::Svg),
        Self::Figure(PictureFormat::Png),
    ];

    /// The words on its button.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cells => "Table as CSV…",
            Self::Trials => "Every trial as CSV…",
            Self::Markdown => "Table and verdicts as Markdown…",
            Self::Figure(PictureFormat::Svg) => "Figure as SVG…",
            Self::Figure(PictureFormat::Png) => "Figure as PNG…",
        }
    }

    /// What the file holds, in a word or two.
    pub fn file_kind(self) -> &'static str {
        match self {
            Self::Cells => "table",
            Self::Trials => "trials",
            Self::Markdown => "table and verdicts",
            Self::Figure(_) => "figure",
        }
    }

    /// What the file is, in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Cells => "The figures of every cell with all their digits, as CSV.",
            Self::Trials => "Every trial with its seed and errors, as CSV.",
            Self::Markdown => "The table as it is shown, how it was made, and the verdicts, as Markdown.",
            Self::Figure(_) => "The picture on a light ground, at publication size.",
        }
    }

    /// File name extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Cells | Self::Trials => "csv",
            Self::Markdown => "md",
            Self::Figure(format) => format.extension(),
        }
    }

    /// The end of its name.
    pub(super) fn ending(self) -> &'static str {
        match self {
            Self::Cells => ".csv",
            Self::Trials => "_trials.csv",
            Self::Markdown => ".md",
            Self::Figure(PictureFormat::Svg) => ".svg",
            Self::Figure(PictureFormat::Png) => ".png",
        }
    }

    /// Writes the file.
    ///
    /// # Errors
    /// The file cannot be written; nothing is left half-written.
    pub fn write(self, topic: Topic, results: &ExperimentResults, path: &Path) -> Result<(), PictureError> {
        match self {
            Self::Cells => atomic_write(path, |writer| write_cells(results, writer))?,
            Self::Trials => atomic_write(path, |writer| write_trials(results, writer))?,
            Self::Figure(format) => draw_experiment(results).save(format, path)?,
            Self::Markdown => {
                let conditions = describe_conditions(&results.experiment);
                let verdicts = verdicts(results);
                atomic_write(path, |writer| {
                    write_experiment_markdown(&topic.heading(), &conditions, results, &verdicts, writer)
                })?;
            }
        }
        Ok(())
    }
}
