//! The table of an experiment: every column orders it, every row can be marked.

use eframe::egui::Ui;

use super::{ExperimentLook, Outcome, open_cell::open_cell};
use crate::window::{
    shared::{Effect, Shared},
    theme::Theme,
    widgets::{ColumnWidth, TableCell, TableClick, TableColumn, TableRow, TableView},
};
use decoupler_files::export::{ExperimentColumn, ExperimentColumnKind};

/// Lays out the table over the available space; it scrolls where it is larger.
pub fn table_ui(ui: &mut Ui, outcome: &Outcome, look: &mut ExperimentLook, shared: &Shared, effects: &mut Vec<Effect>) {
    let palette = &Theme::of(ui).palette;
    let axes = outcome.results.experiment.axes().count();
    let headings = &outcome.table.columns;
    let column = |(place, of_table): (usize, &ExperimentColumn)| {
        let texts = outcome.table.rows.iter().map(|row| row[place].as_str());
        let column = if place < axes {
            TableColumn::text(of_table.heading)
        } else {
            TableColumn::figure(of_table.heading)
        };
        column.width(ColumnWidth::of_longest(texts))
    };
    let columns: Vec<TableColumn<'_>> = headings.iter().enumerate().map(column).collect();
    let values = &outcome.table.values;
    let figure = |cell: usize, column: usize| (values[cell].get(column).copied().flatten(), "");
    let order = look.sort.order(outcome.table.rows.len(), figure);
    let row = |place: usize| {
        let number = order[place];
        let texts = &outcome.table.rows[number];
        let name = texts[..axes].join(", ");
        let loses = loses_to_linear_map(outcome, number);
        let cells = headings
            .iter()
            .zip(texts)
            .enumerate()
            .map(|(column, (of_table, text))| {
                let is_median = of_table.kind == ExperimentColumnKind::Ranking;
                let is_beaten = loses && of_table.kind == ExperimentColumnKind::Linear;
                let colour = match of_table.kind {
                    ExperimentColumnKind::Ranking => palette.accent,
                    ExperimentColumnKind::Published => palette.dim,
                    _ if is_beaten => palette.warning,
                    _ => palette.text,
                };
                let meaning = if is_beaten {
                    "The linear baseline is more accurate here than the network."
                } else {
                    ""
                };
                TableCell::new(text)
                    .colour(colour)
                    .strong(is_median || column < axes)
                    .meaning(meaning)
            });
        TableRow::new(cells)
            .labelled(format!("Cell {name}"))
            .named(name)
            .selected(look.marked == Some(number))
    };
    let table = TableView::new("experiment table", &columns)
        .sorted(look.sort)
        .clickable();
    match table.show(ui, order.len(), row) {
        Some(TableClick::Sort(sort)) => look.sort = sort,
        Some(TableClick::Select(place)) => look.marked = Some(order[place]),
        Some(TableClick::Open(place)) => {
            look.marked = Some(order[place]);
            open_cell(shared, outcome, order[place], effects);
        }
        Some(TableClick::Point(_)) | None => {}
    }
}

fn loses_to_linear_map(outcome: &Outcome, cell: usize) -> bool {
    let summary = &outcome.summaries[cell];
    let both = summary.percent.median.zip(summary.linear_percent);
    both.is_some_and(|(network, linear)| network > linear)
}
