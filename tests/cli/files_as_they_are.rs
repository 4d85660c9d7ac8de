//! Recordings as people have them: several files, patterns and folders, derived columns, wide ranges, many channels.

use std::{fmt::Write as _, fs};

use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use tempfile::TempDir;

use crate::calls::{column, failure, has, json, number, read, refused, said, success, warnings, write};

/// Three files of a session each: two readings that differ by the force and a common drift; the third file goes further.
fn sessions() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for session in 1..=3 {
        let mut text = "t,u1,u2,force\n".to_owned();
        for row in 0..60 {
            let most = if session == 3 { 4.0 } else { 1.0 };
            let (force, drift): (f64, f64) = (rng.random_range(0.0..most), rng.random_range(-1.0..1.0));
            writeln!(
                text,
                "{},{},{},{force}",
                0.1 * f64::from(row),
                drift + force,
                drift - force
            )
            .unwrap();
        }
        fs::write(folder.path().join(format!("press_{session}.csv")), text).unwrap();
    }
    folder
}

const TRAIN: &str = "--inputs u1,u2 --targets force --hidden 3 --epochs 15 --starts 1 --seed 1 --json";

#[test]
fn a_pattern_or_a_folder_is_one_experiment_split_by_file() {
    let folder = sessions();
    let report = json(
        &format!("train --data press_?.csv {TRAIN} --recipe-out recipe.json"),
        folder.path(),
    );
    assert_eq!(
        (&report["split"], report["files"].as_array().unwrap().len()),
        (&"group".into(), 3)
    );
    assert_eq!(report["test_samples"], 60);
    let same = json(
        "train --recipe recipe.json --hidden 3 --epochs 15 --starts 1 --seed 1 --json",
        folder.path(),
    );
    assert_eq!(same["targets"], report["targets"]);
    fs::create_dir(folder.path().join("all")).unwrap();
    for session in 1..=3 {
        let name = format!("press_{session}.csv");
        fs::copy(folder.path().join(&name), folder.path().join("all").join(&name)).unwrap();
    }
    let of_folder = json(&format!("train --data all {TRAIN}"), folder.path());
    assert_eq!(of_folder["targets"], report["targets"]);
    refused(
        &format!("train --data nothing_*.csv {TRAIN}"),
        folder.path(),
        2,
        "matches no file",
    );
}

#[test]
fn a_damaged_file_of_several_is_left_out_on_request() {
    let folder = sessions();
    let broken = folder.path().join("press_2.csv");
    let whole = fs::read_to_string(&broken).unwrap();
    fs::write(&broken, whole + "\"1,2,3,4\n").unwrap();
    let roles = "--data press_?.csv --inputs u1,u2 --targets force";
    let message = failure(&format!("inspect {roles} --recipe-out recipe.json"), folder.path(), 1);
    has(&message, &["press_2.csv", "never closed"]);
    let inspect = format!("inspect {roles} --skip-damaged --recipe-out recipe.json --json");
    has(&warnings(&inspect, folder.path()), &["left out", "press_2.csv"]);
    let train = "train --recipe recipe.json --hidden 3 --epochs 15 --starts 1 --seed 1 --json";
    let with_damage = json(train, folder.path());
    // The same training without the file.
    fs::remove_file(&broken).unwrap();
    let without = json(&format!("train --data press_?.csv {TRAIN}"), folder.path());
    assert_eq!(with_damage["targets"], without["targets"]);
    // Nothing is left of a single file.
    fs::write(&broken, "\"1,2\n").unwrap();
    let alone = "inspect --data press_2.csv --inputs u1,u2 --targets force --skip-damaged --recipe-out one.json";
    refused(alone, folder.path(), 1, "never closed");
}

#[test]
fn files_of_different_length_are_joined_row_by_row_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let rows = |from: usize, to: usize, header: &str| {
        (from..to).fold(header.to_owned(), |mut text, row| {
            writeln!(text, "{},{}", row % 7, (row * row) % 11).unwrap();
            text
        })
    };
    write(folder.path(), "readings.csv", rows(0, 103, "a,b\n"));
    write(folder.path(), "forces.csv", rows(0, 100, "x,y\n"));
    let roles = "--data readings.csv --join forces.csv --inputs a,b --targets forces.x";
    let inspect = format!("inspect {roles} --recipe-out recipe.json");
    refused(&inspect, folder.path(), 1, "--truncate");
    let said = warnings(&format!("{inspect} --truncate --json"), folder.path());
    has(&said, &["the last 3 rows are left out"]);
    let train = "train --recipe recipe.json --hidden 3 --epochs 15 --starts 1 --seed 1 --json";
    let truncated = json(train, folder.path());
    write(folder.path(), "readings.csv", rows(0, 100, "a,b\n"));
    let equal = json(train, folder.path());
    assert_eq!(truncated["targets"], equal["targets"]);
}

#[test]
fn a_table_whose_rows_are_channels_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let row =
        |channel: usize| Vec::from_iter((0..400).map(|sample| ((sample * (channel + 2)) % 13).to_string())).join(",");
    let text = Vec::from_iter((0..4).map(row)).join("\n");
    write(folder.path(), "channels.csv", text);
    has(&said("inspect --data channels.csv", folder.path()), &["transpose it"]);
    // Few samples of many channels are not suspect.
    let wide = Vec::from_iter((0..24).map(row)).join("\n");
    write(folder.path(), "wide.csv", wide);
    assert!(!said("inspect --data wide.csv", folder.path()).contains("transpose it"));
}

#[test]
fn test_samples_outside_the_training_range_are_reported() {
    let folder = sessions();
    let data = "train --data press_1.csv --data press_2.csv --test-data press_3.csv";
    let report = json(&format!("{data} {TRAIN}"), folder.path());
    let share = report["test_outside_training"].as_f64().unwrap();
    assert!((0.6..0.9).contains(&share), "{share}");
    assert!(report["warnings"].to_string().contains("(force in "), "{report}");
    let inside = json(
        &format!("train --data press_1.csv --test-data press_2.csv {TRAIN}"),
        folder.path(),
    );
    assert!(inside["test_outside_training"].as_f64().unwrap() < 0.1, "{inside}");
    assert!(!inside["warnings"].to_string().contains("(force in "), "{inside}");
}

#[test]
fn derived_columns_are_inputs_that_decode_computes_again() {
    let folder = sessions();
    let derived =
        "--derive d=u1-u2 --inputs d --targets force --hidden 2 --epochs 30 --starts 1 --out network.json --json";
    let report = json(
        &format!("train --data press_1.csv --data press_2.csv {derived}"),
        folder.path(),
    );
    // The difference of the readings is twice the force.
    assert!(number(&report["targets"][0], "rmse") < 0.01, "{report}");
    success(
        "decode --network network.json --data press_1.csv --out decoded.csv",
        folder.path(),
    );
    let decoded = column(&read(folder.path(), "decoded.csv"), "force");
    let force = column(&read(folder.path(), "press_1.csv"), "force");
    assert!((decoded[0] - force[0]).abs() < 0.05, "{} for {}", decoded[0], force[0]);
}
