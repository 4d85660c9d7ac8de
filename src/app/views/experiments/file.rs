use std::{path::Path, sync::Arc};

use super::Topic;
use crate::{
    app::shared::{FileTask, FileWords},
    evaluation::experiments::{ExperimentResults, verdicts},
    export::{
        atomic_write, describe_conditions,
        figures::{PictureError, PictureFormat},
        write_cells, write_experiment_markdown, write_trials,
    },
    figure::experiment_figure,
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

/// What a figure is, in a sentence.
const FIGURE: &str = "The picture on a light ground, at publication size.";

impl ExperimentFile {
    /// In the order offered.
    pub const ALL: [Self; 5] = [
        Self::Cells,
        Self::Trials,
        Self::Markdown,
        Self::Figure(PictureFormat::Svg),
        Self::Figure(PictureFormat::Png),
    ];

    /// What the file is called.
    pub fn words(self) -> FileWords {
        let (name, kind, description, extensions): (_, _, _, &[&str]) = match self {
            Self::Cells => (
                "Table as CSV…",
                "table",
                "The figures of every cell with all their digits, as CSV.",
                &["csv"],
            ),
            Self::Trials => (
                "Every trial as CSV…",
                "trials",
                "Every trial with its seed and errors, as CSV.",
                &["csv"],
            ),
            Self::Markdown => (
                "Table and verdicts as Markdown…",
                "table and verdicts",
                "The table as it is shown, how it was made, and the verdicts, as Markdown.",
                &["md"],
            ),
            Self::Figure(PictureFormat::Svg) => ("Figure as SVG…", "figure", FIGURE, &["svg"]),
            Self::Figure(PictureFormat::Png) => ("Figure as PNG…", "figure", FIGURE, &["png"]),
        };
        FileWords {
            name,
            kind,
            description,
            extensions,
        }
    }

    /// The file about these results.
    pub fn task(self, topic: Topic, results: Arc<ExperimentResults>) -> FileTask {
        let words = self.words();
        let kind = if self == Self::Trials { "_trials" } else { "" };
        let name = topic.name().to_lowercase().replace(' ', "_");
        let suggestion = format!("{name}{kind}.{}", words.extensions[0]);
        FileTask::save(words, suggestion, move |path| self.write(topic, &results, path))
    }

    fn write(self, topic: Topic, results: &ExperimentResults, path: &Path) -> Result<(), PictureError> {
        match self {
            Self::Cells => atomic_write(path, |writer| write_cells(results, writer))?,
            Self::Trials => atomic_write(path, |writer| write_trials(results, writer))?,
            Self::Figure(format) => experiment_figure(results).draw().save(format, path)?,
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
