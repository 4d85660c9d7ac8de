use decoupler_core::{
    evaluation::{Part, RUN_OPTIONS, RunSettings, TestErrors},
    settings::Value,
    text::capitalised,
};
use decoupler_files::export::{Cell, NetworkFile, Table};
use eframe::egui::Ui;

use super::name_of;
use crate::window::{
    shared::{LoadedRun, RunList},
    widgets::{TableColumn, TableRow, TableView, note_ui},
};

const COLUMNS: [TableColumn<'_>; 3] = [
    TableColumn::text(""),
    TableColumn::figure("A").meaning("The run chosen as A"),
    TableColumn::figure("B").meaning("The run chosen as B"),
];

/// Returns the settings of scene and network, and the method: name, value, and whether that is usual. Those that are rarely
/// changed are left out while they are usual.
pub(super) fn named_settings(settings: &RunSettings) -> impl Iterator<Item = (&'static str, Value, bool)> {
    let usual = match settings.simulation() {
        Some(_) => RunSettings::default(),
        None => RunSettings::measured(settings.source.row_model()),
    };
    RUN_OPTIONS.iter().filter_map(move |option| {
        let setting = &option.setting;
        let is_named = matches!(option.part, Part::Scene | Part::Network) || setting.name == "method";
        let value = setting.get(settings).filter(|_| is_named)?;
        let is_usual = setting.get(&usual).as_ref() == Some(&value);
        let name = match setting.name {
            "hidden" => "hidden nodes",
            "starts" => "restarts",
            name => name,
        };
        (!is_usual || !option.is_rare()).then_some((name, value, is_usual))
    })
}

/// Returns errors, settings and cost of a run.
fn figures(file: &NetworkFile) -> Vec<(String, Cell)> {
    let (scores, training) = (&file.scores, &file.training);
    let mut figures = Vec::new();
    let mut add = |name: &str, value: Cell| figures.push((capitalised(name), value));
    match &scores.network {
        TestErrors::Nodes(errors) => {
            add("Z error, %", errors.z_percent.into());
            // A coordinate that does not vary has no error.
            for (name, percent) in [("X error, %", errors.x_percent), ("Y error, %", errors.y_percent)] {
                if percent.is_some_and(|percent| percent != 0.0) {
                    add(name, percent.into());
                }
            }
            add("Z error, mm", errors.z_mm.into());
            add("Z error, % of the stroke", errors.z_full_scale_percent.into());
            add("worst node, mm", errors.worst_mm.into());
        }
        TestErrors::Targets(errors) => {
            add("error, % of the range", scores.network.percent().into());
            for (target, errors) in file.problem.targets.iter().zip(errors) {
                add(&format!("RMSE of {}", target.title()), errors.rmse.into());
                add(&format!("R² of {}", target.title()), Cell::R2(errors.r2));
            }
        }
    }
    add("linear map, %", scores.baselines.linear.percent().into());
    add("training mean, %", scores.baselines.mean.percent().into());
    add("source", file.source_name().into());
    if let Some(recorded) = &file.recorded {
        let split = match recorded.plan.test {
            Some(_) => "test file".to_owned(),
            None => recorded.plan.division.by.to_string(),
        };
        add("split", split.into());
    }
    named_settings(&file.settings).for_each(|(name, value, _)| add(name, value.into()));
    let best_epoch = format!("{} of {}", training.best_epoch, training.epochs);
    add("best epoch", best_epoch.into());
    add("training time", Cell::Seconds(Some(training.seconds)));
    figures
}

/// Returns the figures of both runs, with their names as headings.
pub fn compared_table(runs: &RunList) -> Table {
    let sides = [0, 1].map(|place| runs.pinned(place).map_or_else(Vec::new, |run| figures(run.file)));
    let mut names: Vec<&String> = Vec::new();
    for (name, _) in sides.iter().flatten() {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let rows = names.into_iter().map(|name| {
        let cell = |side: &Vec<(String, Cell)>| {
            let figure = side.iter().find(|(other, _)| other == name);
            figure.map_or(Cell::Number(None), |(_, cell)| cell.clone())
        };
        vec![name.as_str().into(), cell(&sides[0]), cell(&sides[1])]
    });
    let headings = ["Figure".to_owned(), name_of(runs, 0), name_of(runs, 1)];
    Table::of_headings(headings, rows)
}

/// Shows errors, configuration and cost of both runs.
pub(super) fn figures_ui(ui: &mut Ui, runs: &RunList) {
    if are_other_samples(runs) {
        let text = "These networks were tested on different samples, so their errors are not directly comparable.";
        note_ui(ui, text);
    }
    TableView::new("compared", &COLUMNS).show_all(ui, TableRow::of_table(&compared_table(runs)));
}

/// Returns true if the two runs were tested on different samples.
fn are_other_samples(runs: &RunList) -> bool {
    // The channels of the readings may differ.
    let samples = |run: LoadedRun<'_>| {
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

#[cfg(test)]
mod tests {
    use decoupler_core::{
        evaluation::Preset,
        scene::{Noise, NoisySets, Rows},
    };

    use super::*;

    /// Returns the settings that are not usual.
    fn changed(settings: &RunSettings) -> Vec<String> {
        let changed = named_settings(settings).filter(|(.., is_usual)| !is_usual);
        changed.map(|(name, value, _)| format!("{name} {value}")).collect()
    }

    #[test]
    fn settings_that_differ_from_the_papers_are_told_apart() {
        assert!(changed(&RunSettings::default()).is_empty());
        let mut settings = Preset::Best.settings_in(Noise {
            relative: 1e-3,
            converter_bits: Some(12),
            sets: NoisySets::Test,
            ..Noise::default()
        });
        let words = changed(&settings);
        for word in [
            "rows known",
            "noise 0.001",
            "adc bits 12",
            "noise in test",
            "scaling whiten",
        ] {
            assert!(words.iter().any(|other| other == word), "{word}: {words:?}");
        }
        settings = RunSettings::default();
        settings.simulation_mut().unwrap().scene.rows = Rows::One(2);
        assert_eq!(changed(&settings), ["rows 3"]);
    }
}
