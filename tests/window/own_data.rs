//! Recordings out of files, in the window: dropped, looked at, trained on, saved and opened again.

use std::{fmt::Write as _, fs, path::Path};

use decoupler::{
    app::Notice,
    dataset::{Folds, Seed, SplitBy, Stream},
    evaluation::CrossValidated,
    export::{MeasuredNetworkFile, RecipeFile, format_number},
};
use eframe::egui::{self, accesskit::Role, vec2};
use egui_kittest::kittest::{By, NodeT as _, Queryable as _};

use crate::{
    closing::close,
    driver::Driver,
    recordings::{cells, opened, opened_text, plan, recording, settings, trained, written},
};

#[test]
fn a_dropped_file_is_trained_on_by_one_click_as_by_the_library() {
    let (mut driver, path, _folder) = opened(120);
    assert_eq!(driver.shown(), "Own data");
    for (column, meaning) in [
        ("time", "time"),
        ("u1", "input"),
        ("u2", "input"),
        ("x", "target"),
        ("y", "target"),
    ] {
        let value = driver.get(&format!("Meaning of {column}")).accesskit_node().value();
        assert_eq!(value.as_deref(), Some(meaning), "{column}");
    }
    assert!(driver.has("Training: 96") && driver.has("Test: 24"));
    driver.limit_epochs("5");
    // From here on one click is enough.
    driver.train_own_data();
    let run = trained(&plan(&path));
    let mut expected = Vec::new();
    for (index, target) in ["x (mm)", "y (mm)"].into_iter().enumerate() {
        for (name, row) in ["training mean", "ridge", "network"]
            .into_iter()
            .zip(run.target_table())
        {
            let errors = &row.targets[index];
            for (figure, value) in [("RMSE", errors.rmse), ("MAE", errors.mae), ("worst", errors.worst)] {
                expected.push(format!("{target}, {name}, {figure}: {}", format_number(value)));
            }
        }
    }
    assert_eq!(cells(&driver), expected);
    // Both targets are positions in millimetres.
    assert!(driver.has("Error over the position"));
    driver.click("Regression");
    driver.settle();
    assert!(driver.says("decoded x (mm) against actual x (mm)"));
    driver.click("Sample");
    driver.settle();
    assert!(
        driver.has("Test sample") && driver.says("value (mm)"),
        "all targets of one sample"
    );
}

#[test]
fn a_network_is_saved_and_opened_again_with_its_charts() {
    let (mut driver, path, folder) = opened(60);
    driver.limit_epochs("3");
    driver.train_own_data();
    let shown = cells(&driver);
    let saved = folder.path().join("network.json");
    driver.save("Network file, JSON", &saved);
    assert!(
        matches!(driver.notice(), Some(Notice::Done(_))),
        "{:?}",
        driver.notice()
    );
    let file = MeasuredNetworkFile::load(&saved).unwrap();
    assert_eq!(
        (file.inputs.len(), file.targets.len(), file.settings.hidden),
        (2, 2, 12)
    );

    let mut other = Driver::open();
    other.drop_files(&[&saved]);
    other.wait("the network", |driver| !cells(driver).is_empty());
    other.settle();
    assert_eq!(cells(&other), shown);
    assert!(other.has("Error over the position"), "its recording is still there");

    // Without the recording the errors stay, and the reason for which there are no charts is told.
    fs::remove_file(&path).unwrap();
    let mut without = Driver::open();
    without.drop_files(&[&saved]);
    without.wait("the network", |driver| !cells(driver).is_empty());
    without.settle();
    assert_eq!(cells(&without), shown);
    assert!(without.says("press.csv") && without.says("There are no test samples at hand"));
}

