//! The one place that lays out error tables.

use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{ErrorMeasure, ErrorRow, ErrorTable},
};
use decoupler_files::export::{format_number, format_r2};
use eframe::egui::Ui;

use crate::window::{
    glossary::{self, Term},
    theme::{Theme, space},
    widgets::{TableCell, TableColumn, TableRow, TableView},
};

/// Measures of intervals, which have a table of their own.
const OF_INTERVALS: [ErrorMeasure; 2] = [ErrorMeasure::HalfWidth, ErrorMeasure::CoveragePercent];

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

/// Lays out an error table: rows of baselines, network, model-based and published figures, for recordings target by target;
/// below, the intervals of the network, if they were calibrated.
pub fn error_table_ui(ui: &mut Ui, tables: &[ErrorTable]) {
    let Some(ErrorTable { measures, .. }) = tables.first() else {
        return;
    };
    let palette = Theme::of(ui).palette;
    // The worst node is shown below the table.
    let is_shown = |measure: ErrorMeasure| measure != ErrorMeasure::WorstMm && !OF_INTERVALS.contains(&measure);
    let shown = Vec::from_iter((0..measures.len()).filter(|&place| is_shown(measures[place])));
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
    intervals_ui(ui, measures, tables);
}

/// The half-width of the interval of each target, and its coverage on the test set.
fn intervals_ui(ui: &mut Ui, measures: &[ErrorMeasure], tables: &[ErrorTable]) {
    let places = OF_INTERVALS.map(|measure| measures.iter().position(|found| *found == measure));
    let [Some(half_width), Some(coverage)] = places else {
        return;
    };
    let row = |table: &ErrorTable| {
        let network = table.rows.iter().find(|row| row.name == table.used())?;
        let figures = [half_width, coverage].map(|place| network.errors.get(place).copied().flatten());
        let title = table.target.as_ref()?.title();
        let cells = [title.clone()].into_iter().chain(figures.map(format_number));
        figures
            .iter()
            .any(Option::is_some)
            .then(|| TableRow::new(cells.map(TableCell::new)).named(title))
    };
    let columns = [
        TableColumn::text("90 % interval"),
        TableColumn::figure("half-width ±").meaning(ErrorMeasure::HalfWidth.definition()),
        TableColumn::figure("coverage, %").meaning(ErrorMeasure::CoveragePercent.definition()),
    ];
    ui.add_space(space(2));
    let rows = tables.iter().filter_map(row).collect();
    TableView::new("intervals", &columns).show_all(ui, rows);
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
