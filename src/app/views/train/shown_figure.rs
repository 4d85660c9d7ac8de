//! The pictures in view, as files.

use super::{chart::chart_figure, export_kind::file_name, state::TrainView, surfaces::surface_figure};
use crate::{
    app::shared::{CHART, FileTask, FileWords, SURFACES, Shared},
    figure::surface::ViewMode,
};

/// Which of the pictures in view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownPicture {
    /// The surfaces of the snapshot.
    Surfaces,
    /// The chart below them.
    Chart,
}

impl ShownPicture {
    /// What the file is called.
    pub fn words(self) -> FileWords {
        match self {
            Self::Surfaces => SURFACES,
            Self::Chart => CHART,
        }
    }

    /// The picture as it is in view; `None` before a training.
    pub fn task(self, view: &TrainView, shared: &Shared) -> Option<FileTask> {
        let run = shared.shown_run().filter(|run| run.result.is_some())?;
        let words = self.words();
        let name = |what: &str| file_name(what, words, &run.settings);
        Some(match self {
            Self::Surfaces => {
                let what = match shared.look.mode {
                    ViewMode::ThreeD => "surfaces",
                    ViewMode::Top => "surfaces-top",
                };
                FileTask::picture(words, name(what), surface_figure(view, shared))
            }
            Self::Chart => FileTask::picture(words, name(view.tab.file_word()), chart_figure(view, shared)?),
        })
    }
}
