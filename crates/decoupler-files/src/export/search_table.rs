use decoupler_core::{
    dataset::SplitBy,
    evaluation::auto::{AutoRecord, Tried, TriedModel},
    text::format_percent,
};

use super::{Cell, Table, TableColumn, table::Columns};

/// Returns the candidates of a search as a table; the choice is marked.
pub fn search_table(record: &AutoRecord) -> Table {
    let network = |tried: &Tried| match tried.model {
        TriedModel::Network { begin, epochs, .. } => Some((begin, epochs)),
        _ => None,
    };
    let mut columns = Columns::<(usize, &Tried)>::new();
    columns.add(
        TableColumn::new("share_percent", "share", "%")
            .meaning("Weight in the answer: the convex combination with the lowest error of held-out answers."),
        |(_, tried)| match tried.share {
            share if share > 0.0 => Cell::from(100.0 * share),
            _ => Cell::from(""),
        },
    );
    columns.add(
        TableColumn::new("features", "inputs", "").meaning("Quantity, memory and scaling of the inputs."),
        |(_, tried)| tried.features(),
    );
    columns.add(
        TableColumn::new("model", "model", "").meaning(
            "Training mean, ridge, kernel ridge, or networks × hidden nodes and their training method; * marks the network that \
             is trained.",
        ),
        |&(place, tried)| format!("{}{}", tried.model, if place == record.chosen { "*" } else { "" }),
    );
    columns.add(
        TableColumn::new("begin", "begins at", "")
            .meaning("Weights with which the trainings begin: random, or ridge regression with random weights added."),
        |(_, tried)| network(tried).map_or(String::new(), |(begin, _)| begin.to_string()),
    );
    columns.add(
        TableColumn::new("error_percent", "error", "%").meaning(
            "Root mean square error of held-out answers in cross-validation, relative to the standard deviation of each \
             target: 100 % for always answering the mean.",
        ),
        |(_, tried)| 100.0 * tried.error,
    );
    columns.add(
        TableColumn::new("standard_error_percent", "±", "%")
            .meaning("Standard error of the error, from the differences between folds."),
        |(_, tried)| 100.0 * tried.standard_error,
    );
    columns.add(
        TableColumn::new("epochs", "epochs", "").meaning(
            "Epoch with the lowest error, at which training stops; + if the budget cut off the candidate before.",
        ),
        |(_, tried)| {
            let cut_off = if tried.is_cut_off { "+" } else { "" };
            network(tried).map_or(String::new(), |(_, epochs)| format!("{epochs}{cut_off}"))
        },
    );
    columns.add(
        TableColumn::new("seconds", "time", "s").meaning("Estimated time on one core, counted against the budget."),
        |(_, tried)| tried.seconds,
    );
    columns.table(record.tried.iter().enumerate())
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
