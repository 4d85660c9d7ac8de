//! The paper's experiments and sweeps: set up, run, cancelled and exported.

use std::{fs, num::NonZero};

use decoupler_core::{
    evaluation::experiments::{
        Axis, AxisKind, Experiment, ExperimentResults, PaperTable, TrialSamples, run_experiments,
    },
    machine::MemoryBudget,
};
use decoupler_files::export::{Cell, ExperimentTable, describe_failures, describe_worse_than_mean};

use crate::{
    driver::Driver,
    recordings::{opened, setup},
    sources::run_of,
    terminal,
};

fn open() -> Driver {
    let mut driver = Driver::open();
    driver.click_button("Study");
    driver
}

/// Waits for the end of what the Study view does.
#[track_caller]
pub(crate) fn wait_for_the_end(driver: &mut Driver) {
    driver.wait("the end", |driver| !driver.is_enabled("■ Cancel"));
    driver.settle();
}

/// Table 1 with two sizes, one seed and few epochs, typed in.
pub(crate) fn tiny(driver: &mut Driver) -> Experiment {
    driver.type_into("Hidden nodes", "2, 4");
    driver.enter("Seeds", "1");
    driver.enter("Epochs", "3");
    driver.enter("Restarts", "1");
    let mut wanted = PaperTable::HiddenNodes.experiment();
    wanted.axis = Axis::integers(AxisKind::Hidden, [2, 4]);
    (wanted.seeds, wanted.base.starts) = (1, 1);
    wanted.base.training.stopping.epochs = 3;
    driver.assert_has("2 trainings of at most 3 epochs");
    wanted
}

pub(crate) fn run_to_the_end(driver: &mut Driver) {
    driver.click("▶ Run");
    wait_for_the_end(driver);
}

/// Runs `experiment` with the library.
fn by_library(experiment: &Experiment) -> ExperimentResults {
    let mut results = ExperimentResults::new(experiment.clone());
    let record = |finished: decoupler_core::evaluation::experiments::Finished| {
        results.record(finished.cell, finished.outcome);
    };
    run_experiments(
        std::slice::from_ref(experiment),
        &TrialSamples::Drawn(MemoryBudget::UNLIMITED),
        NonZero::<usize>::MIN,
        || false,
        record,
    )
    .unwrap();
    results
}

/// Columns of times differ from run to run.
const TIMES: [&str; 1] = ["training time (s)"];

