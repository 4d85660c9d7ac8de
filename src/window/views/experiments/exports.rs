//! Exports of an experiment.

use std::sync::Arc;

use super::ExperimentsView;
use crate::window::shared::{
    Ask, Contents, Effect, Export, ExportGroup, FileTask, FileWords, copy_exports, csv_export, picture_exports,
};
use decoupler_core::evaluation::experiments::verdicts;
use decoupler_files::{
    export::{atomic_write, cells_table, describe_conditions, trials_table, write_experiment_markdown},
    figure::{Figure, SequentialMap},
};

const CELLS: FileWords = FileWords {
    kind: "table",
    description: "The values of every cell with every digit, as CSV.",
    extensions: &["csv"],
};

const TRIALS: FileWords = FileWords {
    kind: "trials",
    description: "Every trial with its seed and errors, as CSV.",
    extensions: &["csv"],
};

const MARKDOWN: FileWords = FileWords {
    kind: "table and verdicts",
    description: "The table as shown, the settings behind it and the verdicts, as Markdown.",
    extensions: &["md"],
};

/// The figure, the tables, and the verdicts of the current experiment.
pub(super) fn experiment_exports(view: &ExperimentsView, colours: SequentialMap) -> Vec<Export<'_>> {
    let topic = view.topic;
    let stem = topic.name().to_lowercase().replace(' ', "_");
    let outcome = view.outcome().filter(|outcome| outcome.trials().0 > 0);
    let outcome = outcome.ok_or_else(|| "No trial has finished yet: press Run first.".to_owned());
    let figure = outcome.clone().map(|outcome| {
        move || match outcome.figure.clone() {
            Figure::HeatMap(map) => map.coloured(colours).into(),
            figure => figure,
        }
    });
    let mut exports: Vec<Export<'_>> = picture_exports("Figure", stem.clone(), figure).collect();
    let cells = outcome.clone().map(|outcome| || cells_table(&outcome.results));
    exports.push(csv_export("Table", CELLS, stem.clone(), cells));
    let trials = outcome.clone().map(|outcome| || trials_table(&outcome.results));
    exports.push(csv_export("Every trial", TRIALS, format!("{stem}_trials"), trials));
    exports.push(Export {
        group: ExportGroup::Tables,
        name: "Table and verdicts".to_owned(),
        form: "Markdown".to_owned(),
        description: MARKDOWN.description,
        ask: outcome.clone().map(|outcome| -> Ask<'_> {
            Box::new(move || {
                let results = Arc::clone(&outcome.results);
                let contents = Contents::new(move |path| {
                    let (conditions, verdicts) = (describe_conditions(&results.experiment), verdicts(&results));
                    atomic_write(path, |writer| {
                        write_experiment_markdown(&topic.heading(), &conditions, &results, &verdicts, writer)
                    })
                });
                Effect::ChooseFile(FileTask::save(MARKDOWN, &stem, contents))
            })
        }),
    });
    exports.extend(copy_exports("Table", outcome.map(|outcome| || outcome.table.table())));
    exports
}
