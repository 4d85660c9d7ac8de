//! Recordings as the source of a training: dropped, imported, trained on, saved, missing and relocated.

use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

use decoupler::window::SourceKind;
use decoupler_core::{network::ScalingChoice, scene::RowModel};
use decoupler_files::export::NetworkFile;
use eframe::egui::{self, Rect, accesskit::Role, vec2};
use egui_kittest::kittest::{By, NodeT as _, Queryable as _};

use crate::{
    driver::Driver,
    habits::pause,
    recordings::{opened, opened_text, recording, setup, written},
    sources::run_of,
};

#[track_caller]
fn assert_meanings(driver: &Driver, meanings: &[(&str, &str)]) {
    for (column, meaning) in meanings {
        let value = driver.get(&format!("Meaning of {column}")).accesskit_node().value();
        assert_eq!(value.as_deref(), Some(*meaning), "{column}");
    }
}

/// Clicks the button that opens the form for a path, and types this one.
fn type_path(driver: &mut Driver, button: &str, path: &Path) {
    driver.open_form(button);
    driver.type_into("File", &path.display().to_string());
    driver.click_button("Open");
    driver.settle();
}

#[test]
fn a_dropped_file_is_trained_on_with_one_click_as_by_the_library() {
    let (mut driver, path, _folder) = opened(120);
    assert_eq!(
        (driver.shown(), driver.state().source),
        ("Train", SourceKind::Recording)
    );
    let meanings = [
        ("time", "time"),
        ("u1", "input"),
        ("u2", "input"),
        ("x", "target"),
        ("y", "target"),
    ];
    assert_meanings(&driver, &meanings);
    assert!(driver.has("Training: 96") && driver.has("Test: 24"));
    driver.limit_epochs("5");
    // From here on one click is enough.
    driver.train_recording();
    let run = run_of(&setup(&path));
    assert_eq!(driver.state().run.as_ref().unwrap().settings(), setup(&path).settings());
    assert_eq!(driver.state().result().unwrap().errors, run.errors());
    // The results replace the columns, which a button brings back.
    assert!(!driver.has("Meaning of u1"));
    driver.click_button("Columns…");
    assert!(driver.has("Meaning of u1"));
    driver.click_button("Show results");
    assert!(!driver.has("Meaning of u1"));
}

#[test]
fn from_the_first_start_a_dropped_file_is_an_onnx_network_after_three_clicks() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, "press.csv", &recording(60));
    let mut driver = Driver::open_first(vec2(1440.0, 900.0));
    driver.drop_files(&[&path]);
    driver.wait("the plan", |driver| {
        driver.state().source == SourceKind::Recording && driver.state().setup().is_ok()
    });
    driver.settle();
    // On the screen without scrolling, between the files and the number of hidden nodes.
    let place = |driver: &Driver, text: &str| driver.get(text).rect();
    let choice = place(&driver, "Choose settings automatically");
    let nodes = place(&driver, "Hidden nodes");
    assert!(
        choice.bottom() <= nodes.top() && nodes.bottom() < 900.0,
        "{choice} {nodes}"
    );
    assert!(driver.state().recording.is_auto);
    driver.click("▶ Train");
    driver.wait_for_training();
    driver.export("ONNX, f32");
    let onnx = folder.path().join("network");
    driver.type_into("File", &onnx.display().to_string());
    driver.click_button("Save");
    driver.wait("the file", |driver| driver.notice().is_some());
    let files = fs::read_dir(&onnx).unwrap().map(|file| file.unwrap().path());
    let is_onnx = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "onnx");
    assert_eq!(files.filter(is_onnx).count(), 1, "{:?}", driver.notice());
}

#[test]
fn the_sample_recording_is_trained_on_after_three_clicks() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open_keeping(&folder.path().join("runs"));
    driver.click_button("Recording");
    driver.click_button("Open the sample recording");
    driver.wait("the samples", |driver| driver.says("Test: "));
    driver.settle();
    let meanings = [
        ("press", "group"),
        ("b1", "input"),
        ("b7", "input"),
        ("force", "target"),
        ("x", "target"),
    ];
    assert_meanings(&driver, &meanings);
    driver.assert_has("7 inputs, 3 targets, 900 samples");
    driver.limit_epochs("30");
    driver.train_recording();
    let errors = &driver.state().result().unwrap().errors;
    let force = &errors.targets()[0];
    assert!(force.r2.is_some_and(|r2| r2 > 0.9), "{force:?}");
}

