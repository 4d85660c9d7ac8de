//! Trainings configured in the form give the networks of the terminal, bit by bit.

use std::{fs, path::Path};

use decoupler_core::training::Method;
use serde_json::Value;

use crate::{configuring::choose_method, driver::Driver, terminal::decoupler};

/// Options of every training of an array, and of a recording.
const ARRAY: &str = "--epochs 8 --samples 120 --set validation-samples=40 --set test-samples=40 --hidden 4";
const RECORDING: &str = "--hidden 3 --epochs 8";

/// What the terminal's options of an array are in the form.
fn configure(driver: &mut Driver, options: &str) {
    if options.contains("noise") || options.contains("adc") {
        driver.unfold_to("Noise on resistance", "Relative noise");
    }
    let words: Vec<_> = options.split_whitespace().collect();
    for pair in words.chunks(2) {
        let (option, value) = match pair {
            ["--set", setting] => setting.split_once('=').unwrap(),
            pair => (pair[0], pair[1]),
        };
        let percent = || (100.0 * value.parse::<f64>().unwrap()).to_string();
        match (option, value) {
            ("--preset", "best") => driver.choose("Preset", "Best accuracy"),
            ("--array", scale) => driver.enter("Array scale", scale),
            ("--epochs", epochs) => driver.enter("Epochs", epochs),
            ("--samples", samples) => driver.enter("Training samples", samples),
            ("validation-samples", samples) => driver.enter("Validation samples", samples),
            ("test-samples", samples) => driver.enter("Test samples", samples),
            ("--hidden", hidden) => driver.enter("Hidden nodes", hidden),
            ("--seed", seed) => driver.enter("Seed", seed),
            ("--rows", "known") => driver.choose("Rows", "Known"),
            ("--rows", row) => {
                driver.choose("Rows", "One");
                driver.enter("Row", row);
            }
            ("--axes", _) => driver.choose("Axes", "x, y, z"),
            ("--loading", "indenter") => driver.choose("Loading", "Indenter"),
            ("--loading", smooth) => {
                driver.choose("Loading", "Smooth field");
                driver.enter("Correlation length", smooth.strip_prefix("smooth:").unwrap());
            }
            ("--noise", _) => driver.enter("Relative noise", &percent()),
            ("drift", _) => driver.enter("Drift", &percent()),
            ("noise-ohm", ohm) => driver.enter("Additive noise", ohm),
            ("adc-bits", bits) => driver.enter("Converter bits", bits),
            ("noise-in", "test") => driver.choose("Noise in", "Test"),
            ("--inputs", "conductance") => driver.choose("Inputs", "Conductance"),
            ("--inputs", "log") => driver.choose("Inputs", "Log-resistance"),
            ("--scaling", "whiten") => driver.choose("Scaling", "Whitening"),
            ("--method", method) => choose_method(driver, method_name(method)),
            ("--starts", starts) => driver.enter("Restarts", starts),
            ("combine", "mean") => {
                driver.choose("Combine restarts", "average their answers");
            }
            ("--sensor", "tiny.json") => driver.enter("Resistivity", "1e-12"),
            ("--sensor", "huge.json") => driver.enter("Resistivity", "1e12"),
            ("--sensor", "full.json") => driver.enter("Height", "0.001"),
            (option, value) => panic!("{option} {value} has no field"),
        }
    }
}

fn method_name(short: &str) -> &'static str {
    let method = Method::all().into_iter().find(|method| method.short_name() == short);
    method.unwrap_or_else(|| panic!("no method {short}")).name()
}

/// Sensors with resistances of 1e-12 and 1e12 Ω per mm, and with a stroke of micrometres.
fn write_sensors(folder: &Path) {
    for (name, height_mm, resistivity) in [("tiny", 5.0, 1e-12), ("huge", 5.0, 1e12), ("full", 1e-3, 100.0)] {
        let text = format!(
            r#"{{"format": "decoupler sensor", "version": 1, "program": "decoupler 0.1.0", "sensor": {{"scale": "4x3_2x9",
            "geometry": {{"height_mm": {height_mm}, "row_x0_mm": 8.0, "row_pitch_mm": 1.0, "node_pitch_mm": 2.0,
            "column_y0_mm": 1.0, "column_pitch_mm": 1.0, "column_node_x0_mm": 14.0, "column_node_pitch_mm": 5.0}},
            "resistivity_ohm_per_mm": {resistivity}}}}}"#
        );
        fs::write(folder.join(format!("{name}.json")), text).unwrap();
    }
}

/// Returns the run of a network file: settings, what was trained on, networks and training record, all numbers in full.
fn run_of(path: &Path) -> Value {
    let mut file: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    without_times(&mut file);
    file["run"].take()
}

/// Removes measured times, which no two trainings have in common.
fn without_times(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            fields.retain(|name, _| !name.contains("seconds") && !name.ends_with("_s"));
            fields.values_mut().for_each(without_times);
        }
        Value::Array(values) => values.iter_mut().for_each(without_times),
        _ => {}
    }
}

/// Trains in the terminal with these options.
#[track_caller]
fn train_in_terminal(options: &str, folder: &Path) -> Value {
    let output = decoupler(&format!("train {options} --decoder mean --out terminal.json"), folder);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{options}: {message}");
    run_of(&folder.join("terminal.json"))
}