#[test]
fn a_table_ends_with_the_librarys_own_numbers() {
    let mut driver = open();
    let experiment = tiny(&mut driver);
    run_to_the_end(&mut driver);
    driver.assert_says("Table 1 finished: 2 trials");
    let results = by_library(&experiment);
    let table = ExperimentTable::new(&results).table();
    let mut compared = 0;
    for row in &table.rows {
        let [name, texts @ ..] = &Vec::from_iter(row.iter().map(Cell::rounded))[..] else {
            panic!("{row:?}")
        };
        for (heading, text) in table.columns.iter().map(|column| column.title()).skip(1).zip(texts) {
            if !TIMES.contains(&heading.as_str()) {
                let shown = format!("{name}, {heading}: {text}");
                driver.assert_has(&shown);
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 2 * 7, "nothing is published for these sizes");
    let remarks = [describe_failures(&results), describe_worse_than_mean(&results)].concat();
    for remark in &remarks {
        assert!(driver.has(remark), "{remark}");
    }
    driver.settle();

    for _ in 0..2 {
        driver.click("Sort by Z % median");
    }
    let places = ["Cell 2", "Cell 4"].map(|cell| driver.get(cell).rect().top());
    let medians = results.cells.iter().map(|cell| cell.percent().median.unwrap());
    let medians = Vec::from_iter(medians);
    assert_eq!(
        places[0] < places[1],
        medians[0] > medians[1],
        "the largest comes first"
    );

    assert!(!driver.is_enabled(OPEN), "no cell is marked");
    driver.click("Cell 4");
    driver.click(OPEN);
    wait_for_the_network(&mut driver);
    assert_eq!(driver.state().draft, experiment.cells()[1].settings);
    assert_eq!(driver.state().run.as_ref().unwrap().history.len(), 1 + 3);
    let z = results.cells[1].trials[0].scores.network.percent();
    let shown = driver.state().result().unwrap().errors.percent();
    assert_eq!(shown.map(f64::to_bits), z.map(f64::to_bits), "it is the cell's network");
}

const OPEN: &str = "Open in Train view";

fn wait_for_the_network(driver: &mut Driver) {
    assert_eq!(driver.shown(), "Train");
    driver.wait("the network", |driver| {
        driver.has_ended() && driver.state().result().is_some()
    });
    driver.settle();
}

#[test]
fn a_cell_of_a_cross_validation_is_trained_where_it_is_opened() {
    let mut driver = open();
    driver.click("Table 2");
    driver.type_into("Samples", "40");
    driver.enter("Folds", "2");
    driver.enter("Repeats", "2");
    driver.enter("Seeds", "1");
    driver.enter("Epochs", "3");
    run_to_the_end(&mut driver);
    driver.click("Cell 40");
    driver.click(OPEN);
    wait_for_the_network(&mut driver);
    let state = driver.state();
    let mut wanted = PaperTable::CrossValidation.experiment();
    wanted.axis = Axis::integers(AxisKind::Samples, [40]);
    wanted.base.training.stopping.epochs = 3;
    assert_eq!(state.draft, wanted.cells()[0].settings);
    assert_eq!(state.result().unwrap().epochs_run, 3);
}

#[test]
fn before_it_is_run_a_table_shows_the_published_figures() {
    let mut driver = open();
    driver.assert_has("12, Z % publ.: 2.28");
    driver.assert_has("12, Z % median: –");
    assert!(driver.says("Our figures appear next to"));
    assert!(!driver.is_enabled(OPEN));
    driver.open_menu();
    assert!(!driver.is_enabled("Figure…") && driver.says("Nothing has finished yet"));
    driver.press(eframe::egui::Key::Escape);
    // The typed values determine what would be filled in.
    driver.type_into("Hidden nodes", "12, 99");
    driver.assert_has("99, Z % publ.: –");
}

#[test]
fn a_cancelled_experiment_keeps_what_is_finished() {
    let mut driver = open();
    tiny(&mut driver);
    driver.enter("Seeds", "400");
    driver.click("▶ Run");
    driver.wait("a finished trial", |driver| {
        driver.says("Table 1: ") && !driver.says("Table 1: 0 of ") && !driver.says("Table 1: 1 of ")
    });
    assert!(!driver.is_enabled("▶ Run"), "one study at a time");
    driver.click("■ Cancel");
    wait_for_the_end(&mut driver);
    let ended = |driver: &Driver| {
        let texts = driver.texts().into_iter();
        let mut ended = texts.filter(|text| text.starts_with("Table 1 ended early: "));
        ended.next().unwrap_or_else(|| panic!("{:#?}", driver.texts()))
    };
    let text = ended(&driver);
    assert!(text.contains(" of 800 trials in "), "{text}");
    // The other tables have nothing to show; this one still does.
    driver.click("Table 3");
    assert!(driver.says("Our figures appear next to"));
    driver.click("Table 1");
    assert_eq!(ended(&driver), text);
}

#[test]
fn invalid_lists_say_why_until_they_are_fixed() {
    let mut driver = open();
    for (list, reason) in [
        (
            "6, eight",
            "Hidden nodes: 'eight' is not a whole number; write a list such as 6, 8, 10, 12",
        ),
        ("0", "hidden nodes: 0 is not possible, give from 1 to 512"),
        (" ", "there are no values for hidden nodes: give at least one"),
    ] {
        driver.type_into("Hidden nodes", list);
        driver.assert_has(reason);
        assert!(!driver.is_enabled("▶ Run"));
    }
    driver.click("Table 3");
    driver.type_into("Array scales", "10x6");
    assert!(driver.says("'10x6' is not an array scale"));
    driver.click("Table 2");
    driver.enter("Folds", "500");
    driver.assert_says("500 folds of 100 samples");
    driver.click("Reset to the default values");
    assert!(driver.is_enabled("▶ Run"));
    driver.click("Table 1");
    driver.click("Reset to the default values");
    assert!(driver.is_enabled("▶ Run"));
}

#[test]
fn a_sweep_is_shown_as_a_map_and_saved() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = open();
    driver.click("Sweep");
    driver.type_into("Values across", "2 3");
    driver.type_into("Values down", "50 100");
    driver.enter("Epochs", "3");
    run_to_the_end(&mut driver);
    let mut experiment = PaperTable::HiddenNodes.experiment();
    experiment.axis = Axis::integers(AxisKind::Hidden, [2, 3]);
    experiment.second_axis = Some(Axis::integers(AxisKind::Samples, [50, 100]));
    experiment.seeds = 1;
    experiment.base = driver.state().draft;
    experiment.base.training.stopping.epochs = 3;
    let results = by_library(&experiment);
    for (cell, z) in results.cells.iter().zip(["2, 50", "3, 50", "2, 100", "3, 100"]) {
        let percent = decoupler_files::export::format_number(cell.percent().median);
        let label = format!("{z}, Z % median: {percent}");
        driver.assert_has(&label);
    }
    driver.settle();
    for (button, name, expected) in [
        ("Every cell, CSV", "cells.csv", "array,hidden,samples"),
        ("Every trial, CSV", "trials.csv", "array,hidden,samples"),
        ("Table, CSV", "table.csv", "hidden nodes,samples,"),
    ] {
        let path = folder.path().join(name);
        driver.save(button, &path);
        assert!(driver.says("Saved "));
        driver.click("Dismiss");
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with(expected), "{text}");
    }
    for (button, name, expected) in [
        ("Figure, SVG", "map.svg", &b"<svg"[..]),
        ("Figure, PNG", "map.png", b"\x89PNG"),
    ] {
        let path = folder.path().join(name);
        driver.save(button, &path);
        assert!(driver.says("Saved "));
        driver.click("Dismiss");
        assert!(fs::read(&path).unwrap().starts_with(expected), "{name}");
    }
    let rows = fs::read_to_string(folder.path().join("cells.csv"))
        .unwrap()
        .lines()
        .count();
    assert_eq!(rows, 5, "a heading and four cells");
}