#[test]
fn the_source_selects_the_form_and_keeps_the_settings_of_the_other() {
    let mut driver = Driver::open();
    driver.enter("Hidden nodes", "9");
    driver.click_button("Recording");
    assert!(!driver.has("Array scale") && driver.has("Drop recordings here"));
    assert_eq!(driver.state().settings().hidden, 12);
    // Train is not possible yet; the reason is next to it.
    assert!(!driver.is_enabled("▶ Train"));
    let (reason, train) = (
        "Open a recording first: drop files on the window.",
        driver.get("▶ Train").rect(),
    );
    let texts = driver.harness().get_all_by_label(reason);
    let places = Vec::from_iter(texts.map(|text| text.rect()));
    let is_next_to_it = |place: &Rect| train.y_range().contains(place.center().y) && place.right() <= train.left();
    assert!(places.iter().any(is_next_to_it), "{places:?}");
    driver.choose_by_hand();
    driver.enter("Hidden nodes", "5");
    driver.unfold_to("Advanced", "Scaling");
    driver.choose("Scaling", "Whitening");
    driver.settle();
    let chosen = driver.state().settings();
    assert_eq!((chosen.hidden, chosen.inputs.scaling), (5, ScalingChoice::Whitening));
    driver.click_button("Simulated array");
    driver.settle();
    assert_eq!(driver.state().settings().hidden, 9);
    assert!(driver.has("Array scale") && !driver.has("Drop recordings here"));
}

#[test]
fn a_network_file_brings_back_its_settings_its_recording_and_its_run() {
    let (mut driver, path, folder) = opened(60);
    driver.choose_by_hand();
    driver.enter("Hidden nodes", "4");
    driver.limit_epochs("3");
    driver.train_recording();
    let saved = folder.path().join("network.json");
    driver.save("Network file, JSON", &saved);
    let file = NetworkFile::load(&saved).unwrap();

    let mut other = Driver::open();
    other.drop_files(&[&saved]);
    other.wait("the import", |driver| driver.state().setup().ok() == Some(file.setup()));
    other.wait("the run", |driver| driver.runs().len() == 1);
    assert_eq!(*other.kept(0), file);
    assert!(other.has("Hidden nodes") && other.state().settings().hidden == 4);
    // Opening it again does not add another run.
    other.drop_files(&[&saved]);
    other.wait("the end", |driver| !driver.says("Reading "));
    other.settle();
    assert_eq!(other.runs().len(), 1);

    // Its recording is moved.
    let moved = folder.path().join("elsewhere.csv");
    fs::rename(&path, &moved).unwrap();
    let mut without = Driver::open();
    without.drop_files(&[&saved]);
    without.wait("what is missing", |driver| driver.has("press.csv is missing."));
    without.settle();
    assert_eq!(without.state().settings().hidden, 4);
    assert!(without.state().setup().unwrap_err().contains("press.csv is missing"));
    type_path(&mut without, "Find press.csv", &moved);
    without.wait("the samples", |driver| driver.has("Training: 48"));
    assert!(!without.says("is missing") && !without.says("has changed since"));
    assert_eq!(without.plan().import.data, moved);
}

#[test]
fn a_changed_recording_is_reported() {
    let (mut driver, path, folder) = opened(60);
    driver.limit_epochs("2");
    driver.train_recording();
    let [network, checkpoint] = ["network.json", "half.checkpoint"].map(|name| folder.path().join(name));
    driver.save("Network file, JSON", &network);
    driver.save("Checkpoint, resumable", &checkpoint);
    fs::remove_file(&path).unwrap();
    let changed = written(&folder, "changed.csv", &recording(50));

    let mut other = Driver::open();
    other.drop_files(&[&network]);
    other.wait("what is missing", |driver| driver.has("press.csv is missing."));
    type_path(&mut other, "Find press.csv", &changed);
    other.wait("the samples", |driver| driver.has("Training: 40"));
    assert!(other.has("changed.csv has changed since the run was saved."));

    // A training cannot be resumed on other samples.
    let mut resumed = Driver::open();
    resumed.drop_files(&[&checkpoint]);
    resumed.wait("what is missing", |driver| driver.has("press.csv is missing."));
    type_path(&mut resumed, "Find press.csv", &changed);
    resumed.wait("the reason", |driver| {
        driver.says("changed.csv has changed since the training was saved")
    });
    assert!(resumed.has("press.csv is missing.") && resumed.state().run.is_none());
    // With the right file, which is elsewhere, it continues where it stopped.
    let found = written(&folder, "found.csv", &recording(60));
    type_path(&mut resumed, "Find press.csv", &found);
    resumed.wait("the training", |driver| driver.state().result().is_some());
    resumed.settle();
    assert_eq!(resumed.state().result().unwrap().epochs_run, 2);
    assert_eq!(
        resumed.state().run.as_ref().unwrap().setup.plan().unwrap().import.data,
        found
    );
}

