use eframe::egui::Ui;

use crate::window::{
    glossary,
    theme::{Theme, space},
    widgets::{TableCell, TableColumn, TableRow, TableView},
};
use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{ErrorMeasure, ErrorRow, ErrorTable},
};
use decoupler_files::export::{format_number, format_r2};

/// Measures of intervals, which have a table of their own.
const OF_INTERVALS: [ErrorMeasure; 2] = [ErrorMeasure::HalfWidth, ErrorMeasure::CoveragePercent];

/// Measures of error that the table shows: all but the worst node, which is shown below, and the intervals.
fn is_in_table(measure: ErrorMeasure) -> bool {
    measure != ErrorMeasure::WorstMm && !OF_INTERVALS.contains(&measure)
}

fn column(measure: ErrorMeasure) -> TableColumn<'static> {
    let term = match measure {
        ErrorMeasure::ZPercent => Some(glossary::Z_PERCENT),
        ErrorMeasure::XPercent => Some(glossary::X_PERCENT),
        ErrorMeasure::YPercent => Some(glossary::Y_PERCENT),
        ErrorMeasure::ZMm => Some(glossary::Z_MM),
        ErrorMeasure::ZStrokePercent => Some(glossary::STROKE_PERCENT),
        _ => None,
    };
    let heading = match measure {
        ErrorMeasure::RangePercent => "% of range",
        measure => measure.heading().0,
    };
    match term {
        Some(term) => TableColumn::figure(term.name).meaning(term.hint),
        None => TableColumn::figure(heading).meaning(measure.definition()),
    }
}

/// Lays out an error table: rows of baselines, network, model-based and published figures, for recordings target by target;
/// below, the intervals of the network, if they were calibrated.
pub fn error_table_ui(ui: &mut Ui, tables: &[ErrorTable]) {
    let Some(ErrorTable { measures, .. }) = tables.first() else {
        return;
    };
    let palette = Theme::of(ui).palette;
    let shown = Vec::from_iter((0..measures.len()).filter(|&place| is_in_table(measures[place])));
    let columns = shown.iter().map(|&place| column(measures[place]));
    let columns = Vec::from_iter(std::iter::once(TableColumn::text("")).chain(columns));
    // The error that decides whether a baseline is better.
    let judged = measures
        .iter()
        .position(|measure| matches!(measure, ErrorMeasure::ZMm | ErrorMeasure::Rmse));
    let mut rows = Vec::new();
    for table in tables {
        let used = table.used();
        let judged = |row: &ErrorRow| judged.and_then(|place| row.errors.get(place).copied().flatten());
        let of_used = table.rows.iter().find(|row| row.name == used).and_then(judged);
        let figure = |row: &ErrorRow, place: usize| match measures[place] {
            ErrorMeasure::R2 => format_r2(row.errors[place]),
            _ => format_number(row.errors[place]),
        };
        let row = |row: &ErrorRow| {
            let name = match &table.target {
                Some(target) => format!("{}, {}", target.title(), row.name),
                None => row.name.to_owned(),
            };
            TableRow::figures(row.name, shown.iter().map(|&place| figure(row, place)))
                .named(name)
                .meaning(row_meaning(row.name))
                .colour(match row.name {
                    name if name == used => palette.accent,
                    "published" | "model-based" => palette.dim,
                    _ => palette.text,
                })
                .strong(row.name == used)
                .mark(if beats(row.name, judged(row), of_used) {
                    BETTER
                } else {
                    ""
                })
        };
        rows.extend(table.target.as_ref().map(|target| TableRow::section(target.title())));
        rows.extend(table.rows.iter().map(row));
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

/// Meaning of the mark at a baseline.
const BETTER: &str = "Better than what is used.";

/// Returns true for a baseline with a smaller error than the network.
fn beats(name: &str, error: Option<f64>, of_network: Option<f64>) -> bool {
    let is_baseline = ["training mean", "linear map", "ridge"].contains(&name);
    is_baseline
        && error
            .zip(of_network)
            .is_some_and(|(baseline, network)| baseline < network)
}