#[track_caller]
fn assert_same(options: &str, terminal: &Value, driver: &mut Driver, folder: &Path) {
    let path = folder.join("window.json");
    driver.save("Network file, JSON", &path);
    let window = run_of(&path);
    fs::remove_file(&path).unwrap();
    let (Value::Object(window), Value::Object(terminal)) = (window, terminal) else {
        panic!("{options}: no run")
    };
    for (name, value) in terminal {
        assert_eq!(window.get(name), Some(value), "{options}: {name}");
    }
}

fn check_arrays(configurations: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    write_sensors(folder.path());
    let mut driver = Driver::open();
    for options in configurations {
        // The preset comes first, because it sets what other options change.
        let options = format!("{options} {}", if options.contains("--hidden") { "" } else { ARRAY });
        let terminal = train_in_terminal(&options, folder.path());
        // Nothing is left of the configuration before.
        driver.choose("Preset", "Paper");
        configure(&mut driver, &options);
        if options.contains("--sensor") {
            driver.enter("Array scale", "4x3_2x9");
        }
        driver.settle();
        driver.train();
        assert_same(&options, &terminal, &mut driver, folder.path());
    }
}

#[test]
fn arrays_of_all_sizes() {
    check_arrays(&[
        "--array 10x10_5x30",
        "--array 10x8_4x24 --seed 1",
        "--array 10x6_3x18 --rows known",
        "--array 10x6_3x18 --rows 3",
        "--array 1x1_1x3",
        "--array 1x2_1x6 --rows known",
        "--array 2x1_1x3 --axes xyz",
        "--array 4x3_2x9 --axes xyz",
        "--array 20x40_3x120 --epochs 2 --samples 40 --set validation-samples=20 --set test-samples=20 --hidden 2",
        "--array 200x2_3x6 --epochs 2 --samples 400 --set validation-samples=200 --set test-samples=200 --hidden 2",
    ]);
}

#[test]
fn scenes_of_all_kinds() {
    check_arrays(&[
        "--array 4x3_2x9 --loading smooth:3",
        "--array 4x3_2x9 --loading indenter",
        "--array 4x3_2x9 --noise 1e-4",
        "--array 4x3_2x9 --noise 1e-2 --rows known",
        "--array 4x3_2x9 --noise 1",
        "--array 4x3_2x9 --noise 1e-3 --set drift=1e-2",
        "--array 4x3_2x9 --set noise-ohm=0.5",
        "--array 4x3_2x9 --set adc-bits=12",
        "--array 4x3_2x9 --set adc-bits=1",
        "--array 4x3_2x9 --noise 1e-3 --set noise-in=test",
    ]);
}

#[test]
fn networks_and_methods_of_all_kinds() {
    check_arrays(&[
        "--array 4x3_2x9 --inputs conductance --scaling whiten",
        "--array 4x3_2x9 --inputs log",
        "--array 4x3_2x9 --method br",
        "--array 4x3_2x9 --method scg",
        "--array 4x3_2x9 --method gd",
        "--array 4x3_2x9 --method rp",
        "--array 4x3_2x9 --starts 3",
        "--preset best --array 4x3_2x9",
        "--array 4x3_2x9 --seed 5 --hidden 1 --epochs 8 --samples 120",
        "--sensor tiny.json",
        "--sensor huge.json",
        "--sensor full.json --loading indenter",
    ]);
}

/// Import, and settings of the training.
const RECORDED: [(&str, &str); 8] = [
    ("", ""),
    ("", "--method br --seed 3"),
    ("--time time --history 0.5s", ""),
    ("--time time --group press --split group --history 20", ""),
    ("--split random", "--starts 2 --set combine=mean"),
    ("--derive d=u-v", "--method scg"),
    ("--missing -1 --where u>-100", "--scaling whiten"),
    ("--validation-fraction 0", "--method br --starts 2"),
];

#[test]
fn recordings_of_all_kinds() {
    let folder = tempfile::tempdir().unwrap();
    let press = include_str!("../fixtures/version_0.1.0/press.csv");
    fs::write(folder.path().join("press.csv"), press).unwrap();
    for (import, settings) in RECORDED {
        let inspected = decoupler(
            &format!("inspect --data press.csv --inputs u,v --targets force {import} --recipe-out recipe.json"),
            folder.path(),
        );
        assert!(inspected.status.success(), "{import}: {inspected:?}");
        let options = format!("--recipe recipe.json {RECORDING} {settings}");
        let terminal = train_in_terminal(&options, folder.path());
        let mut driver = Driver::open();
        driver.open_recordings(&[&folder.path().join("recipe.json")]);
        driver.choose_by_hand();
        for (part, field) in [
            ("When to stop", "Epochs"),
            ("Method settings", "Restarts"),
            ("Network inputs", "Scaling"),
            ("Samples", "Seed"),
        ] {
            driver.unfold_to(part, field);
        }
        configure(&mut driver, &format!("{RECORDING} {settings}"));
        driver.settle();
        driver.click("▶ Train");
        driver.wait_for_training();
        assert_same(&options, &terminal, &mut driver, folder.path());
    }
}