/// The window writes the sweep, the terminal trains it in two parts, and the window shows the results after each.
#[test]
fn a_sweep_of_the_window_is_trained_by_the_terminal_and_shown_as_it_grows() {
    let home = tempfile::tempdir().unwrap();
    let mut driver = open();
    driver.click("Sweep");
    driver.type_into("Values across", "2, 3");
    driver.type_into("Values down", "40");
    driver.enter("Seeds", "2");
    driver.enter("Epochs", "3");
    driver.click("Save specification…");
    driver.type_into("File", &home.path().join("sweep.json").display().to_string());
    driver.click_button("Save");
    driver.wait("the file", |driver| driver.notice().is_some());

    let train = |shard: &str| {
        let arguments = format!("sweep --spec sweep.json --out trials --shard {shard}");
        let output = terminal::decoupler(&arguments, home.path());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    train("1/2");
    driver.click("Open sweep folder…");
    driver.type_into("File", &home.path().join("trials").display().to_string());
    driver.click_button("Open");
    driver.wait("the first trials", |driver| driver.says("2 trials finished"));
    train("2/2");
    driver.wait("the other trials", |driver| driver.says("4 trials finished"));
    driver.assert_says("Sweep folder trials: 4 trials finished");

    // The figures are those of the files.
    for entry in fs::read_dir(home.path().join("trials")).unwrap() {
        let path = entry.unwrap().path();
        let document: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        let run = &document["run"];
        let of = |option: &str| run["options"][option].to_string();
        let z = decoupler_files::export::format_number(run["report"]["errors"]["z_percent"].as_f64());
        let shown = format!("hidden {}, seed {}, Z %: {z}", of("hidden"), of("seed"));
        driver.assert_has(&shown);
    }
    fs::write(home.path().join("trials").join(format!("{}.json", "0".repeat(32))), "{").unwrap();
    driver.wait("the damaged file", |driver| driver.says("00000000"));
    driver.click("■ Cancel");
    run_to_the_end(&mut driver);
    assert!(!driver.says("Sweep folder"), "results replace the folder");

    driver.click("Open sweep folder…");
    driver.type_into("File", &home.path().display().to_string());
    driver.click_button("Open");
    driver.wait("the refusal", |driver| {
        driver.says("give a folder that decoupler sweep has filled")
    });
}

#[test]
fn a_sweep_of_a_recording_has_the_runs_of_the_train_view() {
    let (mut driver, path, _folder) = opened(120);
    driver.click_button("Study");
    driver.click("Sweep");
    driver.settle();
    assert!(
        driver.is_enabled("▶ Run"),
        "both axes can be varied: {:#?}",
        driver.texts()
    );
    driver.choose("Down", "Scaling");
    for scaling in ["Min-max", "Whitening"] {
        driver.click(scaling);
    }
    driver.assert_says("there are no values for scaling");
    for scaling in ["Min-max", "Whitening"] {
        driver.click(scaling);
    }
    driver.type_into("Values across", "4 12");
    driver.enter("Epochs", "5");
    run_to_the_end(&mut driver);
    let alone = run_of(&setup(&path));
    let percent = decoupler_files::export::format_number(alone.errors().percent());
    let label = format!("12, minmax, error % median: {percent}");
    driver.assert_has(&label);
    driver.click("Cell 12, minmax");
    driver.click(OPEN);
    wait_for_the_network(&mut driver);
    assert_eq!(driver.state().result().unwrap().errors, alone.errors());
}
