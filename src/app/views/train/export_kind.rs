use std::path::Path;

use crate::{
    app::{
        shared::{FileTask, FileWords, Purpose, RunView},
        training_worker::WriteRun,
    },
    evaluation::{Run, SimulatedSettings, error_rows},
    export::{CheckpointFile, NetworkFile, atomic_write, write_errors, write_loss_curves},
};

/// What can be written about a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportKind {
    /// The network with everything needed to use and reproduce it, as JSON.
    Network,
    /// The error table, as CSV.
    Errors,
    /// The loss curves, as CSV.
    LossCurves,
    /// The training as it stands, to go on from there.
    Checkpoint,
}

/// A saved training to go on from.
pub const OPEN_CHECKPOINT: FileWords = FileWords {
    name: "Open checkpoint…",
    kind: "checkpoint",
    description: "Takes up a training saved here or by train --checkpoint in a terminal, with its settings and its whole \
                  history, and holds it there; Resume goes on with the same bits.",
    extensions: &["checkpoint"],
};

impl ExportKind {
    /// In the order offered.
    pub const ALL: [Self; 4] = [Self::Network, Self::Errors, Self::LossCurves, Self::Checkpoint];

    /// What the file is called.
    pub fn words(self) -> FileWords {
        match self {
            Self::Network => FileWords {
                name: "Network…",
                kind: "network",
                description: "Layers, scaling, array, geometry, training record and errors, as JSON; the terminal command \
                              decode reads it.",
                extensions: &["json"],
            },
            Self::Errors => FileWords {
                name: "Error table…",
                kind: "error table",
                description: "The table of errors, as CSV.",
                extensions: &["csv"],
            },
            Self::LossCurves => FileWords {
                name: "Loss curves…",
                kind: "loss curves",
                description: "Training, validation and test error of every epoch, as CSV.",
                extensions: &["csv"],
            },
            Self::Checkpoint => FileWords {
                name: "Save checkpoint…",
                kind: "checkpoint",
                description: "The training as it stands, while paused or at its end: opened here or in a terminal (train \
                              --checkpoint FILE --resume) it goes on with the same bits.",
                extensions: &["checkpoint"],
            },
        }
    }

    /// The file about `run`.
    pub fn task(self, run: &RunView) -> FileTask {
        let (what, write): (_, WriteRun) = match self {
            Self::Network => ("network", write_network),
            Self::Errors => ("errors", write_error_table),
            Self::LossCurves => ("loss", write_history),
            Self::Checkpoint => ("training", write_checkpoint),
        };
        let words = self.words();
        FileTask {
            words,
            suggestion: file_name(what, words, &run.settings),
            purpose: Purpose::SaveTraining(run.id, write),
        }
    }
}

fn write_network(run: &Run, path: &Path) -> Result<(), String> {
    let file = NetworkFile::from_run(run).map_err(|error| error.to_string())?;
    file.save(path).map_err(|error| error.to_string())
}

fn write_error_table(run: &Run, path: &Path) -> Result<(), String> {
    let file = NetworkFile::from_run(run).map_err(|error| error.to_string())?;
    let rows = error_rows(&file.errors, &file.baselines, file.settings.published().as_ref());
    atomic_write(path, |writer| write_errors(&rows, writer)).map_err(|error| error.to_string())
}

fn write_history(run: &Run, path: &Path) -> Result<(), String> {
    let history = run.leader().history();
    atomic_write(path, |writer| write_loss_curves(history, writer)).map_err(|error| error.to_string())
}

fn write_checkpoint(run: &Run, path: &Path) -> Result<(), String> {
    let file = CheckpointFile::from_run(run).map_err(|error| error.to_string())?;
    file.save(path).map_err(|error| error.to_string())
}

/// A name that tells the files of different runs apart: what the file holds, and of which run.
pub fn file_name(what: &str, words: FileWords, settings: &SimulatedSettings) -> String {
    let array = settings.source.sensor.scale.to_string().replace('×', "x");
    let (hidden, method) = (settings.hidden, settings.training.method.short_name());
    let starts = match settings.starts {
        1 => String::new(),
        starts => format!("-starts{starts}"),
    };
    format!(
        "{what}-{array}-h{hidden}-{method}{starts}-seed{}.{}",
        settings.seed, words.extensions[0]
    )
}
