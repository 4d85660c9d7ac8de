use std::path::Path;

use eframe::egui::Ui;

use super::{Effect, FileTask, FileWords};
use crate::{
    app::widgets::{ghost_button, section_heading_ui},
    export::figures::{PictureError, PictureFormat},
    figure::Figure,
};

/// The picture of the surfaces in view.
pub const SURFACES: FileWords = FileWords {
    name: "Surfaces, PNG or SVG…",
    kind: "picture of the surfaces",
    description: "The surfaces as they are in view, with the camera and the error card, for print: on a light ground, as PNG \
                  or SVG as the name ends.",
    extensions: &["png", "svg"],
};

/// The picture of the chart in view.
pub const CHART: FileWords = FileWords {
    name: "Chart, PNG or SVG…",
    kind: "picture of the chart",
    description: "The chart in view, for print: on a light ground, as PNG or SVG as the name ends.",
    extensions: &["png", "svg"],
};

impl FileTask {
    /// A picture as it is in view.
    pub fn picture(words: FileWords, suggestion: String, figure: impl Into<Figure>) -> Self {
        let figure = figure.into();
        let write = move |path: &Path| -> Result<(), PictureError> {
            let format = PictureFormat::of_path(path)?;
            figure.draw().save(format, path)
        };
        Self::save(words, suggestion, write)
    }
}

/// The buttons that save the surfaces and the chart in view, each with the name of its file.
pub fn export_pictures_ui(
    ui: &mut Ui,
    surfaces: (Option<Figure>, &str),
    chart: (Option<Figure>, &str),
    effects: &mut Vec<Effect>,
) {
    section_heading_ui(ui, "Export");
    for (words, (figure, suggestion)) in [(SURFACES, surfaces), (CHART, chart)] {
        let button = ui.add_enabled(figure.is_some(), ghost_button(words.name));
        if let (true, Some(figure)) = (button.on_hover_text(words.description).clicked(), figure) {
            effects.push(Effect::ChooseFile(FileTask::picture(
                words,
                suggestion.to_owned(),
                figure,
            )));
        }
    }
}