#[test]
fn two_files_are_joined_by_time_and_filtered() {
    let folder = tempfile::tempdir().unwrap();
    let (mut sensor, mut states) = (String::new(), String::new());
    for row in 0..80 {
        let t = 1000.0 + 0.05 * f64::from(row);
        let (x, z) = (f64::from(row % 20), f64::from(row % 4));
        writeln!(
            sensor,
            "{t:.3},{:.3},{:.3},{:.3}",
            0.5 * x,
            x * x / 20.0,
            f64::from(row % 7)
        )
        .unwrap();
        // The last rows have no partner.
        if row < 70 {
            writeln!(states, "{:.3},{x},{z}", t + 0.004).unwrap();
        }
    }
    let sensor = written(&folder, "sensor.csv", &sensor);
    let states = written(&folder, "states.csv", &states);
    let mut driver = Driver::open();
    // In any order: the readings are found by the name of their file.
    driver.open_recordings(&[&states, &sensor]);
    for (column, meaning) in [
        ("c1", "time"),
        ("c2", "input"),
        ("states.c1", "time"),
        ("states.c2", "target"),
        ("states.c3", "target"),
    ] {
        let value = driver.get(&format!("Meaning of {column}")).accesskit_node().value();
        assert_eq!(value.as_deref(), Some(meaning), "{column}");
    }
    assert!(
        driver.says("10 rows without partner, 0 of its rows unused"),
        "{:#?}",
        driver.texts()
    );
    driver.mean("states.c3", "unused");
    driver.click("Rows");
    // The field is not left when what is typed so far cannot be understood.
    driver.type_into("Only rows with", "s");
    driver.settle();
    driver.harness().event(egui::Event::Text("tates.c3 < 3".to_owned()));
    driver.settle();
    driver.press(egui::Key::Enter);
    driver.wait("the filtered samples", |driver| driver.says("states.c3<3 is not met"));
    driver.wait("the samples", |driver| driver.has("Test: 11"));
    assert!(driver.has("Training: 42"), "53 of 70 rows are left");

    // The import is saved as a recipe, which the terminal reads too, and opened again.
    let recipe = folder.path().join("recipe.json");
    driver.save("Recipe of the import, JSON", &recipe);
    let plan = RecipeFile::load(&recipe).unwrap();
    assert_eq!(plan.import.targets, ["states.c2"]);
    assert_eq!(plan.import.conditions[0].to_string(), "states.c3<3");
    let mut other = Driver::open();
    other.open_recordings(&[&recipe]);
    assert!(other.has("Training: 42") && other.has("Test: 11"));
    let value = other.get("Meaning of states.c3").accesskit_node().value();
    assert_eq!(value.as_deref(), Some("unused"));
}

#[test]
fn bad_cells_are_told_by_line_and_column_and_can_be_called_missing() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(
        &folder,
        "bad.csv",
        "u,v,force (N)\n1,5,2\n2,n.d.,3\n3,7,5\n4,8,6\n5,9,9\n",
    );
    let mut driver = Driver::open();
    driver.drop_files(&[&path]);
    driver.wait("the columns", |driver| driver.has("Meaning of v"));
    driver.settle();
    assert!(
        driver.says("line 3, column 2: 'n.d.' is no number"),
        "{:#?}",
        driver.texts()
    );
    // A column of which a cell cannot be read is not used unasked.
    driver.wait("the samples", |driver| driver.has("Training: 4"));
    driver.mean("v", "input");
    driver.wait("the reason", |driver| driver.says("is not a finite number"));
    assert!(
        !driver.says("--missing"),
        "the window names no argument of the terminal"
    );
    driver.click("Rows");
    driver.enter("Missing cells", "n.d.");
    driver.wait("the rest", |driver| {
        driver.has("Training: 3") && driver.says("v is missing")
    });
    // The table of columns is opened by another thread than counts the samples.
    driver.wait("the missing cell", |driver| driver.has("Missing in v: 1"));
}

#[test]
fn a_random_split_is_said_to_flatter() {
    let (mut driver, _path, _folder) = opened(40);
    assert!(!driver.says("flatters"));
    driver.click("Split");
    driver.click_button("random");
    driver.settle();
    assert!(driver.says("A random split flatters"));
    assert!(!driver.has("group"), "without groups there is no such split");
}

