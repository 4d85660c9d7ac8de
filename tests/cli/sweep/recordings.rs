//! Sweeps of recordings.

use std::{fs, path::Path};

use serde_json::{Value, json};

use super::driver::{fill, folder_with, merged};
use crate::{
    calls::{self, has, read, refused, success, write},
    folders::names,
    terminal::decoupler,
};

fn write_recording(path: &Path) {
    let mut text = "time,a,b,c,fx (N),fz (N)\n".to_owned();
    for sample in 0..80 {
        let time = f64::from(sample);
        let (x, z) = ((0.3 * time).sin(), (0.17 * time).cos());
        let (a, b, c) = (x + 0.2 * z, z - 0.3 * x * z, (x + z).tanh());
        text += &format!("{time},{a:.4},{b:.4},{c:.4},{x:.4},{z:.4}\n");
    }
    fs::write(path, text).unwrap();
}

/// Eight trials on `press.csv` in the folder of the specification.
fn eight() -> Value {
    json!({
        "train": {"data": "press.csv", "inputs": ["a..c"], "targets": ["fx", "fz"], "epochs": 8},
        "axes": {"hidden": [2, 4], "method": ["lm", "br"], "seed": [0, 7]},
    })
}

/// Identifiers of the trials of a table.
fn trials(table: &Value) -> Vec<&str> {
    let trials = table["trials"].as_array().unwrap().iter();
    trials.map(|trial| trial["trial"].as_str().unwrap()).collect()
}

/// Number of trials in both tables.
fn shared(one: &Value, other: &Value) -> usize {
    let others = trials(other);
    trials(one).into_iter().filter(|trial| others.contains(trial)).count()
}

#[test]
fn parts_of_a_sweep_from_different_folders_merge_to_the_table_of_one_process() {
    let folder = folder_with(&eight());
    let folder = folder.path();
    write_recording(&folder.join("press.csv"));
    fill("--out whole", folder);
    let whole = merged("whole", folder);
    assert_eq!(trials(&whole).len(), 8);
    fill("--out first --shard 1/2 --threads 1", folder);
    let elsewhere = folder.join("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    for file in ["press.csv", "sweep.json"] {
        fs::copy(folder.join(file), elsewhere.join(file)).unwrap();
    }
    fill("--out second --shard 2/2", &elsewhere);
    assert_eq!(merged("first elsewhere/second", folder), whole);
    // No file contains the folder of the recording.
    let place = folder.to_str().unwrap();
    for name in names(&folder.join("whole")) {
        let text = read(&folder.join("whole"), &name);
        assert!(!text.contains(place), "{name}: {text}");
    }
    success("sweep --merge whole --out table.csv", folder);
    has(
        read(folder, "table.csv").lines().next().unwrap(),
        &["result.targets.fx.rmse"],
    );
}

#[test]
fn a_trial_has_the_output_of_train() {
    let folder = folder_with(&eight());
    let folder = folder.path();
    write_recording(&folder.join("press.csv"));
    fill("--out runs", folder);
    let table = merged("runs", folder);
    for trial in table["trials"].as_array().unwrap() {
        let options = &trial["options"];
        let (hidden, seed) = (&options["hidden"], &options["seed"]);
        let method = options["method"].as_str().unwrap();
        let of_trial = format!("--epochs 8 --hidden {hidden} --method {method} --seed {seed}");
        let train = format!("train --data press.csv --inputs a..c --targets fx,fz --intervals never {of_trial} --json");
        let printed = calls::json(&train, folder);
        for field in ["targets", "baselines", "starts", "samples", "warnings"] {
            assert_eq!(trial["result"][field], printed[field], "{field}, {options}");
        }
        assert!(options["crc32"].is_array() && options["data"] == "press.csv");
        // Bayesian regularisation holds out no samples, as in train.
        let held_out = if method == "br" { 0.0 } else { 0.2 };
        assert_eq!(options["validation-fraction"], held_out);
    }
}

#[test]
fn arguments_a_recipe_and_a_recording_in_the_specification_are_the_same_trials() {
    let folder = folder_with(&eight());
    let folder = folder.path();
    write_recording(&folder.join("press.csv"));
    fill("--out whole", folder);
    let whole = merged("whole", folder);
    let data = "--data press.csv --inputs a..c --targets fx,fz";
    let axes = "--hidden 2,4 --method lm,br --epochs 8 --seeds 2";
    success(&format!("sweep {data} {axes} --out arguments --json"), folder);
    let of_arguments = merged("arguments", folder);
    assert_eq!(trials(&of_arguments).len(), 8);
    assert_eq!(shared(&of_arguments, &whole), 4, "seed 0 is shared, seed 1 is not");
    success(
        &format!("inspect {data} --validation-fraction 0.2 --recipe-out press.recipe --json"),
        folder,
    );
    let axes = json!({"hidden": [2, 4], "method": ["lm"], "seed": [0, 7]});
    let recipe = json!({
        "train": {"recipe": "press.recipe", "epochs": 8},
        "axes": axes,
    });
    let recording = json!({
        "recording": {"import": {"data": "press.csv", "inputs": ["a..c"], "targets": ["fx", "fz"]}},
        "train": {"epochs": 8},
        "axes": axes,
    });
    for (name, specification) in [("recipe", recipe), ("recording", recording)] {
        write(folder, &format!("{name}.json"), specification.to_string());
        success(&format!("sweep --spec {name}.json --out {name} --json"), folder);
        let table = merged(name, folder);
        assert_eq!((trials(&table).len(), shared(&table, &whole)), (4, 4), "{name}");
    }
}

#[test]
fn invalid_sweeps_of_recordings_are_refused() {
    let folder = folder_with(&eight());
    let folder = folder.path();
    refused("sweep --spec sweep.json --out runs", folder, 2, "press.csv");
    write_recording(&folder.join("press.csv"));
    for (option, value, expected) in [
        ("array", json!("10x6_3x18"), "a recording (--data) has no array"),
        ("folds", json!(3), "a sweep manages its results"),
        ("split", json!("group"), "give the group column with --group"),
    ] {
        let mut specification = eight();
        specification["train"][option] = value;
        write(folder, "wrong.json", specification.to_string());
        let output = decoupler("sweep --spec wrong.json --out runs", folder);
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(
            !output.status.success() && message.contains(expected),
            "{option}: {message}"
        );
    }
}
