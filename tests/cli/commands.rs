//! Basic commands, run as a program.

use std::{fs, path::Path};

use decoupler_core::{
    dataset::{Dataset, Seed, Simulation, Stream},
    evaluation::Errors,
    scene::Scene,
    sensor::{ArrayScale, SensorModel},
};
use decoupler_files::export::NetworkFile;
use serde_json::Value;

use crate::{folders::names, terminal::decoupler};

/// Standard error of a call that must fail with `status`: one line, nothing on standard output.
fn failure(arguments: &str, folder: &Path, status: i32) -> String {
    let output = decoupler(arguments, folder);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{arguments}: {text}");
    assert!(output.stdout.is_empty(), "{arguments}");
    assert!(
        text.starts_with("error: ") && text.lines().count() == 1,
        "{arguments}: {text}"
    );
    text
}

fn success(arguments: &str, folder: &Path) -> String {
    let output = decoupler(arguments, folder);
    let errors = String::from_utf8_lossy(&output.stderr);
    let are_warnings = errors.lines().all(|line| line.starts_with("warning: "));
    assert!(output.status.success() && are_warnings, "{arguments}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn train_json(arguments: &str, folder: &Path) -> Value {
    let text = success(&format!("train {arguments} --json"), folder);
    assert_eq!(text.lines().count(), 1);
    serde_json::from_str(&text).unwrap()
}

/// The paper's main experiment: Table 1 within the spread of seeds, and smaller errors with more epochs.
#[test]
fn the_papers_errors_are_reproduced() {
    let cases = [
        ("as in Table 1", "--hidden 12 --method lm --epochs 60", 1.4..2.6),
        ("with more epochs", "--hidden 12 --method lm --epochs 300", 0.0..1.2),
        (
            "with fewer hidden nodes",
            "--hidden 6 --method lm --epochs 60",
            3.4..4.2,
        ),
    ];
    let folder = tempfile::tempdir().unwrap();
    for seed in 0..3 {
        for (sentence, arguments, z_percent) in &cases {
            let report = train_json(&format!("--seed {seed} --array 10x10_5x30 {arguments}"), folder.path());
            let figure = |pointer: &str| report.pointer(pointer).and_then(Value::as_f64).unwrap();
            let z = figure("/errors/z_percent");
            assert!(z_percent.contains(&z), "{sentence}, seed {seed}: {z} %");
            assert!(figure("/errors/x_percent") < 0.8, "{sentence}, seed {seed}");
            assert!(figure("/errors/y_percent") < 1e-6, "{sentence}, seed {seed}");
            assert!(
                (5.3..5.8).contains(&figure("/baselines/mean/z_percent")),
                "{sentence}, seed {seed}"
            );
            assert!(figure("/train_mse") < 0.2 && figure("/epoch_ms") > 0.0);
            assert_eq!(report["method"], "lm");
            assert_eq!(report["stop_reason"], "epochs_reached", "{sentence}, seed {seed}");
        }
    }
}

#[test]
fn invalid_arguments_end_with_status_2() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        ("train --hidden 0", "from 1 to 512"),
        ("train --hidden twelve", "from 1 to 512"),
        ("train --samples 0", "from 1 to 1000000"),
        ("train --samples -5", "not a whole number"),
        ("train --set test-samples=0", "from 1"),
        ("train --set validation-samples=1000001", "from 0 to 1000000"),
        ("train --epochs 0", "from 1"),
        ("train --seed -1", "not a whole number"),
        ("train --seed 18446744073709551616", "not a whole number"),
        ("train --array 10x6", "M1xM2_M3xM4"),
        ("train --array 10x6_3x0", "column-wires (M4)"),
        ("train --method adam", "lm, br, scg"),
        ("train --set mu", "NAME=VALUE"),
        ("train --set mu=small", "not a number"),
        ("train --set mu=NaN", "mu is NaN"),
        ("train --set mu=-1", "mu is -1: it must be from 1e-20"),
        ("train --set momentum=0.5", "mu, mu-decrease, mu-increase, largest-mu"),
        ("train --method gdm --set momentum=1.5", "from 0 to 1"),
        ("train --sed 1", "--seed"),
        ("simulate --samples 0", "from 1"),
        ("simulate --array 0x1_1x1", "row-wires (M1)"),
        ("decode --network n.json", "--data <FILE>"),
        ("trian", "'train'"),
    ];
    for (arguments, expected) in cases {
        let text = failure(arguments, folder.path(), 2);
        assert!(text.contains(expected), "{arguments}: {text}");
    }
}

#[test]
fn help_names_the_settings_of_every_method() {
    let folder = tempfile::tempdir().unwrap();
    let help = success("train --help", folder.path());
    for name in ["mu-decrease", "largest-mu", "learning-rate", "momentum"] {
        assert!(help.contains(name), "{name}");
    }
    assert!(success("--version", folder.path()).starts_with("decoupler "));
}

#[test]
fn an_unwritable_file_is_refused_before_training_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("folder")).unwrap();
    let fixed = folder.path().join("fixed.json");
    fs::write(&fixed, "old").unwrap();
    let mut permissions = fs::metadata(&fixed).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&fixed, permissions).unwrap();
    let cases = [
        ("none/network.json", "the folder 'none' does not exist"),
        ("folder", "it is a folder"),
        ("fixed.json", "read-only"),
    ];
    for (path, expected) in cases {
        // With this many epochs, training before the check would be noticed.
        let text = failure(&format!("train --epochs 1000000 --out {path}"), folder.path(), 1);
        assert!(text.contains(expected), "{text}");
        assert!(failure(&format!("simulate --out {path}"), folder.path(), 1).contains(expected));
    }
    assert_eq!(names(folder.path()), ["fixed.json", "folder"]);
    assert_eq!(fs::read(&fixed).unwrap(), b"old");
}

