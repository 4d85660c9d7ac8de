use decoupler_core::{
    dataset::SplitBy,
    evaluation::auto::{AutoRecord, Tried, TriedModel},
    text::format_percent,
};

use super::{Cell, Table, TableColumn};

/// Returns the candidates of a search as a table; the choice is marked.
pub fn search_table(record: &AutoRecord) -> Table {
    let columns = [
        TableColumn::new("share_percent", "share", "%")
            .meaning("Weight in the answer: the convex combination with the lowest error of held-out answers."),
        TableColumn::new("features", "inputs", "").meaning("Quantity, memory and scaling of the inputs."),
        TableColumn::new("model", "model", "").meaning(
            "Training mean, ridge, kernel ridge, or networks × hidden nodes and their training method; * marks the network that \
             is trained.",
        ),
        TableColumn::new("begin", "begins at", "")
            .meaning("Weights with which the trainings begin: random, or ridge regression with random weights added."),
        TableColumn::new("error_percent", "error", "%").meaning(
            "Root mean square error of held-out answers in cross-validation, relative to the standard deviation of each \
             target: 100 % for always answering the mean.",
        ),
        TableColumn::new("standard_error_percent", "±", "%")
            .meaning("Standard error of the error, from the differences between folds."),
        TableColumn::new("epochs", "epochs", "").meaning("Epoch with the lowest error, at which training stops; + if the budget cut off the candidate before."),
        TableColumn::new("seconds", "time", "s").meaning("Estimated time on one core, counted against the budget."),
    ];
    let row = |(place, tried): (usize, &Tried)| -> Vec<Cell> {
        let cut_off = if tried.is_cut_off { "+" } else { "" };
        let (begin, epochs) = match tried.model {
            TriedModel::Network { begin, epochs, .. } => {
                (Cell::from(begin.to_string()), Cell::from(format!("{epochs}{cut_off}")))
            }
            _ => (Cell::from(""), Cell::from("")),
        };
        let share = if tried.share > 0.0 {
            (100.0 * tried.share).into()
        } else {
            Cell::from("")
        };
        let mark = if place == record.chosen { "*" } else { "" };
        vec![
            share,
            tried.features().into(),
            format!("{}{mark}", tried.model).into(),
            begin,
            (100.0 * tried.error).into(),
            (100.0 * tried.standard_error).into(),
            epochs,
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
        "Answer chosen from {} candidates by cross-validation on {} of the training samples{}; {:.0} s of one core and {:.0} s of \
         training within a budget of {} s (*: the network that is trained)",
        record.tried.len(),
        match record.by {
            SplitBy::Time => format!("{} blocks of time", record.folds),
            SplitBy::Group => format!("{} sets of groups", record.folds),
            SplitBy::Random => format!("{} random parts", record.folds),
        },
        record.combined.map_or(String::new(), |error| format!(
            ", error of the combination {}",
            format_percent(100.0 * error)
        )),
        record.seconds(),
        record.training_s,
        record.budget_s
    )
}