#[test]
fn files_dropped_while_a_training_runs_change_nothing() {
    let (mut driver, path, folder) = opened(60);
    let other = written(&folder, "other.csv", &recording(40));
    driver.limit_epochs("1000000");
    driver.click("▶ Train");
    driver.wait("an epoch", |driver| driver.state().result().is_some());
    driver.drop_files(&[&other]);
    driver.wait("the refusal", |driver| {
        driver.says("A training is running: stop it first.")
    });
    assert!(driver.is_enabled("⏸ Pause"));
    driver.click("■ Stop");
    driver.wait_for_end();
    driver.settle();
    assert_eq!(driver.plan().import.data, path);
    assert!(!driver.says("other.csv"));
}

#[test]
fn the_recording_is_open_again_at_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("window.json");
    let path = written(&folder, "press.csv", &recording(60));
    let mut driver = Driver::open_remembering(&file);
    driver.open_recordings(&[&path]);
    driver.mean("y", "unused");
    driver.choose_by_hand();
    driver.enter("Hidden nodes", "7");
    let setup = driver.state().setup().unwrap();
    drop(driver);

    let mut next = Driver::open_remembering(&file);
    next.wait("the samples", |driver| driver.says("Test: "));
    assert_eq!(next.state().setup().unwrap(), setup);
    drop(next);

    fs::rename(&path, folder.path().join("moved.csv")).unwrap();
    let mut without = Driver::open_remembering(&file);
    without.wait("what is missing", |driver| driver.has("press.csv is missing."));
    without.click_button("Clear");
    without.settle();
    assert!(without.has("Drop recordings here"));
    drop(without);
    let mut cleared = Driver::open_remembering(&file);
    cleared.settle();
    cleared.assert_has("Drop recordings here");
}

#[test]
fn undo_restores_a_meaning() {
    let (mut driver, _path, _folder) = opened(40);
    driver.settle();
    // Changes within a second count as one.
    pause(&mut driver);
    driver.mean("y", "unused");
    pause(&mut driver);
    assert_eq!(driver.plan().import.targets, ["x"]);
    driver.press_with(egui::Modifiers::COMMAND, egui::Key::Z);
    driver.wait("the meaning", |driver| {
        let value = driver.get("Meaning of y").accesskit_node().value();
        value.as_deref() == Some("target")
    });
    driver.settle();
    assert_eq!(driver.plan().import.targets, ["x", "y"]);
}

#[test]
fn cleared_files_are_brought_back_with_a_click_where_clear_was() {
    let (mut driver, path, _folder) = opened(40);
    driver.mean("y", "unused");
    pause(&mut driver);
    let plan = |driver: &Driver| driver.state().setup().map(|setup| setup.plan().cloned());
    let before = plan(&driver);
    let place = driver.get("Clear").rect();
    driver.click_button("Clear");
    driver.settle();
    assert!(plan(&driver).is_err() && driver.has("Drop recordings here"));
    assert_eq!(driver.get("Undo: Clear").rect().left_top(), place.left_top());
    driver.click_button("Undo: Clear");
    driver.wait("the samples", |driver| driver.says("Test: "));
    assert_eq!(plan(&driver), before);
    assert_meanings(&driver, &[("y", "unused")]);

    // So does undoing by the keyboard; closing the last file is the same.
    pause(&mut driver);
    driver.click(&format!("Close {}", path.file_name().unwrap().display()));
    pause(&mut driver);
    assert!(driver.has("Undo: Clear"));
    driver.press_with(egui::Modifiers::COMMAND, egui::Key::Z);
    driver.wait("the samples", |driver| driver.says("Test: "));
    assert!(driver.says("Undone: Clear"), "{:?}", driver.notice());
    assert_eq!(plan(&driver), before);
}

#[test]
fn row_wires_offer_a_network_for_each_and_without_them_there_is_one() {
    let mut text = "row,u,v,force (N)\n".to_owned();
    for row in 0..60 {
        let (u, v) = (f64::from(row % 7), f64::from(row % 5));
        writeln!(text, "{},{u},{v},{}", row % 3 + 1, u + 2.0 * v).unwrap();
    }
    let (mut driver, _path, _folder) = opened_text(&text);
    driver.mean("row", "row-wire");
    driver.unfold_to("Advanced", "Rows");
    driver.choose("Rows", "Known");
    driver.settle();
    assert_eq!(driver.state().settings().source.row_model(), RowModel::Each);
    driver.mean("row", "unused");
    driver.settle();
    assert_eq!(driver.state().settings().source.row_model(), RowModel::Shared);
    assert!(!driver.has("Rows"));
}

