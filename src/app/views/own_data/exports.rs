//! What the import and the network on show can be taken away as.

use std::sync::Arc;

use super::{model::Trained, state::OwnDataView};
use crate::{
    app::shared::{
        Ask, Contents, Effect, Export, ExportGroup, FileTask, FileWords, Phase, copy_exports, error_table_export,
        loss_export, picture_exports,
    },
    export::{Cell, RecipeFile, Table, TableColumn},
    figure::Figure,
};

const NETWORK: FileWords = FileWords {
    kind: "network",
    description: "The network with its settings, record and errors, and the recipe of its import. It opens here again, and \
                  the terminal command decode decodes files with it.",
    extensions: &["json"],
};

const CHECKPOINT: FileWords = FileWords {
    kind: "checkpoint",
    description: "The training as it stands, paused or ended, without the samples. Opened here or in a terminal (train \
                  --checkpoint FILE --resume), it gives bit-identical results.",
    extensions: &["checkpoint"],
};

const RECIPE: FileWords = FileWords {
    kind: "recipe",
    description: "The files, what their columns mean, and the split, as JSON: it repeats this import here and in a \
                  terminal (train --recipe FILE).",
    extensions: &["json"],
};

/// Everything that can be exported.
pub(super) fn own_data_exports(view: &OwnDataView) -> Vec<Export<'_>> {
    let nothing = || "Nothing is trained yet: press Train first.".to_owned();
    let shown = view.shown.as_ref().ok_or_else(nothing);
    let stem = |what: &str| format!("{}-{what}", view.stem());
    let one = |group, name: &str, words: FileWords, form: &str, ask| Export {
        group,
        name: name.to_owned(),
        form: form.to_owned(),
        description: words.description,
        ask,
    };
    let network = shown.clone().map(|shown| {
        let file = Arc::clone(&shown.file);
        save(NETWORK, stem("network"), Contents::new(move |path| file.save(path)))
    });
    let mut exports = vec![one(ExportGroup::Network, "Network", NETWORK, "JSON", network)];
    let chart = shown.clone().and_then(|shown| {
        let figure: Option<Figure> = view.chart.chart(shown).into_figure();
        let figure = figure.ok_or_else(|| "This chart has nothing to show.".to_owned())?;
        Ok(move || figure.clone())
    });
    exports.extend(picture_exports("Chart", stem(view.chart.tab.file_word()), chart));
    let errors = shown.clone().map(|shown| move || error_table(shown));
    exports.push(error_table_export(stem("errors"), errors.clone()));
    let history = shown.clone().map(|shown| shown.file.training.history.as_slice());
    exports.push(loss_export(stem("loss"), history));
    exports.extend(copy_exports("Error table", errors));
    let checkpoint = shown.and_then(|shown| match (&shown.checkpoint, view.phase) {
        (Some(file), _) => {
            let file = Arc::clone(file);
            Ok(save(
                CHECKPOINT,
                stem("training"),
                Contents::new(move |path| file.save(path)),
            ))
        }
        (None, Phase::Training) => Err("A training under way cannot be saved: pause it first.".to_owned()),
        (None, _) => Err("This network was opened from a file, which has no training to go on from.".to_owned()),
    });
    exports.push(one(
        ExportGroup::Training,
        "Checkpoint",
        CHECKPOINT,
        "resumable",
        checkpoint,
    ));
    let plan = match &view.draft {
        None => Err("No recording is open.".to_owned()),
        Some(draft) => draft.plan(),
    };
    let recipe = plan.map(|plan| {
        save(
            RECIPE,
            stem("recipe"),
            Contents::new(move |path| RecipeFile::save(&plan, path)),
        )
    });
    exports.push(one(
        ExportGroup::Training,
        "Recipe of the import",
        RECIPE,
        "JSON",
        recipe,
    ));
    exports
}

fn save<'a>(words: FileWords, stem: String, contents: Contents) -> Ask<'a> {
    Box::new(move || Effect::ChooseFile(FileTask::save(words, &stem, contents)))
}

/// Errors of each target by the mean, ridge and the network.
fn error_table(shown: &Trained) -> Table {
    let columns = [
        ("rmse", "RMSE", ""),
        ("mae", "MAE", ""),
        ("r2", "R²", ""),
        ("worst", "worst", ""),
        ("percent_of_range", "MAE", "% of range"),
    ];
    let columns = columns.map(|(field, heading, unit)| TableColumn::new(field, heading, unit));
    let names = [("target", "Target"), ("unit", "Unit"), ("decoder", "Decoder")];
    let names = names.map(|(field, heading)| TableColumn::new(field, heading, ""));
    let mut rows = Vec::new();
    for (index, target) in shown.file.targets.iter().enumerate() {
        for (name, errors) in shown.rows() {
            let Some(errors) = errors.get(index) else { continue };
            let unit = target.unit.clone().unwrap_or_default();
            let mut cells = vec![
                Cell::Text(target.name.clone()),
                Cell::Text(unit),
                Cell::Text(name.to_owned()),
            ];
            let figures = [
                Some(errors.rmse),
                Some(errors.mae),
                errors.r2,
                Some(errors.worst),
                errors.percent_of_range,
            ];
            cells.extend(figures.map(Cell::Number));
            rows.push(cells);
        }
    }
    Table {
        columns: names.into_iter().chain(columns).collect(),
        rows,
    }
}
