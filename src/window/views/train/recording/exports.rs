use crate::window::shared::{Ask, Contents, Effect, Export, ExportGroup, FileTask, FileWords, Shared, file_stem};
use decoupler_files::export::RecipeFile;

const RECIPE: FileWords = FileWords {
    kind: "recipe",
    description: "The source of the samples as JSON: the array and its scene, or the files of a recording, the meaning of \
                  their columns and the division of the samples. It opens here and in a terminal (train --recipe FILE).",
    extensions: &["json"],
};

/// Returns the export of the recipe of the source.
pub fn recipe_export(shared: &Shared) -> Export<'static> {
    let ask = shared.setup().map(|setup| -> Ask<'static> {
        Box::new(move || {
            let stem = file_stem("recipe", &setup);
            let contents = Contents::new(move |path| RecipeFile::save(&setup, path));
            Effect::ChooseFile(FileTask::save(RECIPE, &stem, contents))
        })
    });
    Export {
        group: ExportGroup::Training,
        name: "Recipe".to_owned(),
        form: "JSON".to_owned(),
        description: RECIPE.description,
        ask,
    }
}
