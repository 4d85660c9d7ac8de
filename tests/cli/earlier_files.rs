//! Files written by version 0.1.0 before the core was rebuilt: each gives the same answers, or is refused in one line that
//! names what is not supported.

use std::{fs, path::Path};

use tempfile::TempDir;

use crate::calls::{column, json, read, success};

/// A copy of the files.
fn files() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy(
        &Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/version_0.1.0"),
        folder.path(),
    );
    folder
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let copied = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &copied);
        } else {
            fs::copy(entry.path(), copied).unwrap();
        }
    }
}

/// Numbers that agree to this tolerance, relative to 1 or to their size; texts that are equal.
fn assert_same(found: &str, expected: &str, tolerance: f64) {
    assert_eq!(found.lines().count(), expected.lines().count());
    for (found, expected) in found.lines().zip(expected.lines()) {
        assert_eq!(found.split(',').count(), expected.split(',').count());
        for (one, other) in found.split(',').zip(expected.split(',')) {
            match (one.parse::<f64>(), other.parse::<f64>()) {
                (Ok(one), Ok(other)) => {
                    assert!(
                        (one - other).abs() <= tolerance * other.abs().max(1.0),
                        "{found}\n{expected}"
                    );
                }
                _ => assert_eq!(one, other),
            }
        }
    }
}

#[test]
fn networks_give_the_same_answers() {
    for (network, input, expected) in [
        ("array.json", "array.csv", "array.decoded.csv"),
        ("recording.json", "press.csv", "recording.decoded.csv"),
        // Settings chosen from candidates with a setting that is no more.
        ("automatic.json", "press.csv", "automatic.decoded.csv"),
    ] {
        let folder = files();
        success(
            &format!("decode --network {network} --data {input} --out found.csv"),
            folder.path(),
        );
        assert_same(&read(folder.path(), "found.csv"), &read(folder.path(), expected), 1e-12);
        success(
            &format!("export --network {network} --format numpy --out bundle"),
            folder.path(),
        );
    }
}

/// Answers of the network at the end of the training, which the vector instructions of the machine may change slightly.
#[test]
fn a_checkpoint_continues_with_the_same_epochs() {
    let folder = files();
    success(
        "train --checkpoint training.checkpoint --resume --epochs 8 --out found.json --json",
        folder.path(),
    );
    let decoded = |network: &str| {
        success(
            &format!("decode --network {network} --data press.csv --out decoded.csv"),
            folder.path(),
        );
        // Without the half-widths, whose held-out answers were not yet limited to the range in training.
        let text = read(folder.path(), "decoded.csv");
        let cells = text
            .lines()
            .map(|line| Vec::from_iter(line.split(',').take(3)).join(","));
        Vec::from_iter(cells).join("\n")
    };
    assert_same(&decoded("found.json"), &decoded("resumed.json"), 1e-6);
}

#[test]
fn recipes_and_sensors_are_trained_on() {
    let folder = files();
    let short = "--hidden 2 --epochs 2 --json";
    let of_recording = json(&format!("train --recipe recording.recipe.json {short}"), folder.path());
    assert_eq!(of_recording["targets"][0]["name"], "force");
    let of_array = json(&format!("train --recipe array.recipe.json {short}"), folder.path());
    let of_sensor = json(
        &format!("train --sensor sensor.json --samples 60 {short}"),
        folder.path(),
    );
    for report in [of_array, of_sensor] {
        assert_eq!(report["array"], "2×2_2×6");
    }
}

#[test]
fn trials_of_a_sweep_are_merged() {
    let folder = files();
    success("sweep --merge sweep --out found.csv", folder.path());
    let mut hidden = column(&read(folder.path(), "found.csv"), "hidden");
    hidden.sort_by(f64::total_cmp);
    assert_eq!(hidden, [2.0, 3.0]);
}
