use super::editor::RecordingEditor;
use crate::{
    app::shared::{Contents, Effect, Export, ExportGroup, FileTask, FileWords, Shared, SourceKind},
    export::RecipeFile,
};

const RECIPE: FileWords = FileWords {
    kind: "recipe",
    description: "The files, the meaning of their columns, and the division of the samples, as JSON: it repeats this import \
                  here and in a terminal (train --recipe FILE).",
    extensions: &["json"],
};

impl RecordingEditor {
    /// Returns the exports of the import: its recipe, if the source is a recording.
    pub fn exports(&self, shared: &Shared) -> Option<Export<'static>> {
        if shared.source != SourceKind::Recording {
            return None;
        }
        let ask = shared
            .recording
            .plan
            .clone()
            .map(|plan| -> crate::app::shared::Ask<'static> {
                Box::new(move || {
                    let stem = plan.import.data.file_stem().unwrap_or_default().to_string_lossy();
                    let stem = format!("{stem}-recipe");
                    let contents = Contents::new(move |path| RecipeFile::save(&*plan, path));
                    Effect::ChooseFile(FileTask::save(RECIPE, &stem, contents))
                })
            });
        Some(Export {
            group: ExportGroup::Training,
            name: "Recipe of the import".to_owned(),
            form: "JSON".to_owned(),
            description: RECIPE.description,
            ask,
        })
    }
}
