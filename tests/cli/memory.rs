//! A memory from the arguments to the answers: training, decoding of files and of streams.

use std::{fs, path::Path};

use tempfile::TempDir;

use crate::{printed::json, terminal::decoupler};

const TRAIN: &str = "train --data press.csv --time t --inputs u --targets force --hidden 3 --starts 1 --epochs 60 \
                     --validation-fraction 0";

/// A reading that creeps: it follows the force by half at once, and by half with a time constant of 1 s. Of its 600 rows
/// at 20 Hz, which are also in readings.csv without the force, the last 120 are for testing.
pub(crate) fn creeping() -> TempDir {
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

pub(crate) fn succeed(arguments: &str, folder: &Path) -> String {
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

/// Decoded target of a table, whose first column may be the time.
fn answers(text: &str) -> Vec<f64> {
    let column = text.split([',', '\n']).position(|name| name.starts_with("force"));
    let answer = |line: &str| line.split(',').nth(column.unwrap()).unwrap().parse().unwrap();
    text.lines().skip(1).map(answer).collect()
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
    // The times are copied as they came.
    let header = streamed.lines().next().unwrap();
    assert!(header.starts_with("t,"), "{header}");
    let times = |text: &str| {
        Vec::from_iter(
            text.lines()
                .skip(1)
                .map(|line| line.split(',').next().unwrap().to_owned()),
        )
    };
    assert_eq!(times(&streamed), times(&readings));
    let objects = succeed(
        "decode --network n.json --follow --format jsonl --input readings.csv",
        folder.path(),
    );
    let object: serde_json::Value = serde_json::from_str(objects.lines().nth(1).unwrap()).unwrap();
    assert_eq!(object["columns"]["t"], times(&readings)[1].as_str());
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
fn a_stream_is_decoded_like_a_file_with_derived_columns_and_a_memory() {
    let folder = creeping();
    let derive = "--derive d=u-start(1s) --derive q=u/start(5)";
    succeed(
        &format!(
            "{} {derive} --memory 0.5s --out n.json",
            TRAIN.replace("--inputs u", "--inputs d,q")
        ),
        folder.path(),
    );
    let decode = "decode --network n.json --input readings.csv";
    succeed(&format!("{decode} --output decoded.csv"), folder.path());
    let decoded = answers(&fs::read_to_string(folder.path().join("decoded.csv")).unwrap());
    let output = decoupler(&format!("{decode} --follow"), folder.path());
    let warnings = String::from_utf8(output.stderr).unwrap();
    assert!(
        warnings.contains("line 2: the lines at the start give the means"),
        "{warnings}"
    );
    let streamed = answers(&String::from_utf8(output.stdout).unwrap());
    // The rows of the first second, which are over with that at 1.05 s.
    assert_eq!((decoded.len(), streamed.len()), (600, 579));
    for (found, expected) in streamed.iter().zip(&decoded[21..]) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
    // A stream without one of the columns is refused with the reason.
    fs::write(folder.path().join("other.csv"), "t,v\n0,1\n").unwrap();
    let message = refused("decode --network n.json --follow --input other.csv", folder.path());
    assert!(message.contains("there is no column 'd'"), "{message}");
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
    for precision in ["f32", "fixed16"] {
        let export = format!("export --network a.json --format c99 --precision {precision} --out c");
        let message = refused(&export, folder.path());
        assert!(message.contains("give --precision f64"), "{message}");
    }
}

#[test]
fn every_format_exports_the_memory_with_its_state_and_a_golden_sequence() {
    let folder = creeping();
    let memory = "--memory 0.5s,40 --lags 3,0.2s --differences --out n.json";
    succeed(&format!("{TRAIN} {memory}"), folder.path());
    for (format, file) in [
        ("c99", "c99_memory.c"),
        ("onnx", "stream.onnx"),
        ("numpy", "memory.py"),
        ("matlab", "matlab_memory.m"),
    ] {
        let export = format!("export --network n.json --format {format} --out {format} --json");
        let report = json(&export, folder.path());
        assert!(report["deviation"].as_f64().unwrap() <= 1e-12, "{format}: {report}");
        let found = folder.path().join(format);
        assert!(found.join(file).is_file(), "{format}");
        let sequence = fs::read_to_string(found.join("sequence.csv")).unwrap();
        let header = sequence.lines().next().unwrap();
        assert!(
            header.starts_with("restart,interval_s,\"u\",\"u-u[-3]\",\"u-u[-0.2s]\",\"u-u~0.5s\",\"u-u~40\""),
            "{header}"
        );
        let restarts = sequence.lines().filter(|line| line.starts_with("1,")).count();
        assert_eq!(restarts, 2, "{format}");
        let readme = fs::read_to_string(found.join("README.txt")).unwrap();
        assert!(readme.contains("sequence.csv has samples in order"), "{readme}");
    }
}

#[test]
fn inspect_reports_whether_the_past_helps() {
    let folder = creeping();
    let inspect = "inspect --data press.csv --time t --inputs u --targets force --model ridge";
    let report = json(&format!("{inspect} --json"), folder.path());
    let target = &report["targets"][0];
    let gain = |name: &str| target["with_memory"][name].as_f64().unwrap();
    assert!(gain("value") < 0.5 && gain("high") < 1.0, "{target}");
    let text = succeed(inspect, folder.path());
    assert!(
        text.contains("The past helps to predict force: with averages over 0.5s, 5s"),
        "{text}"
    );
}

#[test]
fn names_in_the_golden_sequence_are_no_formulas() {
    let folder = creeping();
    let path = folder.path().join("press.csv");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replacen("t,u,", "t,=1+u,", 1)).unwrap();
    let train = TRAIN.replace("--inputs u", "--inputs =1+u");
    succeed(&format!("{train} --lags 3 --out n.json"), folder.path());
    succeed("export --network n.json --format numpy --out numpy", folder.path());
    let sequence = fs::read_to_string(folder.path().join("numpy/sequence.csv")).unwrap();
    assert!(
        sequence.starts_with("restart,interval_s,\"'=1+u\",\"'=1+u[-3]\","),
        "{sequence}"
    );
}
