use eframe::egui::Ui;

use crate::{
    app::{
        theme::Theme,
        widgets::{TableColumn, TableRow, TableView},
    },
    evaluation::TargetErrors,
    export::{format_number, format_r2},
    import::Channel,
};

const COLUMNS: [TableColumn<'_>; 6] = [
    TableColumn::text(""),
    TableColumn::figure("RMSE").meaning("Root mean squared error, in the unit of the target"),
    TableColumn::figure("MAE").meaning("Mean absolute error, in the unit of the target"),
    TableColumn::figure("R²")
        .meaning("Share of the target's variance that the answers explain: 1 is exact, 0 is no better than the mean"),
    TableColumn::figure("worst").meaning("Largest absolute error, in the unit of the target"),
    TableColumn::figure("% of range").meaning("Mean absolute error in percent of the range of the target"),
];

/// Errors of each target, with a row for each of `rows`; the last is the strong one.
pub(super) fn error_tables_ui(ui: &mut Ui, targets: &[Channel], rows: &[(&'static str, &[TargetErrors])]) {
    let palette = Theme::of(ui).palette;
    let of_target = |(index, target): (usize, &Channel)| {
        let title = target.title();
        let lines = rows.iter().enumerate().filter_map(|(number, (name, errors))| {
            let is_network = number + 1 == rows.len();
            let colour = if is_network { palette.accent } else { palette.text };
            let row = TableRow::figures(*name, cells(errors.get(index)?));
            let row = row.named(format!("{title}, {name}")).meaning(meaning(name));
            Some(row.colour(colour).strong(is_network))
        });
        std::iter::once(TableRow::section(&title)).chain(lines.collect::<Vec<_>>())
    };
    let lines = targets
        .iter()
        .enumerate()
        .flat_map(|(index, target)| of_target((index, target)).collect::<Vec<_>>());
    TableView::new("errors", &COLUMNS).show_all(ui, lines.collect());
}

fn cells(errors: &TargetErrors) -> Vec<String> {
    vec![
        format_number(errors.rmse),
        format_number(errors.mae),
        format_r2(errors.r2),
        format_number(errors.worst),
        format_number(errors.percent_of_range),
    ]
}

fn meaning(name: &str) -> &'static str {
    match name {
        "training mean" => "Always answers the mean of the training samples.",
        "ridge" => "Best affine map from the readings to the targets, with a little regularisation.",
        "network" => {
            "The network with the lowest validation error so far. If nothing is held out: with the lowest training error, or \
             the latest of Bayesian regularisation."
        }
        _ => "",
    }
}
