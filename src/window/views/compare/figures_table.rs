use std::time::Duration;

use eframe::egui::Ui;

use super::view::{inputs_words, loading_words, movement_words, noise_words, rows_words};
use crate::window::{
    shared::{PLACES, RunList},
    widgets::{TableColumn as Column, TableRow, TableView, fields::capitalised, note_ui},
};
use decoupler_core::evaluation::{Channel, Errors, Simulation, TargetErrors};
use decoupler_files::{
    export::{KeptRun, Table, TableColumn, format_duration, format_number},
    import::Plan,
};

const COLUMNS: [Column<'_>; 3] = [
    Column::text(""),
    Column::figure("A").meaning("The run chosen as A"),
    Column::figure("B").meaning("The run chosen as B"),
];

const OTHER_SAMPLES: &str =
    "These networks were tested on different samples, so their errors are not comparable directly.";

/// A figure of a run, in words; `None` if runs of its source have none.
type FigureOf = fn(&KeptRun) -> Option<String>;

fn of_nodes(run: &KeptRun, figure: fn(&Errors) -> Option<f64>) -> Option<String> {
    run.file
        .scores
        .network
        .nodes()
        .map(|errors| format_number(figure(errors)))
}

fn of_array(run: &KeptRun, figure: fn(&Simulation) -> String) -> Option<String> {
    run.file.settings.source.simulation().map(figure)
}

const FIGURES: [(&str, FigureOf); 20] = [
    ("Z error, %", |run| of_nodes(run, |errors| errors.z_percent)),
    ("X error, %", |run| of_nodes(run, |errors| errors.x_percent)),
    ("Y error, %", |run| of_nodes(run, |errors| errors.y_percent)),
    ("Z error, mm", |run| of_nodes(run, |errors| Some(errors.z_mm))),
    ("Z error, % of the stroke", |run| {
        of_nodes(run, |errors| Some(errors.z_full_scale_percent))
    }),
    ("worst node, mm", |run| of_nodes(run, |errors| Some(errors.worst_mm))),
    ("error, % of the range", |run| {
        let errors = &run.file.scores.network;
        errors.nodes().is_none().then(|| format_number(errors.percent()))
    }),
    ("linear map, %", |run| {
        Some(format_number(run.file.scores.baselines.linear.percent()))
    }),
    ("training mean, %", |run| {
        Some(format_number(run.file.scores.baselines.mean.percent()))
    }),
    ("source", |run| Some(run.file.source_name())),
    ("split", |run| Some(split_words(&run.file.recorded.as_ref()?.plan))),
    ("rows", |run| of_array(run, |array| rows_words(array.scene.rows))),
    ("axes", |run| {
        of_array(run, |array| movement_words(array.scene.movement))
    }),
    ("loading", |run| of_array(run, |array| loading_words(&array.scene))),
    ("noise", |run| of_array(run, |array| noise_words(&array.scene.noise))),
    ("inputs", |run| Some(inputs_words(run.file.settings.inputs))),
    ("hidden nodes", |run| Some(run.file.settings.hidden.to_string())),
    ("method", |run| {
        Some(run.file.settings.training.method.short_name().to_owned())
    }),
    ("best epoch", |run| {
        let training = &run.file.training;
        Some(format!("{} of {}", training.best_epoch, training.epochs()))
    }),
    ("training time, one thread", |run| {
        let time = Duration::try_from_secs_f64(run.file.training.seconds);
        Some(time.map_or_else(|_| format_number(None), format_duration))
    }),
];

/// Figures that at least one of the runs compared has, with the words for each.
fn figures(runs: &RunList) -> impl Iterator<Item = (&'static str, [Option<String>; 2])> {
    let figure = |(name, figure): &(&'static str, FigureOf)| {
        let of = |place| runs.pinned(place).and_then(figure);
        (*name, [of(0), of(1)])
    };
    let figures = Vec::from_iter(FIGURES.iter().map(figure));
    let is_empty = (0..2).all(|place| runs.pinned(place).is_none());
    figures
        .into_iter()
        .filter(move |(_, words)| is_empty || words.iter().any(Option::is_some))
}

/// RMSE and R² of each target of the recordings compared, with the words for each run.
fn target_figures(runs: &RunList) -> Vec<(String, [Option<String>; 2])> {
    let pinned = [0, 1].map(|place| runs.pinned(place));
    let mut targets: Vec<&Channel> = Vec::new();
    let recorded = pinned.into_iter().flatten().filter(|run| run.file.recorded.is_some());
    for target in recorded.flat_map(|run| &run.file.problem.targets) {
        if !targets.contains(&target) {
            targets.push(target);
        }
    }
    let errors = |run: &KeptRun, target: &Channel| {
        let index = run.file.problem.targets.iter().position(|other| other == target)?;
        run.file.scores.network.targets().get(index).copied()
    };
    let figures = |target: &Channel| {
        let of = |figure: fn(&TargetErrors) -> String| {
            pinned.map(|run| run.and_then(|run| errors(run, target)).map(|errors| figure(&errors)))
        };
        let title = target.title();
        [
            (format!("RMSE of {title}"), of(|errors| format_number(errors.rmse))),
            (format!("R² of {title}"), of(|errors| format_number(errors.r2))),
        ]
    };
    targets.into_iter().flat_map(figures).collect()
}

/// Returns true if the errors of two recordings are not of the same samples.
fn are_other_samples(runs: &RunList) -> bool {
    // The channels of the readings may differ.
    let samples = |run: &KeptRun| {
        let mut plan = run.file.recorded.as_ref()?.plan.clone();
        plan.import.inputs.clear();
        plan.import.units.clear();
        Some((plan, run.file.settings.seed))
    };
    match [0, 1].map(|place| runs.pinned(place)) {
        [Some(a), Some(b)] => samples(a) != samples(b),
        _ => false,
    }
}

fn split_words(plan: &Plan) -> String {
    match plan.test {
        Some(_) => "test file".to_owned(),
        None => plan.division.by.to_string(),
    }
}

/// The figures of both runs, under their names.
pub fn compared_table(runs: &RunList) -> Table {
    let name = |place: usize| {
        let run = runs.pinned(place).map_or("", |run| &run.name);
        TableColumn::field(format!("{}: {run}", PLACES[place]))
    };
    let cell = |words: Option<String>| words.unwrap_or_else(|| format_number(None)).into();
    let row = |(name, [a, b]): (String, [Option<String>; 2])| vec![capitalised(&name).into(), cell(a), cell(b)];
    let of_runs = figures(runs).map(|(name, words)| (name.to_owned(), words));
    Table {
        columns: vec![TableColumn::field("Figure"), name(0), name(1)],
        rows: of_runs.chain(target_figures(runs)).map(row).collect(),
    }
}

/// Errors, configuration and cost of both runs.
pub fn figures_ui(ui: &mut Ui, runs: &RunList) {
    if are_other_samples(runs) {
        note_ui(ui, OTHER_SAMPLES);
    }
    TableView::new("compared", &COLUMNS).show_all(ui, TableRow::of_table(&compared_table(runs)));
}
