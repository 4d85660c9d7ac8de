use std::path::PathBuf;

use super::{
    action::Action,
    experiments::{ExperimentAction, ExperimentFile, Topic},
    export_kind::ExportKind,
};

/// What is to be done with a file once its path is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileTask {
    /// Write it about the training on show.
    Save(ExportKind),
    /// Write it about the results of an experiment.
    SaveExperiment(Topic, ExperimentFile),
    /// Go on from the training saved in it.
    OpenCheckpoint,
}

impl FileTask {
    /// The word for it.
    pub fn verb(self) -> &'static str {
        match self {
            Self::Save(_) | Self::SaveExperiment(..) => "Save",
            Self::OpenCheckpoint => "Open",
        }
    }

    /// What the file holds, in a word or two.
    pub fn file_kind(self) -> &'static str {
        match self {
            Self::Save(kind) => kind.file_kind(),
            Self::SaveExperiment(_, file) => file.file_kind(),
            Self::OpenCheckpoint => ExportKind::Checkpoint.file_kind(),
        }
    }

    /// File name extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Save(kind) => kind.extension(),
            Self::SaveExperiment(_, file) => file.extension(),
            Self::OpenCheckpoint => ExportKind::Checkpoint.extension(),
        }
    }

    /// The word on its button.
    pub fn name(self) -> &'static str {
        match self {
            Self::Save(kind) => kind.name(),
            Self::SaveExperiment(_, file) => file.name(),
            Self::OpenCheckpoint => "Open checkpoint…",
        }
    }

    /// How the button is called that asks for its path in the window.
    pub fn path_name(self) -> String {
        let file = self.file_kind();
        match self {
            Self::Save(_) | Self::SaveExperiment(..) => format!("Type a path for the {file}"),
            Self::OpenCheckpoint => format!("Type the path of a {file}"),
        }
    }

    /// What becomes of the file, in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Save(kind) => kind.description(),
            Self::SaveExperiment(_, file) => file.description(),
            Self::OpenCheckpoint => {
                "Takes up a training saved here or by train --checkpoint in a terminal, with its settings and its whole \
                 history, and holds it there; Resume goes on with the same bits."
            }
        }
    }

    /// What to do with `path`.
    pub fn at(self, path: PathBuf) -> Action {
        match self {
            Self::Save(kind) => Action::Export(kind, path),
            Self::SaveExperiment(topic, file) => ExperimentAction::Save(topic, file, path).into(),
            Self::OpenCheckpoint => Action::OpenCheckpoint(path),
        }
    }
}