const SMALL: &str = "--array 10x6_3x18 --samples 200 --epochs 20 --seed 5";

#[test]
fn a_seed_gives_the_same_network_and_settings_matter() {
    let folder = tempfile::tempdir().unwrap();
    let report = |more: &str| {
        let mut report = train_json(&format!("{SMALL} {more}"), folder.path());
        report.as_object_mut().unwrap().remove("epoch_ms");
        for decoder in report["decoders"].as_object_mut().unwrap().values_mut() {
            decoder
                .as_object_mut()
                .unwrap()
                .retain(|name, _| !["frame_us", "fit_seconds"].contains(&name.as_str()));
        }
        report
    };
    assert_eq!(report(""), report(""));
    assert_ne!(
        report("")["errors"],
        report("--set mu=10 --set mu-decrease=0.5")["errors"]
    );
    assert_ne!(
        report("")["errors"],
        report("--method gdm --set learning-rate=0.05")["errors"]
    );
}

#[test]
fn the_table_has_every_row_and_the_reason_for_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let text = success("train --array 10x6_3x18 --epochs 2", folder.path());
    for words in [
        "training mean",
        "linear map",
        "network",
        "published",
        "all epochs done",
        "assumed",
        "worst node (mm)",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert!(!success(&format!("train {SMALL}"), folder.path()).contains("published"));
}

/// Simulated samples, decoded by a saved network, have the errors reported by the training: the seed gives its test
/// samples.
#[test]
fn simulate_and_decode_agree_with_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let report = train_json(&format!("{SMALL} --out network.json"), folder);
    success(
        "simulate --array 10x6_3x18 --samples 100 --seed 5 --out samples.csv",
        folder,
    );
    success(
        "decode --network network.json --data samples.csv --out decoded.csv",
        folder,
    );
    assert_eq!(names(folder), ["decoded.csv", "network.json", "samples.csv"]);
    let file = NetworkFile::load(&folder.join("network.json")).unwrap();
    let scale: ArrayScale = "10x6_3x18".parse().unwrap();
    let model = SensorModel::new(scale);
    let truth = Dataset::simulate(&model, &Scene::default(), 100, &mut Seed(5).rng(Stream::Test)).unwrap();
    let decoded = file.network.decouple(&truth);
    let text = fs::read_to_string(folder.join("decoded.csv")).unwrap();
    assert!(text.starts_with("x_1,y_1,z_1,x_2,"));
    let lines = text.lines().skip(1);
    assert_eq!(lines.clone().count(), 100);
    for (line, row) in lines.zip(decoded.rows()) {
        let numbers = line
            .strip_suffix(",0,0")
            .unwrap()
            .split(',')
            .map(|number| number.parse::<f64>().unwrap().to_bits());
        assert!(numbers.eq(row.iter().map(|number| number.to_bits())));
    }
    let errors = Errors::measure(&truth, &decoded, Simulation::default().stroke_mm());
    assert_eq!(file.scores.network.nodes(), Some(&errors));
    assert_eq!(
        serde_json::from_value::<Errors>(report["errors"].clone()).unwrap(),
        errors
    );
    let samples = success("simulate --array 10x6_3x18 --samples 11 --seed 5", folder);
    assert_eq!(samples.lines().count(), 21, "whole snapshots");
    let prefix = fs::read_to_string(folder.join("samples.csv")).unwrap();
    assert!(prefix.starts_with(&samples) && samples.lines().nth(11).unwrap().starts_with("2,1,"));
}

#[test]
fn files_that_cannot_be_decoded_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    train_json(&format!("{SMALL} --out network.json"), folder);
    let row = ["600"; 18].join(",");
    let cases = [
        ("an empty file", String::new(), "no rows"),
        ("a short row", format!("{row}\n600,600\n"), "line 2: 2 cells where 18"),
        (
            "a negative resistance",
            format!("{row}\n-{row}\n"),
            "line 2, column 1: '-600'",
        ),
        (
            "NaN late in the file",
            format!("{}NaN{}\n", format!("{row}\n").repeat(3000), &row[3..]),
            "line 3001, column 1",
        ),
        ("another array", "r_1,r_2\n1,2\n".to_owned(), "no column 'r_3'"),
    ];
    for (sentence, text, expected) in cases {
        fs::write(folder.join("input.csv"), text).unwrap();
        let text = failure(
            "decode --network network.json --data input.csv --out out.csv",
            folder,
            1,
        );
        assert!(
            text.contains(expected) && text.contains("input.csv"),
            "{sentence}: {text}"
        );
        assert_eq!(names(folder), ["input.csv", "network.json"], "{sentence}");
    }
    let missing = "decode --network network.json --data none.csv --out out.csv";
    assert!(failure(missing, folder, 1).contains("cannot open 'none.csv'"));
    let damaged = "decode --network input.csv --data input.csv --out out.csv";
    assert!(failure(damaged, folder, 1).contains("not a network file"));
}

/// `decoupler simulate | head -1` ends silently.
#[cfg(unix)]
#[test]
fn a_closed_output_is_not_a_failure() {
    use std::process::{Command, Stdio};
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command.args(["simulate", "--samples", "10000"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty());
}
