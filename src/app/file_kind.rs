use super::{
    experiments::{ExperimentFile, Topic},
    export_kind::ExportKind,
};

/// What can be written: about a training, or about an experiment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FileKind {
    /// About the training on show.
    Training(ExportKind),
    /// About the results of an experiment.
    Experiment(Topic, ExperimentFile),
}

impl From<ExportKind> for FileKind {
    fn from(kind: ExportKind) -> Self {
        Self::Training(kind)
    }
}

impl FileKind {
    /// What the file holds, in a word or two.
    pub fn file_kind(self) -> &'static str {
        match self {
            Self::Training(kind) => kind.file_kind(),
            Self::Experiment(_, file) => file.file_kind(),
        }
    }

    /// What the file is, in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Training(kind) => kind.description(),
            Self::Experiment(_, file) => file.description(),
        }
    }

    /// File name extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Training(kind) => kind.extension(),
            Self::Experiment(_, file) => file.extension(),
        }
    }
}
