//! Exports of the import and of the network on show.

use std::sync::Arc;

use super::{
    charts::ChartTab,
    judging::{channel_table, decoders_table, shown_curve_figure, shown_decoders_figure},
    model::Trained,
    state::{OwnDataView, Tab},
    surfaces::shown_surfaces,
};
use crate::{
    app::shared::{
        Ask, Contents, Effect, Export, ExportGroup, FileTask, FileWords, Look, Phase, copy_exports, csv_export,
        error_table_export, loss_export, own_network_exports, picture_exports,
    },
    export::{Cell, RecipeFile, Table, TableColumn},
    figure::Figure,
};

pub(super) const CHECKPOINT: FileWords = FileWords {
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

const CHANNELS: FileWords = FileWords {
    kind: "channel table",
    description: "How much the error of each target grows without each channel, with every digit, as CSV.",
    extensions: &["csv"],
};

const DECODERS: FileWords = FileWords {
    kind: "decoder table",
    description: "Errors and times of the decoders with every digit, as CSV.",
    extensions: &["csv"],
};

/// Everything that can be exported.
pub(super) fn own_data_exports(view: &OwnDataView, look: Look) -> Vec<Export<'_>> {
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
    let file = shown.clone().map(|shown| Arc::clone(&shown.file));
    let mut exports = own_network_exports(&view.stem(), &file);
    let (chart, word) = shown_chart(view, look);
    let chart = chart.map(|figure| move || figure.clone());
    exports.extend(picture_exports("Chart", stem(word), chart));
    let errors = shown.clone().map(|shown| move || error_table(shown));
    exports.push(error_table_export(stem("errors"), errors.clone()));
    let history = shown.clone().map(|shown| shown.file.training.history.as_slice());
    exports.push(loss_export(stem("loss"), history));
    exports.extend(copy_exports("Error table", errors));
    let told = view.measuring.told.as_deref();
    let told = told.ok_or_else(|| "Nothing is measured yet: see the card “Findings”.".to_owned());
    let channels = told.map(|told| move || channel_table(told));
    exports.push(csv_export(
        "Channel table",
        CHANNELS,
        stem("channels"),
        channels.clone(),
    ));
    exports.extend(copy_exports("Channel table", channels));
    let decoders = view.measuring.decoders.as_deref();
    let decoders = decoders.ok_or_else(|| "No decoder is measured yet: see the card “Decoders”.".to_owned());
    let decoders = decoders.map(|decoders| move || decoders_table(decoders));
    exports.push(csv_export(
        "Decoder table",
        DECODERS,
        stem("decoders"),
        decoders.clone(),
    ));
    exports.extend(copy_exports("Decoder table", decoders));
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
        Some(draft) => draft.planned(),
    };
    let recipe = plan.map(|plan| {
        save(
            RECIPE,
            stem("recipe"),
            Contents::new(move |path| RecipeFile::save(&plan.plan, path)),
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

/// The chart in the card on show, and the word for it in names of files.
fn shown_chart(view: &OwnDataView, look: Look) -> (Result<Figure, String>, &'static str) {
    let (figure, word) = match (view.tab, &view.shown) {
        (Tab::Findings, _) => (shown_curve_figure(&view.measuring).map(Figure::from), "learning-curve"),
        (Tab::Decoders, _) => (shown_decoders_figure(&view.measuring).map(Figure::from), "decoders"),
        (_, Some(_)) if view.chart.tab == ChartTab::Surfaces => (
            shown_surfaces(view, look).map(Figure::Surfaces),
            view.chart.tab.file_word(),
        ),
        (_, Some(shown)) => (
            view.chart.chart(shown, &view.curves).into_figure(),
            view.chart.tab.file_word(),
        ),
        (_, None) => (None, "chart"),
    };
    (figure.ok_or_else(|| "This chart has nothing to show.".to_owned()), word)
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
