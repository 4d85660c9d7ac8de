use super::export_kind::ExportKind;

/// What is to be done with a file once its path is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileTask {
    /// Write it.
    Save(ExportKind),
    /// Go on from the training saved in it.
    OpenCheckpoint,
}

impl FileTask {
    /// The word for it.
    pub fn verb(self) -> &'static str {
        match self {
            Self::Save(_) => "Save",
            Self::OpenCheckpoint => "Open",
        }
    }

    /// The file it is about.
    pub fn kind(self) -> ExportKind {
        match self {
            Self::Save(kind) => kind,
            Self::OpenCheckpoint => ExportKind::Checkpoint,
        }
    }

    /// The word on its button.
    pub fn name(self) -> &'static str {
        match self {
            Self::Save(kind) => kind.name(),
            Self::OpenCheckpoint => "Open checkpoint…",
        }
    }

    /// How the button is called that asks for its path in the window.
    pub fn path_name(self) -> String {
        let file = self.kind().file_kind();
        match self {
            Self::Save(_) => format!("Type a path for the {file}"),
            Self::OpenCheckpoint => format!("Type the path of a {file}"),
        }
    }

    /// What becomes of the file, in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Save(kind) => kind.description(),
            Self::OpenCheckpoint => {
                "Takes up a training saved here or by train --checkpoint in a terminal, with its settings and its whole \
                 history, and holds it there; Resume goes on with the same bits."
            }
        }
    }
}
