use std::path::PathBuf;

use crate::{
    app::{
        training_worker::ExportKind,
        views::{
            experiments::{ExperimentAction, ExperimentFile, Topic},
            trade_off::{TradeAction, TradeFile},
            train::shown_figure::ShownPicture,
        },
        window::Action,
    },
    export::figures::PictureFormat,
};

/// What is to be done with a file once its path is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileTask {
    /// Write it about the training on show.
    Save(ExportKind),
    /// Write it about the results of an experiment.
    SaveExperiment(Topic, ExperimentFile),
    /// Write it about the speed and accuracy measured.
    SaveTrade(TradeFile),
    /// Write this picture in view to it.
    SavePicture(ShownPicture),
    /// Go on from the training saved in it.
    OpenCheckpoint,
}

impl FileTask {
    /// The word for it.
    pub fn verb(self) -> &'static str {
        match self {
            Self::Save(_) | Self::SaveExperiment(..) | Self::SaveTrade(_) | Self::SavePicture(_) => "Save",
            Self::OpenCheckpoint => "Open",
        }
    }

    /// What the file holds, in a word or two.
    pub fn file_kind(self) -> &'static str {
        match self {
            Self::Save(kind) => kind.file_kind(),
            Self::SaveExperiment(_, file) => file.file_kind(),
            Self::SaveTrade(file) => file.file_kind(),
            Self::SavePicture(ShownPicture::Surfaces) => "picture of the surfaces",
            Self::SavePicture(ShownPicture::Chart) => "picture of the chart",
            Self::OpenCheckpoint => ExportKind::Checkpoint.file_kind(),
        }
    }

    /// File name extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Save(kind) => kind.extension(),
            Self::SaveExperiment(_, file) => file.extension(),
            Self::SaveTrade(file) => file.extension(),
            Self::SavePicture(_) => PictureFormat::Png.extension(),
            Self::OpenCheckpoint => ExportKind::Checkpoint.extension(),
        }
    }

    /// The word on its button.
    pub fn name(self) -> &'static str {
        match self {
            Self::Save(kind) => kind.name(),
            Self::SaveExperiment(_, file) => file.name(),
            Self::SaveTrade(file) => file.name(),
            Self::SavePicture(ShownPicture::Surfaces) => "Surfaces, PNG or SVG…",
            Self::SavePicture(ShownPicture::Chart) => "Chart, PNG or SVG…",
            Self::OpenCheckpoint => "Open checkpoint…",
        }
    }

    /// How the button is called that asks for its path in the window.
    pub fn path_name(self) -> String {
        let file = self.file_kind();
        match self {
            Self::Save(_) | Self::SaveExperiment(..) | Self::SaveTrade(_) | Self::SavePicture(_) => {
                format!("Type a path for the {file}")
            }
            Self::OpenCheckpoint => format!("Type the path of a {file}"),
        }
    }

    /// What becomes of the file, in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Save(kind) => kind.description(),
            Self::SaveExperiment(_, file) => file.description(),
            Self::SaveTrade(file) => file.description(),
            Self::SavePicture(ShownPicture::Surfaces) => {
                "The surfaces as they are in view, with the camera and the error card, for print: on a light ground, as PNG \
                 or SVG as the name ends."
            }
            Self::SavePicture(ShownPicture::Chart) => {
                "The chart in view, for print: on a light ground, as PNG or SVG as the name ends."
            }
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
            Self::SavePicture(picture) => Action::ExportPicture(picture, path),
            Self::SaveTrade(file) => TradeAction::Save(file, path).into(),
            Self::SaveExperiment(topic, file) => ExperimentAction::Save(topic, file, path).into(),
            Self::OpenCheckpoint => Action::OpenCheckpoint(path),
        }
    }
}