#[test]
fn a_checkpoint_goes_on_as_if_it_had_never_stopped() {
    let (mut driver, path, folder) = opened(60);
    driver.limit_epochs("3");
    driver.train_own_data();
    let saved = folder.path().join("half.checkpoint");
    driver.save("Checkpoint, resumable", &saved);
    let mut other = Driver::open();
    other.drop_files(&[&saved]);
    other.wait("the training", |driver| driver.says("Epoch 3 of 3"));
    other.settle();
    other.limit_epochs("2");
    other.click_button("Continue");
    other.wait("the end", |driver| driver.says("Epoch 5 of 5"));
    other.settle();
    let run = trained(&plan(&path));
    let rmse = run.target_table()[2].targets[0].rmse;
    assert!(
        other.has(&format!("x (mm), network, RMSE: {}", format_number(rmse))),
        "{:#?}",
        cells(&other)
    );
}

#[test]
fn everything_lies_within_narrow_windows_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, "press.csv", &recording(40));
    for size in [vec2(1440.0, 900.0), vec2(1024.0, 700.0), vec2(960.0, 640.0)] {
        let mut driver = Driver::open_sized(size);
        driver.open_recordings(&[&path]);
        driver.settle();
        for (text, place) in driver.places() {
            let is_beside = place.left() < -0.5 || place.right() > size.x + 0.5;
            assert!(!is_beside, "at {size}, {text} is at {place:?}");
        }
        let tools = ["Own data", "Export", "▶ Train", "■ Stop"].map(|label| {
            let nodes: Vec<_> = driver.places().into_iter().filter(|(text, _)| text == label).collect();
            nodes[0].1
        });
        for (one, other) in tools.iter().zip(&tools[1..]) {
            assert!(!one.intersects(*other), "at {size}: {one:?} and {other:?}");
        }
    }
}

/// Clicks the row of this name in the list of networks.
#[track_caller]
fn click_row(driver: &mut Driver, name: &str) {
    let row = By::new().role(Role::Row).label(name);
    driver.harness().get(row).click();
    driver.settle();
}

#[test]
fn networks_are_listed_compared_and_kept_from_session_to_session() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, "press.csv", &recording(60));
    let runs = folder.path().join("runs");
    let mut driver = Driver::open_keeping(&runs);
    driver.open_recordings(&[&path]);
    driver.limit_epochs("2");
    driver.train_own_data();
    let first = cells(&driver);
    driver.enter("Hidden nodes", "3");
    driver.train_own_data();
    driver.click("Runs");
    driver.settle();
    click_row(&mut driver, "press h12 br");
    let of_first = |name: &str| {
        let all = first
            .iter()
            .find(|cell| cell.starts_with("x (mm), network, RMSE"))
            .unwrap();
        all.replace("network", name)
    };
    assert!(driver.has(&of_first("A")), "{:#?}", cells(&driver));
    assert!(driver.says("x (mm), B, RMSE") && !driver.says("do not compare directly"));
    driver.wait("both files", |_| {
        fs::read_dir(folder.path().join("own-data")).is_ok_and(|files| files.count() == 2)
    });
    drop(driver);

    let mut other = Driver::open_keeping(&runs);
    other.click_button("Own data");
    other.click("Runs");
    let row = || By::new().role(Role::Row).label("press h12 br");
    let latest = std::time::Instant::now() + crate::driver::PATIENCE;
    while other.harness().query(row()).is_none() {
        other.wait_for_frame("the list", latest);
    }
    click_row(&mut other, "press h12 br");
    other.click_button("Show");
    other.wait("the network", |driver| !cells(driver).is_empty());
    other.settle();
    assert_eq!(cells(&other), first);
    assert!(other.has("Error over the position"), "its recording is read again");
}

#[test]
fn a_cross_validation_has_the_errors_of_the_library() {
    let (mut driver, path, _folder) = opened(60);
    driver.limit_epochs("5");
    driver.click("Cross-validation");
    driver.enter("Folds", "3");
    driver.click_button("Cross-validate");
    driver.wait("the folds", |driver| driver.says("3 folds by time"));
    driver.settle();
    let watch = &mut |_| std::ops::ControlFlow::Continue(());
    let recording = plan(&path).recording(Path::new(""), watch).unwrap();
    let mut rng = Seed::default().rng(Stream::Split);
    let folds = Folds::by(&recording.set, 3, SplitBy::Time, &mut rng).unwrap();
    let validated = CrossValidated::on_folds(&settings(), &recording.set, folds, || false)
        .unwrap()
        .unwrap();
    let errors = validated.target_table(&recording.set)[2].targets[1];
    let cell = format!("y (mm), network, RMSE: {}", format_number(errors.rmse));
    assert!(driver.has(&cell), "{cell} is not among {:#?}", cells(&driver));
    assert!(
        driver.says("the readings") || driver.says("The readings"),
        "what they tell is said"
    );
}

