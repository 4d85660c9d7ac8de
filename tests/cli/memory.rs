//! A memory from the arguments to the answers: training, decoding of files and of streams.

use std::{fs, path::Path};

use tempfile::TempDir;

use crate::{printed::json, terminal::decoupler};

const TRAIN: &str = "train --data press.csv --time t --inputs u --targets force --hidden 3 --starts 1 --epochs 60 \
                     --validation-fraction 0";

/// A reading that creeps: it follows the force by half at once, and by half with a time constant of 1 s. Of its 600 rows
/// at 20 Hz, which are also in readings.csv without the force, the last 120 are for testing.
fn creeping() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (mut text, mut readings) = ("t,u,force\n".to_owned(), "t,u\n".to_owned());
    let (mut crept, weight) = (0.0, 1.0 - f64::exp(-0.05));
    for row in 0..600 {
        let time_s = 0.05 * f64::from(row);
        let force = 2.0 + f64::sin(1.3 * time_s) + f64::sin(0.37 * time_s * time_s.sqrt());
        crept += weight * (force - crept);
        let reading = 0.5 * (force + crept);
        text += &format!("{time_s},{reading},{force}\n");
        readings += &format!("{time_s},{reading}\n");
    }
    fs::write(folder.path().join("press.csv"), text).unwrap();
    fs::write(folder.path().join("readings.csv"), readings).unwrap();
    folder
}

fn succeed(arguments: &str, folder: &Path) -> String {
    let output = decoupler(arguments, folder);
    assert!(
        output.status.success(),
        "{arguments}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

fn refused(arguments: &str, folder: &Path) -> String {
    let output = decoupler(arguments, folder);
    assert!(!output.status.success(), "{arguments}");
    String::from_utf8(output.stderr).unwrap()
}

/// First column of a table.
fn answers(text: &str) -> Vec<f64> {
    let first = |line: &str| line.split(',').next().unwrap().parse().unwrap();
    text.lines().skip(1).map(first).collect()
}

#[test]
fn a_memory_removes_creep_and_goes_with_the_network() {
    let folder = creeping();
    let rmse = |report: &serde_json::Value| report["targets"][0]["rmse"].as_f64().unwrap();
    let without = json(&format!("{TRAIN} --json"), folder.path());
    let with = json(&format!("{TRAIN} --memory 0.5s,2s --out n.json --json"), folder.path());
    assert!(rmse(&with) < 0.2 * rmse(&without), "{} {}", rmse(&with), rmse(&without));
    let text = succeed(&format!("{TRAIN} --memory 0.5s,2s"), folder.path());
    assert!(
        text.contains("3 inputs (1 reading and their memory: averages over 0.5s, 2s)"),
        "{text}"
    );
    succeed(
        "decode --network n.json --input readings.csv --output decoded.csv",
        folder.path(),
    );
    let decoded = answers(&fs::read_to_string(folder.path().join("decoded.csv")).unwrap());
    let squares = decoded.iter().enumerate().skip(480).map(|(row, found)| {
        let time_s = 0.05 * row as f64;
        (found - (2.0 + f64::sin(1.3 * time_s) + f64::sin(0.37 * time_s * time_s.sqrt()))).powi(2)
    });
    let found = (squares.sum::<f64>() / 120.0).sqrt();
    assert!(
        (found / rmse(&with) - 1.0).abs() < 1e-6,
        "{found}, in training {}",
        rmse(&with)
    );
    // A stream with times, and one without, at the interval of the training.
    let streamed = succeed("decode --network n.json --follow --input readings.csv", folder.path());
    let readings = fs::read_to_string(folder.path().join("readings.csv")).unwrap();
    let untimed = readings
        .lines()
        .map(|line| format!("{}\n", line.split_once(',').unwrap().1));
    fs::write(folder.path().join("untimed.csv"), untimed.collect::<String>()).unwrap();
    let without_times = succeed("decode --network n.json --follow --input untimed.csv", folder.path());
    for found in [answers(&streamed), answers(&without_times)] {
        assert_eq!(found.len(), decoded.len());
        assert!(
            found
                .iter()
                .zip(&decoded)
                .all(|(one, other)| (one - other).abs() < 1e-9)
        );
    }
}

#[test]
fn memories_are_kept_in_recipes_and_refused_where_they_are_not_possible() {
    let folder = creeping();
    succeed(
        &format!("{TRAIN} --lags 5,0.5s --differences --save-recipe r.json --out a.json"),
        folder.path(),
    );
    let recipe = fs::read_to_string(folder.path().join("r.json")).unwrap();
    assert!(recipe.contains("\"lags\"") && recipe.contains("\"0.5s\""), "{recipe}");
    let message = refused(
        "train --data press.csv --inputs u --targets force --memory 2s",
        folder.path(),
    );
    assert!(message.contains("a memory of 2s needs times"), "{message}");
    let message = refused(&format!("{TRAIN} --memory 2h"), folder.path());
    assert!(message.contains("write a number of samples as in 20"), "{message}");
    let message = refused("export --network a.json --format c99 --out c", folder.path());
    assert!(message.contains("memory"), "{message}");
}
