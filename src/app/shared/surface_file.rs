use std::path::Path;

use eframe::egui::Ui;

use super::{Effect, FileTask, FileWords};
use crate::{
    app::widgets::{ghost_button, section_heading_ui},
    export::figures::{PictureError, PictureFormat, draw_surfaces},
    figure::surface::SurfaceFigure,
};

/// The picture of the surfaces in view.
pub const SURFACES: FileWords = FileWords {
    name: "Surfaces, PNG or SVG…",
    kind: "picture of the surfaces",
    description: "The surfaces as they are in view, with the camera and the error card, for print: on a light ground, as PNG \
                  or SVG as the name ends.",
    extensions: &["png", "svg"],
};

impl FileTask {
    /// Draws surfaces as they are in view.
    pub fn surfaces(figure: SurfaceFigure, suggestion: String) -> Self {
        let write = move |path: &Path| -> Result<(), PictureError> {
            let format = PictureFormat::of_path(path)?;
            draw_surfaces(&figure).save(format, path)
        };
        Self::save(SURFACES, suggestion, write)
    }
}

/// The button that saves the surfaces in view.
pub fn export_surfaces_ui(ui: &mut Ui, figure: SurfaceFigure, suggestion: &str, effects: &mut Vec<Effect>) {
    section_heading_ui(ui, "Export");
    let button = ui.add_enabled(!figure.surfaces.is_empty(), ghost_button(SURFACES.name));
    if button.on_hover_text(SURFACES.description).clicked() {
        effects.push(Effect::ChooseFile(FileTask::surfaces(figure, suggestion.to_owned())));
    }
}