#[test]
fn a_column_of_groups_divides_the_samples_by_them() {
    let mut text = "session,u,v,force (N)\n".to_owned();
    for row in 0..50 {
        let (u, v) = (f64::from(row % 7), f64::from(row % 5));
        writeln!(text, "s{},{u},{v},{}", row / 10, u + 2.0 * v).unwrap();
    }
    let (mut driver, _path, _folder) = opened_text(&text);
    assert!(driver.says("group, 20 % test"), "{:#?}", driver.texts());
    assert!(driver.has("Training: 40") && driver.has("Test: 10"), "whole sessions");
    // Another group takes its place, and without one the samples are divided in time.
    driver.mean("u", "group");
    assert_eq!(
        driver.get("Meaning of session").accesskit_node().value().as_deref(),
        Some("unused")
    );
    driver.mean("u", "input");
    assert!(driver.says("time, 20 % test"));
}

#[test]
fn closing_asks_about_a_training_on_own_data() {
    let (mut driver, _path, _folder) = opened(60);
    driver.limit_epochs("100000");
    driver.click("▶ Train");
    driver.wait("an epoch", |driver| !cells(driver).is_empty());
    driver.click("⏸ Pause");
    driver.wait("the hold", |driver| driver.has("Paused"));
    assert!(!close(&mut driver), "the training is not lost unasked");
    driver.harness().run_steps(2);
    assert!(
        driver.has("Own data: Training") && driver.has("can be saved as a checkpoint"),
        "{:#?}",
        driver.texts()
    );
    driver.click_button("Stay");
    driver.click("■ Stop");
    driver.wait("the end", |driver| driver.says("Ended: "));
}

#[test]
fn continue_goes_on_after_another_training_was_stopped_while_it_read_its_files() {
    let (mut driver, path, _folder) = opened(60);
    driver.limit_epochs("3");
    driver.train_own_data();
    // In one frame, so that no file is read yet.
    for (modifiers, key) in [egui::Key::Enter, egui::Key::Period].map(|key| (egui::Modifiers::COMMAND, key)) {
        driver.harness().key_press_modifiers(modifiers, key);
    }
    driver.settle();
    assert!(
        driver.says("Epoch 3 of 3"),
        "the training before stays: {:#?}",
        driver.texts()
    );
    driver.limit_epochs("2");
    driver.click_button("Continue");
    driver.wait("the end", |driver| driver.says("Epoch 5 of 5"));
    driver.settle();
    let rmse = trained(&plan(&path)).target_table()[2].targets[0].rmse;
    let cell = format!("x (mm), network, RMSE: {}", format_number(rmse));
    assert!(driver.has(&cell), "{cell} is not among {:#?}", cells(&driver));
}

#[test]
fn continue_goes_on_after_a_cross_validation() {
    let (mut driver, _path, _folder) = opened(60);
    driver.limit_epochs("3");
    driver.train_own_data();
    driver.click("Cross-validation");
    driver.enter("Folds", "3");
    driver.click_button("Cross-validate");
    driver.wait("the folds", |driver| driver.says("3 folds by time"));
    driver.settle();
    driver.limit_epochs("2");
    driver.click_button("Continue");
    driver.wait("the end", |driver| driver.says("Epoch 5 of 5"));
}

#[test]
fn the_export_menu_has_each_heading_once() {
    let (mut driver, _path, _folder) = opened(40);
    driver.open_menu();
    let texts = driver.texts();
    for heading in ["NETWORK", "FIGURES", "TABLES", "COPY TABLE AS", "TRAINING"] {
        let times = texts.iter().filter(|text| *text == heading).count();
        assert_eq!(times, 1, "{heading} in {texts:#?}");
    }
}
