//! Basic commands, run as a program.

use decoupler_core::{
    dataset::{Dataset, Seed, Simulation, Stream},
    evaluation::Errors,
    scene::Scene,
    sensor::{ArrayScale, SensorModel},
};
use decoupler_files::export::NetworkFile;
use serde_json::Value;

use crate::{
    calls::{has, json, read, success, write},
    folders::names,
};

const SMALL: &str = "train --array 10x6_3x18 --samples 200 --epochs 20 --seed 5 --decoder mean";

/// The paper's main experiment: Table 1 within the spread of seeds, and smaller errors with more epochs.
#[test]
fn the_papers_errors_are_reproduced() {
    let folder = tempfile::tempdir().unwrap();
    for seed in 0..3 {
        for (sentence, arguments, z_percent) in [
            ("as in Table 1", "--hidden 12 --epochs 60", 1.4..2.6),
            ("with more epochs", "--hidden 12 --epochs 300", 0.0..1.2),
            ("with fewer hidden nodes", "--hidden 6 --epochs 60", 3.4..4.2),
        ] {
            let train = format!("train --json --seed {seed} --array 10x10_5x30 --method lm --decoder mean {arguments}");
            let report = json(&train, folder.path());
            let figure = |pointer: &str| report.pointer(pointer).and_then(Value::as_f64).unwrap();
            let z = figure("/errors/z_percent");
            assert!(z_percent.contains(&z), "{sentence}, seed {seed}: {z} %");
            assert!(figure("/errors/x_percent") < 0.8, "{sentence}, seed {seed}");
            assert!(figure("/errors/y_percent") < 1e-6, "{sentence}, seed {seed}");
            let mean = figure("/baselines/mean/z_percent");
            assert!((5.3..5.8).contains(&mean), "{sentence}, seed {seed}: {mean}");
            assert!(figure("/train_mse") < 0.2 && figure("/epoch_ms") > 0.0);
            assert_eq!(report["method"], "lm");
            assert_eq!(report["stop_reason"], "epochs_reached", "{sentence}, seed {seed}");
        }
    }
}

/// Removes the times from the output of `train --json`.
pub(crate) fn without_times(mut report: Value) -> Value {
    report.as_object_mut().unwrap().remove("epoch_ms");
    for decoder in report["decoders"].as_object_mut().unwrap().values_mut() {
        let is_time = |name: &String| ["frame_us", "fit_seconds"].contains(&name.as_str());
        decoder.as_object_mut().unwrap().retain(|name, _| !is_time(name));
    }
    report
}

#[test]
fn a_seed_gives_the_same_network_and_settings_matter() {
    let folder = tempfile::tempdir().unwrap();
    let report = |more: &str| without_times(json(&format!("{SMALL} {more} --json"), folder.path()));
    let first = report("");
    assert_eq!(report(""), first);
    for other in [
        "--set mu=10 --set mu-decrease=0.5",
        "--method gdm --set learning-rate=0.05",
    ] {
        assert_ne!(report(other)["errors"], first["errors"], "{other}");
    }
}

#[test]
fn the_table_has_every_row_and_the_reason_for_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let rows = ["training mean", "linear map", "network", "published", "worst node (mm)"];
    let text = success("train --array 10x6_3x18 --epochs 2 --decoder mean", folder.path());
    has(&text, &[&rows[..], &["all epochs done", "assumed"]].concat());
    assert!(!success(SMALL, folder.path()).contains("published"));
}

/// Simulated samples, decoded by a saved network, have the errors reported by the training: the seed gives its test
/// samples.
#[test]
fn simulate_and_decode_agree_with_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let report = json(&format!("{SMALL} --out network.json --json"), folder);
    let simulate = "simulate --array 10x6_3x18 --seed 5 --samples";
    success(&format!("{simulate} 100 --out samples.csv"), folder);
    let decode = "decode --network network.json --data samples.csv --out decoded.csv";
    success(decode, folder);
    assert_eq!(names(folder), ["decoded.csv", "network.json", "samples.csv"]);
    let file = NetworkFile::load(&folder.join("network.json")).unwrap();
    let scale: ArrayScale = "10x6_3x18".parse().unwrap();
    let model = SensorModel::new(scale);
    let truth = Dataset::simulate(&model, &Scene::default(), 100, &mut Seed(5).rng(Stream::Test)).unwrap();
    let decoded = file.network.decouple(&truth);
    let text = read(folder, "decoded.csv");
    assert!(text.starts_with("x_1,y_1,z_1,x_2,"));
    assert_eq!(text.lines().count(), 101);
    for (line, row) in text.lines().skip(1).zip(decoded.rows()) {
        let cells = line.strip_suffix(",0,0").unwrap().split(',');
        let numbers = cells.map(|number| number.parse::<f64>().unwrap().to_bits());
        assert!(numbers.eq(row.iter().map(|number| number.to_bits())));
    }
    let errors = Errors::measure(&truth, &decoded, Simulation::default().stroke_mm());
    assert_eq!(file.scores.network.nodes(), Some(&errors));
    assert_eq!(
        serde_json::from_value::<Errors>(report["errors"].clone()).unwrap(),
        errors
    );
    let samples = success(&format!("{simulate} 11"), folder);
    assert_eq!(samples.lines().count(), 21, "whole snapshots");
    assert!(read(folder, "samples.csv").starts_with(&samples));
    assert!(samples.lines().nth(11).unwrap().starts_with("2,1,"));
    // A file that is decoded only in part leaves nothing.
    write(folder, "samples.csv", format!("{samples}1,1,600\n"));
    crate::calls::refused(&decode.replace("decoded", "other"), folder, 1, "samples.csv': line 22");
    assert!(!folder.join("other.csv").exists());
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