#[test]
fn the_method_decides_what_is_held_out_until_the_user_does() {
    let (mut driver, _path, _folder) = opened(60);
    let held_out = |driver: &Driver| driver.plan().division.validation_fraction;
    assert_eq!(held_out(&driver), Some(0.0));
    driver.choose_by_hand();
    crate::configuring::choose_method(&mut driver, "Levenberg-Marquardt");
    driver.settle();
    assert_eq!(held_out(&driver), Some(0.2));
    driver.unfold_to("Samples", "Validation share");
    driver.enter("Validation share", "30");
    driver.enter("Hidden nodes", "3");
    driver.settle();
    assert_eq!(held_out(&driver), Some(0.3));
}

#[test]
fn the_recipe_of_an_array_restores_it() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = folder.path().join("recipe.json");
    let mut driver = Driver::open();
    driver.configure_small();
    driver.save("Recipe, JSON", &recipe);
    let source = driver.state().draft.source;
    let mut other = Driver::open();
    other.click_button("Recording");
    other.drop_files(&[&recipe]);
    other.wait("the array", |driver| driver.state().draft.source == source);
    other.settle();
    assert_eq!(other.state().source, SourceKind::Array);
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
    // In any order: the file with the readings is recognised by its name.
    driver.open_recordings(&[&states, &sensor]);
    let meanings = [
        ("c1", "time"),
        ("c2", "input"),
        ("states.c1", "time"),
        ("states.c2", "target"),
        ("states.c3", "target"),
    ];
    assert_meanings(&driver, &meanings);
    driver.assert_says("10 rows without partner, 0 of its rows unused");
    driver.mean("states.c3", "unused");
    driver.unfold_to("Filter", "Only rows with");
    // The field keeps the focus while the text cannot be understood yet.
    driver.type_into("Only rows with", "s");
    driver.settle();
    driver.harness().event(egui::Event::Text("tates.c3 < 3".to_owned()));
    driver.settle();
    driver.press(egui::Key::Enter);
    driver.wait("the filtered samples", |driver| driver.says("states.c3<3 is not met"));
    driver.wait("the samples", |driver| driver.has("Test: 11"));
    assert!(driver.has("Training: 42"), "53 of 70 rows are left");
    let plan = driver.plan();
    assert_eq!(plan.import.targets, ["states.c2"]);
    assert_eq!(plan.import.conditions[0].to_string(), "states.c3<3");
}

#[test]
fn bad_cells_are_listed_by_line_and_column_and_can_be_declared_missing() {
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
    driver.assert_says("line 3, column 2: 'n.d.' is not a number");
    // A column with an unreadable cell is not used by default.
    driver.wait("the samples", |driver| driver.has("Training: 4"));
    driver.mean("v", "input");
    driver.wait("the reason", |driver| driver.says("is not a finite number"));
    assert!(
        !driver.says("--missing"),
        "the window names no argument of the terminal"
    );
    driver.unfold_to("Filter", "Missing cells");
    driver.enter("Missing cells", "n.d.");
    driver.wait("the rest", |driver| {
        driver.has("Training: 3") && driver.says("v is missing")
    });
    // The columns are read and the samples counted by different threads.
    driver.wait("the missing cell", |driver| driver.has("v, missing: 1"));
}

#[test]
fn a_number_that_means_none_is_declared_missing_before_a_training() {
    let mut text = "u,v,force (N)\n".to_owned();
    for row in 0..80 {
        let force = if row % 9 == 4 { -999 } else { row % 11 };
        writeln!(text, "{}.5,{},{force}", row % 7, row % 5).unwrap();
    }
    let (mut driver, _path, _folder) = opened_text(&text);
    driver.click_button("Treat −999 as missing");
    driver.wait("the missing cells", |driver| driver.has("force, missing: 9"));
    driver.wait("the samples", |driver| driver.says("Test: "));
    driver.settle();
    assert!(!driver.says("Treat −999 as missing") && driver.state().run.is_none());
}

#[test]
fn a_random_split_is_reported_as_optimistic() {
    let (mut driver, _path, _folder) = opened(40);
    assert!(!driver.says("A random split is optimistic"));
    driver.unfold_to("Samples", "Split by");
    driver.choose("Split by", "random");
    driver.settle();
    assert!(driver.says("A random split is optimistic"));
    driver.click("Split by");
    driver.settle();
    let group = By::new().role(Role::Button).label("group");
    assert!(
        driver.harness().query(group).is_none(),
        "without groups there is no such split"
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
    driver.assert_says("group, 20 % test");
    assert!(driver.has("Training: 40") && driver.has("Test: 10"), "whole sessions");
    // Whole sessions are another share than the one asked for.
    driver.unfold_to("Samples", "Test share");
    driver.enter("Test share", "30");
    driver.wait("two sessions", |driver| driver.says("group, 40 % test"));
    driver.enter("Test share", "20");
    // Another group replaces it, and without one the samples are divided by time.
    driver.mean("u", "group");
    assert_meanings(&driver, &[("session", "unused")]);
    driver.mean("u", "input");
    assert!(driver.says("time, 20 % test"));
}
