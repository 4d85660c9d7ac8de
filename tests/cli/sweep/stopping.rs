use std::fs::{self, File};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::driver::{fill, folder_with, incomplete, merged, results, six};
use crate::{
    calls::{SIGNALS, has, number, signal, spawn, wait_until},
    folders::names,
};

#[test]
fn a_killed_sweep_keeps_finished_trials() {
    let folder = folder_with(&six());
    let folder = folder.path();
    let runs = folder.join("runs");
    let mut child = spawn("sweep --spec sweep.json --out runs --threads 1", folder);
    wait_until("two results", || runs.is_dir() && results(&runs).len() >= 2);
    child.kill().unwrap();
    child.wait().unwrap();
    let before = results(&runs);
    let again = fill("--out runs --threads 2", folder);
    assert_eq!(again["present"], before.len());
    assert_eq!(again["trained"], 6 - before.len());
    assert!(results(&runs).is_superset(&before), "existing results are not changed");
    assert!(
        names(&runs).iter().all(|name| name.ends_with(".json")),
        "{:?}",
        names(&runs)
    );
    fill("--out whole", folder);
    assert_eq!(merged("runs", folder), merged("whole", folder));
}

#[test]
fn leftovers_of_a_program_killed_after_its_result_are_removed() {
    let folder = folder_with(&six());
    let folder = folder.path();
    let runs = folder.join("runs");
    fill("--out runs", folder);
    let whole = names(&runs);
    let (first, _) = results(&runs).pop_first().unwrap();
    for extension in ["claim", "checkpoint"] {
        File::create(runs.join(first.replace("json", extension))).unwrap();
    }
    assert_eq!(fill("--out runs", folder)["present"], 6);
    assert_eq!(names(&runs), whole);
}

#[test]
fn two_programs_fill_one_folder() {
    let folder = folder_with(&six());
    let folder = folder.path();
    let start = || spawn("sweep --spec sweep.json --out runs --threads 1 --json", folder);
    let outputs = [start(), start()].map(|child| child.wait_with_output().unwrap());
    let reports = outputs.map(|output| {
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    });
    let sum = |field: &str| reports.iter().map(|report| number(report, field)).sum::<f64>();
    assert_eq!(sum("trained"), 6.0, "no trial is trained twice");
    let left = sum("present") + sum("elsewhere");
    assert_eq!(left, 6.0, "each leaves the others' trials to them");
    assert_eq!(names(&folder.join("runs")).len(), 6, "the results");
}

/// The test acts as the other program: it holds the lock of the first missing trial, as a program that is killed releases
/// it.
#[test]
fn a_trial_of_another_program_is_left_to_it_until_it_ends() {
    let folder = folder_with(&json!({
        "train": {"array": "10x6_3x18", "samples": 100, "epochs": 8, "decoder": "network"},
        "axes": {"seed": [0, 1, 2]},
    }));
    let folder = folder.path();
    fill("--out runs", folder);
    let runs = folder.join("runs");
    let trials = merged("runs", folder);
    let [first, second] = [0, 1].map(|index| trials["trials"][index]["trial"].as_str().unwrap().to_owned());
    let result = |id: &str| runs.join(format!("{id}.json"));
    for id in [&first, &second] {
        fs::remove_file(result(id)).unwrap();
    }
    let other = File::create(runs.join(format!("{first}.claim"))).unwrap();
    other.lock().unwrap();
    let counts = |report: &Value| ["present", "trained", "elsewhere"].map(|field| number(report, field));
    assert_eq!(counts(&fill("--out runs", folder)), [1.0; 3], "the lock is respected");
    assert!(result(&second).exists() && !result(&first).exists());
    let (output, _) = incomplete("sweep --merge runs --out table.csv", folder);
    has(&output, &[&format!("missing: trial {first} (begun, not finished)\n")]);
    drop(other);
    assert_eq!(counts(&fill("--out runs", folder)), [2.0, 1.0, 0.0]);
    assert_eq!(merged("runs", folder), trials);
}

/// Stops a trial of this many epochs after its start; returns its folder, the exit status and standard error.
fn stopped_by(name: &str, epochs: usize) -> (TempDir, i32, String) {
    let folder = folder_with(&json!({
        "train": {"array": "10x6_3x18", "samples": 200, "hidden": 6, "max-fail": 1_000_000, "min-gradient": 0,
                  "decoder": "network", "epochs": epochs},
        "axes": {"seed": [3]},
    }));
    let child = spawn("sweep --spec sweep.json --out runs", folder.path());
    let runs = folder.path().join("runs");
    let is_begun = || names(&runs).iter().any(|name| name.ends_with(".claim"));
    wait_until("the trial has started", || runs.is_dir() && is_begun());
    signal(name, &child);
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    (folder, output.status.code().unwrap(), message)
}

#[test]
fn an_interrupted_trial_is_resumed_bit_for_bit() {
    for (name, status) in SIGNALS {
        // A busy machine may deliver the signal late.
        let attempts = [1000, 10_000, 100_000].into_iter();
        let mut attempts = attempts.map(|epochs| (epochs, stopped_by(name, epochs)));
        let (epochs, (folder, ended, message)) = attempts.find(|(_, (_, ended, _))| *ended != 0).unwrap();
        let folder = folder.path();
        assert_eq!(ended, status, "{message}");
        let last = message.lines().last().unwrap();
        assert_eq!(
            last,
            "interrupted after 0 of 1 trials; the same command trains the rest"
        );
        let runs = names(&folder.join("runs"));
        assert!(runs.iter().any(|name| name.ends_with(".checkpoint")), "{runs:?}");
        assert_eq!(fill("--out runs", folder)["trained"], 1);
        assert_eq!(names(&folder.join("runs")).len(), 1, "the result");
        fill("--out whole", folder);
        let whole = merged("whole", folder);
        assert_eq!(merged("runs", folder), whole);
        assert_eq!(whole["trials"][0]["result"]["epochs"], epochs);
    }
}
