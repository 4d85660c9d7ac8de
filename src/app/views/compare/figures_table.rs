use std::time::Duration;

use eframe::egui::Ui;

use super::scene_words::{inputs_words, loading_words, movement_words, noise_words, rows_words};
use crate::{
    app::{
        shared::{PLACES, RunList},
        widgets::{TableColumn as Column, TableRow, TableView, fields::capitalised},
    },
    export::{KeptRun, Table, TableColumn, format_duration, format_number},
};

const COLUMNS: [Column<'_>; 3] = [
    Column::text(""),
    Column::figure("A").meaning("The run chosen as A"),
    Column::figure("B").meaning("The run chosen as B"),
];

/// A figure of a run, in words.
type FigureOf = fn(&KeptRun) -> String;

const FIGURES: [(&str, FigureOf); 18] = [
    ("Z error, %", |run| format_number(run.file.errors.z_percent)),
    ("X error, %", |run| format_number(run.file.errors.x_percent)),
    ("Y error, %", |run| format_number(run.file.errors.y_percent)),
    ("Z error, mm", |run| format_number(run.file.errors.z_mm)),
    ("Z error, % of the stroke", |run| {
        format_number(run.file.errors.z_full_scale_percent)
    }),
    ("worst node, mm", |run| format_number(run.file.errors.worst_mm)),
    ("linear map, Z %", |run| {
        format_number(run.file.baselines.linear.z_percent)
    }),
    ("training mean, Z %", |run| {
        format_number(run.file.baselines.mean.z_percent)
    }),
    ("array", |run| run.file.settings.source.sensor.scale.to_string()),
    ("rows", |run| rows_words(run.file.settings.source.scene.rows)),
    ("axes", |run| movement_words(run.file.settings.source.scene.movement)),
    ("loading", |run| loading_words(&run.file.settings.source.scene)),
    ("noise", |run| noise_words(&run.file.settings.source.scene.noise)),
    ("inputs", |run| inputs_words(run.file.settings.inputs)),
    ("hidden nodes", |run| run.file.settings.hidden.to_string()),
    ("method", |run| {
        run.file.settings.training.method.short_name().to_owned()
    }),
    ("best epoch", |run| {
        let training = &run.file.training;
        let epochs = training.history.last().map_or(0, |epoch| epoch.epoch);
        format!("{} of {epochs}", training.best_epoch)
    }),
    ("training time, one thread", |run| {
        let time = Duration::try_from_secs_f64(run.file.training.seconds);
        time.map_or_else(|_| format_number(None), format_duration)
    }),
];

/// The figures of both runs, under their names.
pub fn compared_table(runs: &RunList) -> Table {
    let name = |place: usize| {
        let run = runs.pinned(place).map_or("", |run| &run.name);
        TableColumn::field(format!("{}: {run}", PLACES[place]))
    };
    let row = |(name, figure): &(&'static str, FigureOf)| {
        let cell = |place| runs.pinned(place).map_or_else(|| format_number(None), figure);
        vec![capitalised(name).into(), cell(0).into(), cell(1).into()]
    };
    Table {
        columns: vec![TableColumn::field("Figure"), name(0), name(1)],
        rows: FIGURES.iter().map(row).collect(),
    }
}

/// Errors, configuration and cost of both runs.
pub fn figures_ui(ui: &mut Ui, runs: &RunList) {
    TableView::new("compared", &COLUMNS).show_all(ui, TableRow::of_table(&compared_table(runs)));
}
