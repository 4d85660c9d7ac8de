//! Columns of a recording that are computed from others, variables of a workspace, and several files of one experiment.

use std::path::PathBuf;

use decoupler_core::dataset::SplitBy;
use decoupler_files::import::Plan;
use egui_kittest::kittest::NodeT as _;
use tempfile::TempDir;

use crate::{
    driver::Driver,
    recordings::{opened, recording, written},
};

fn plan(driver: &Driver) -> Plan {
    driver.plan()
}

fn meaning(driver: &Driver, column: &str) -> Option<String> {
    driver.get(&format!("Meaning of {column}")).accesskit_node().value()
}

#[test]
fn columns_are_computed_from_others_and_wrong_expressions_are_refused_with_the_reason() {
    let (mut driver, path, _folder) = opened(90);
    driver.unfold_to("Computed columns", "Expressions");
    driver.enter("Expressions", "d=u1-u2, r=u1/start(1s)");
    driver.wait("the new columns", |driver| driver.has("Meaning of r"));
    driver.wait("the samples", |driver| driver.says("Test: "));
    driver.settle();
    driver.mean("d", "input");
    driver.mean("r", "input");
    driver.mean("u1", "unused");
    let import = plan(&driver).import;
    assert_eq!(import.inputs, ["u2", "d", "r"]);
    let derive = Vec::from_iter(import.derive.iter().map(ToString::to_string));
    assert_eq!(derive, ["d=u1 - u2", "r=u1 / start(1s)"]);
    driver.limit_epochs("5");
    driver.train_recording();
    let run = driver.state().run.as_ref().unwrap();
    assert_eq!(run.problem.inputs[1].name, "d");
    assert_eq!(run.setup.plan().unwrap().import.data, path);

    driver.click_button("Columns…");
    driver.enter("Expressions", "d=u1");
    driver.assert_says("it has neither - nor /");
    driver.enter("Expressions", "d=u1-v");
    driver.wait("the refusal", |driver| {
        driver.says("there is no column 'v' in the same file")
    });
    driver.enter("Expressions", " ");
    driver.wait("the files", |driver| !driver.has("Meaning of d"));
    assert_eq!(plan(&driver).import.derive, []);
}

/// A MAT-file of level 5 with these matrices of doubles: name, rows, and numbers column by column.
fn workspace(variables: &[(&str, u32, Vec<f64>)]) -> Vec<u8> {
    let mut file = [b' '; 128];
    file[124..].copy_from_slice(&[0, 1, b'I', b'M']);
    let mut file = file.to_vec();
    let element = |kind: u32, bytes: &[u8]| {
        let mut all = [kind.to_le_bytes(), (bytes.len() as u32).to_le_bytes()].concat();
        all.extend(bytes);
        all.resize(all.len().next_multiple_of(8), 0);
        all
    };
    for (name, rows, numbers) in variables {
        let columns = numbers.len() as u32 / rows;
        let of = |numbers: [u32; 2]| numbers.map(u32::to_le_bytes).concat();
        let numbers = Vec::from_iter(numbers.iter().flat_map(|number| number.to_le_bytes()));
        let matrix = [
            element(6, &of([6, 0])),
            element(5, &of([*rows, columns])),
            element(1, name.as_bytes()),
            element(9, &numbers),
        ];
        file.extend(element(14, &matrix.concat()));
    }
    file
}

#[test]
fn variables_are_listed_with_their_shapes_and_chosen_by_name() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("skin.mat");
    let numbers = |count: u32, factor: f64| Vec::from_iter((0..count).map(|row| (factor * f64::from(row)).sin()));
    let variables = [
        ("skin", 120, numbers(360, 0.7)),
        ("push", 120, numbers(120, 0.3)),
        ("gauge", 50, numbers(100, 0.9)),
        ("gain", 50, numbers(50, 0.4)),
    ];
    std::fs::write(&path, workspace(&variables)).unwrap();
    let mut driver = Driver::open();
    driver.open_recordings(&[&path]);
    driver.settle();
    for shape in ["120 × 3", "50 × 2", "50 × 1"] {
        driver.assert_says(shape);
    }
    assert!(!driver.has("Meaning of gauge.c1"));
    driver.click("Select all of skin");
    driver.mean("skin.c1", "target");
    driver.mean("push", "input");
    driver.settle();
    let import = plan(&driver).import;
    assert_eq!(
        (import.inputs, import.targets),
        (
            vec!["push".to_owned()],
            ["skin.c1", "skin.c2", "skin.c3"].map(str::to_owned).to_vec()
        )
    );

    // The rows of a variable that is left out become the samples.
    driver.click_button("Use the rows of gauge");
    driver.wait("its columns", |driver| driver.has("Meaning of gauge.c1"));
    assert!(!driver.has("Meaning of push") && driver.has("Use the rows of skin"));
    driver.mean("gain", "target");
    driver.wait("the samples", |driver| driver.says("Training: 40"));
    assert_eq!(meaning(&driver, "gauge.c2").as_deref(), Some("input"));
    let import = plan(&driver).import;
    assert_eq!(
        (import.inputs.join(" "), import.targets.join(" ")),
        ("gauge.c1 gauge.c2".to_owned(), "gain".to_owned())
    );
    // And back.
    driver.click_button("Use the rows of skin");
    driver.wait("the first columns", |driver| {
        driver.has("Meaning of skin.c3") && !driver.has("Meaning of gauge.c1")
    });
}

#[test]
fn several_files_with_the_same_columns_are_appended_and_each_is_a_group() {
    let folder = TempDir::new().unwrap();
    let paths: Vec<PathBuf> = [60, 50, 40, 45, 55]
        .iter()
        .enumerate()
        .map(|(number, rows)| written(&folder, &format!("press_{number}.csv"), &recording(*rows)))
        .collect();
    let mut driver = Driver::open();
    driver.open_recordings(&Vec::from_iter(paths.iter().map(|path| path.as_path())));
    driver.settle();
    driver.assert_has("press_4.csv, appended");
    let plan_of_all = plan(&driver);
    assert_eq!(
        (plan_of_all.import.append.len(), plan_of_all.division.by),
        (4, SplitBy::Group)
    );
    driver.assert_says("250 samples");
    driver.limit_epochs("3");
    driver.train_recording();
    // One more file joins them, and one is closed.
    driver.click_button("Columns…");
    let more = written(&folder, "press_5.csv", &recording(30));
    driver.drop_files(&[&more]);
    driver.wait("the new file", |driver| driver.says("280 samples"));
    driver.click("Close press_1.csv");
    driver.wait("the rest", |driver| driver.says("230 samples"));
    assert_eq!(plan(&driver).import.append.len(), 4);
}
