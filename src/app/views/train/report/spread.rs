use eframe::egui::{RichText, Ui};

use crate::{
    app::{
        plotting::{StripChart, strip_ui},
        theme::{Theme, type_size},
        widgets::{Column, Row, section_heading_ui, table_ui},
    },
    evaluation::{Problem, Spread, StartRecord, best_start},
    export::format_number,
};

const COLUMNS: [Column; 3] = [
    Column {
        heading: "min",
        meaning: "Best start.",
    },
    Column {
        heading: "median",
        meaning: "Median of all starts: what a single start would typically give.",
    },
    Column {
        heading: "max",
        meaning: "Worst start.",
    },
];

/// Shows the spread of the results of several starts: a strip of dots and three figures. Nothing for one start.
pub fn spread_ui(ui: &mut Ui, problem: &Problem, starts: &[StartRecord]) {
    let Some(best) = best_start(starts).filter(|_| starts.len() > 1) else {
        return;
    };
    let palette = Theme::of(ui).palette;
    section_heading_ui(ui, &format!("Spread over {} starts", starts.len()));
    let percents: Vec<Option<f64>> = starts.iter().map(|start| start.z_percent).collect();
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
    let rows = [(of_test, spread), (error, errors)];
    let row = |(name, spread): (&'static str, Option<Spread>)| {
        let figures = spread.map(|spread| [spread.smallest, spread.median, spread.largest]);
        Some(Row {
            name,
            meaning: "",
            cells: figures?.into_iter().map(format_number).collect(),
            colour: palette.text,
            is_strong: false,
            mark: "",
        })
    };
    let rows: Vec<Row> = rows.into_iter().filter_map(row).collect();
    ui.scope(|ui| table_ui(ui, &COLUMNS, &rows));
    let text = format!("Start {} is kept: it has the lowest {error}.", best + 1);
    ui.label(RichText::new(text).size(type_size().note).color(palette.dim));
}
