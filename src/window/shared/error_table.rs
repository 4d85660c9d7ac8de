//! The one place that lays out error tables.

use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{ErrorMeasure, ErrorRow, ErrorTable},
    problem::Channel,
};
use decoupler_files::export::{format_number, format_r2};
use eframe::egui::Ui;

use crate::window::{
    glossary::{self, Term},
    theme::Theme,
    widgets::{TableCell, TableColumn, TableRow, TableView, dim_ui},
};

/// Meaning of the mark at a baseline.
const BETTER: &str = "Better than what is used.";

fn column(measure: ErrorMeasure) -> TableColumn<'static> {
    let of_term = |term: Term| TableColumn::figure(term.name).meaning(term.hint);
    match measure {
        ErrorMeasure::ZPercent => of_term(glossary::Z_PERCENT),
        ErrorMeasure::XPercent => of_term(glossary::X_PERCENT),
        ErrorMeasure::YPercent => of_term(glossary::Y_PERCENT),
        ErrorMeasure::ZMm => of_term(glossary::Z_MM),
        ErrorMeasure::ZStrokePercent => of_term(glossary::STROKE_PERCENT),
        ErrorMeasure::RangePercent => TableColumn::figure("% of range").meaning(measure.definition()),
        measure => TableColumn::figure(measure.heading().0).meaning(measure.definition()),
    }
}

/// Lays out an error table: rows of baselines, network, model-based and published figures, for recordings target by target.
pub fn error_table_ui(ui: &mut Ui, tables: &[ErrorTable]) {
    let Some(ErrorTable { measures, .. }) = tables.first() else {
        return;
    };
    let palette = Theme::of(ui).palette;
    // Coordinates that do not vary have errors of rounding only.
    let is_constant = |place: usize| {
        let mut errors = tables
            .iter()
            .flat_map(|table| &table.rows)
            .filter_map(|row| row.errors[place]);
        errors.all(|percent| percent < 1e-3)
    };
    let is_shown = |place: &usize| match measures[*place] {
        // The worst node is shown below the table.
        ErrorMeasure::WorstMm | ErrorMeasure::HalfWidth | ErrorMeasure::CoveragePercent => false,
        ErrorMeasure::XPercent | ErrorMeasure::YPercent => !is_constant(*place),
        _ => true,
    };
    let shown = Vec::from_iter((0..measures.len()).filter(is_shown));
    let mut columns = vec![TableColumn::text("")];
    columns.extend(shown.iter().map(|&place| column(measures[place])));
    // The error that decides whether a baseline is better.
    let is_judged = |measure: &ErrorMeasure| matches!(measure, ErrorMeasure::ZMm | ErrorMeasure::Rmse);
    let judged = measures.iter().position(is_judged);
    let judged = |row: &ErrorRow| row.errors.get(judged?).copied().flatten();
    let mut rows = Vec::new();
    for table in tables {
        let used = table.used();
        let of_used = table.rows.iter().find(|row| row.name == used).and_then(judged);
        rows.extend(table.target.as_ref().map(|target| TableRow::section(target.title())));
        for row in &table.rows {
            let name = match &table.target {
                Some(target) => format!("{}, {}", target.title(), row.name),
                None => row.name.to_owned(),
            };
            let figures = shown.iter().map(|&place| match measures[place] {
                ErrorMeasure::R2 => format_r2(row.errors[place]),
                _ => format_number(row.errors[place]),
            });
            let colour = match row.name {
                name if name == used => palette.accent,
                "published" | "model-based" => palette.dim,
                _ => palette.text,
            };
            let is_baseline = ["training mean", "linear map", "ridge"].contains(&row.name);
            let is_better = is_baseline && judged(row).zip(of_used).is_some_and(|(error, used)| error < used);
            let row = TableRow::figures(row.name, figures)
                .named(name)
                .meaning(row_meaning(row.name))
                .colour(colour)
                .strong(row.name == used);
            rows.push(row.mark(if is_better { BETTER } else { "" }));
        }
    }
    TableView::new("errors", &columns).show_all(ui, rows);
}

/// A line for each target of a recording: the error of what is used next to those of ridge regression and of the mean, R², and
/// the interval.
pub fn targets_table_ui(ui: &mut Ui, tables: &[ErrorTable]) {
    let Some(first) = tables.first() else { return };
    let (used, palette) = (first.used(), Theme::of(ui).palette);
    let all = [
        (used, used, ErrorMeasure::Rmse),
        ("ridge", "ridge", ErrorMeasure::Rmse),
        ("mean", "training mean", ErrorMeasure::Rmse),
        ("R²", used, ErrorMeasure::R2),
        ("90 % ±", used, ErrorMeasure::HalfWidth),
        ("holds %", used, ErrorMeasure::CoveragePercent),
    ];
    let place = |measure| first.measures.iter().position(|found| *found == measure);
    let shown = Vec::from_iter(
        all.into_iter()
            .filter_map(|(name, row, of)| Some((name, row, of, place(of)?))),
    );
    let mut columns = vec![TableColumn::text("")];
    columns.extend(shown.iter().map(|&(name, row, measure, _)| {
        let meaning = if measure == ErrorMeasure::Rmse {
            row_meaning(row)
        } else {
            measure.definition()
        };
        TableColumn::figure(name).meaning(meaning)
    }));
    let rows = tables.iter().map(|table| {
        let title = table.target.as_ref().map_or_else(String::new, Channel::title);
        let cells = shown.iter().map(|&(name, row, measure, place)| {
            let row = table.rows.iter().find(|found| found.name == row);
            let value = row.and_then(|row| row.errors.get(place).copied().flatten());
            let text = if measure == ErrorMeasure::R2 {
                format_r2(value)
            } else {
                format_number(value)
            };
            let is_used = name == used;
            let cell = TableCell::new(text).strong(is_used);
            if is_used { cell.colour(palette.accent) } else { cell }
        });
        TableRow::new([TableCell::new(title.clone()).strong(true)].into_iter().chain(cells)).named(title)
    });
    TableView::new("targets", &columns).show_all(ui, rows.collect());
    dim_ui(ui, "RMSE on the test samples: smaller is better.");
}

/// Definition of a row of the error table.
fn row_meaning(name: &str) -> &'static str {
    match name {
        "training mean" => DecoderKind::Mean.meaning(),
        "linear map" => glossary::LINEAR_MAP.hint,
        "ridge" => DecoderKind::Ridge.meaning(),
        "chosen" => {
            "The combination with the lowest error in cross-validation on the training samples: what decoding, Live and exports use"
        }
        "network" => {
            "The network with the lowest validation error so far; with the lowest training error if nothing is held out"
        }
        "model-based" => glossary::MODEL_BASED.hint,
        "published" => glossary::PUBLISHED.hint,
        _ => "",
    }
}
