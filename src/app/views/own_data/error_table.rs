use eframe::egui::{RichText, Ui};

use crate::{
    app::{
        theme::{Theme, semibold, space, type_size},
        widgets::{Column, Row, TableWidths, captioned_table_ui},
    },
    evaluation::Channel,
    evaluation::TargetErrors,
    export::format_number,
};

const COLUMNS: [Column; 5] = [
    Column {
        heading: "RMSE",
        meaning: "Root mean squared error, in the unit of the target",
    },
    Column {
        heading: "MAE",
        meaning: "Mean absolute error, in the unit of the target",
    },
    Column {
        heading: "R²",
        meaning: "Share of the target's variance that the answers explain: 1 is exact, 0 is no better than the mean",
    },
    Column {
        heading: "worst",
        meaning: "Largest absolute error, in the unit of the target",
    },
    Column {
        heading: "% of range",
        meaning: "Mean absolute error in percent of the range of the target",
    },
];

/// Errors of each target, a table for each with a row for each of `rows`; the last is the strong one.
pub(super) fn error_tables_ui(ui: &mut Ui, targets: &[Channel], rows: &[(&'static str, &[TargetErrors])]) {
    let palette = Theme::of(ui).palette;
    let lines = |index: usize| -> Vec<Row> {
        let lines = rows.iter().enumerate().filter_map(|(number, (name, errors))| {
            let is_network = number + 1 == rows.len();
            Some(Row {
                mark: "",
                name,
                meaning: meaning(name),
                cells: cells(errors.get(index)?),
                colour: if is_network { palette.accent } else { palette.text },
                is_strong: is_network,
            })
        });
        lines.collect()
    };
    let tables = Vec::from_iter((0..targets.len()).map(lines));
    let widths = TableWidths::fitting(ui, &COLUMNS, &Vec::from_iter(tables.iter().flatten()));
    for (target, lines) in targets.iter().zip(&tables) {
        ui.add_space(space(1));
        ui.label(RichText::new(target.title()).font(semibold(type_size().body)));
        ui.scope(|ui| captioned_table_ui(ui, &target.title(), &COLUMNS, lines, &widths));
        ui.add_space(space(2));
    }
}

fn cells(errors: &TargetErrors) -> Vec<String> {
    let decimals = |value: Option<f64>| match value {
        Some(r2) if r2.abs() < 5e-5 => "0.0000".to_owned(),
        Some(r2) if r2 > -1e4 => format!("{r2:.4}").replace('-', "−"),
        other => format_number(other),
    };
    vec![
        format_number(errors.rmse),
        format_number(errors.mae),
        decimals(errors.r2),
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
