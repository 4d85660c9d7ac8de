use eframe::egui::{RichText, Ui};

use crate::window::{
    plotting::{StripChart, strip_ui},
    theme::{Theme, type_size},
    widgets::{described_table_ui, section_heading_ui},
};
use decoupler_core::evaluation::{Problem, Spread, StartRecord, best_start};
use decoupler_files::export::{Cell, Table, TableColumn};

/// Shows the spread of the results of several starts: a strip of dots and three figures. Nothing for one start.
pub fn spread_ui(ui: &mut Ui, problem: &Problem, starts: &[StartRecord]) {
    let Some(best) = best_start(starts).filter(|_| starts.len() > 1) else {
        return;
    };
    let palette = Theme::of(ui).palette;
    section_heading_ui(ui, &format!("Spread over {} starts", starts.len()));
    let percents: Vec<Option<f64>> = starts.iter().map(StartRecord::percent).collect();
    let spread = Spread::of(percents.iter().copied().flatten());
    let of_test = problem.test_percent_name();
    if let Some(spread) = spread {
        strip_ui(
            ui,
            &StripChart {
                label: &format!("Spread of {of_test}"),
                axis: of_test,
                values: &percents,
                marked: best,
                spread,
            },
        );
    }
    let is_held_out = starts.iter().all(|start| start.validation_mse.is_some());
    let error = if is_held_out { "validation mse" } else { "training mse" };
    let errors = Spread::of(starts.iter().map(StartRecord::deciding_mse));
    described_table_ui(ui, "spread", &spread_table(&[(of_test, spread), (error, errors)]));
    let text = format!("Start {} is kept: it has the lowest {error}.", best + 1);
    ui.label(RichText::new(text).size(type_size().note).color(palette.dim));
}

/// The figures of each spread.
fn spread_table(spreads: &[(&'static str, Option<Spread>)]) -> Table {
    let row = |(name, spread): &(&'static str, Option<Spread>)| {
        let figures = spread.map(|spread| [spread.smallest, spread.median, spread.largest]);
        let cells = figures?.map(Cell::from);
        Some([vec![(*name).into()], cells.into()].concat())
    };
    Table {
        columns: vec![
            TableColumn::new("error", "", ""),
            TableColumn::new("min", "min", "").meaning("Best start."),
            TableColumn::new("median", "median", "")
                .meaning("Median of all starts: the typical result of a single start."),
            TableColumn::new("max", "max", "").meaning("Worst start."),
        ],
        rows: spreads.iter().filter_map(row).collect(),
    }
}
