use decoupler_core::{
    dataset::SplitBy,
    evaluation::auto::{AutoRecord, Tried},
};

use super::{Cell, Table, TableColumn};

/// Returns the candidates of a search as a table; the choice is marked.
pub fn search_table(record: &AutoRecord) -> Table {
    let columns = [
        TableColumn::new("chosen", "", ""),
        TableColumn::new("features", "inputs", "").meaning("Quantity, memory and scaling of the inputs."),
        TableColumn::new("model", "model", "")
            .meaning("Ridge regression, or networks × hidden nodes of a committee and their training method."),
        TableColumn::new("begin", "begins at", "")
            .meaning("Weights with which the trainings begin: random, or ridge regression with random weights added."),
        TableColumn::new("error_percent", "error", "%").meaning(
            "Root mean square error of held-out answers in cross-validation, relative to the standard deviation of each \
             target: 100 % for always answering the mean.",
        ),
        TableColumn::new("standard_error_percent", "±", "%")
            .meaning("Standard error of the error, from the differences between folds."),
        TableColumn::new("epochs", "epochs", "").meaning("Epoch with the lowest error, at which training stops."),
        TableColumn::new("seconds", "time", "s").meaning("Estimated time on one core, counted against the budget."),
    ];
    let row = |(place, tried): (usize, &Tried)| -> Vec<Cell> {
        vec![
            if place == record.chosen { "*".into() } else { "".into() },
            tried.features().into(),
            tried.model.to_string().into(),
            tried
                .training()
                .map_or_else(|| "".into(), |(begin, _)| begin.to_string().into()),
            (100.0 * tried.error).into(),
            (100.0 * tried.standard_error).into(),
            tried
                .training()
                .map_or_else(|| "".into(), |(_, epochs)| Cell::from(epochs)),
            tried.seconds.into(),
        ]
    };
    Table {
        columns: columns.to_vec(),
        rows: record.tried.iter().enumerate().map(row).collect(),
    }
}

/// Describes how the settings were chosen, in one sentence.
pub fn describe_search(record: &AutoRecord) -> String {
    format!(
        "Settings chosen from {} candidates by cross-validation on {} of the training samples, {:.0} s of one core within a \
         budget of {} s (*: the choice)",
        record.tried.len(),
        match record.by {
            SplitBy::Time => format!("{} blocks of time", record.folds),
            SplitBy::Group => format!("{} sets of groups", record.folds),
            SplitBy::Random => format!("{} random parts", record.folds),
        },
        record.seconds(),
        record.budget_s
    )
}
