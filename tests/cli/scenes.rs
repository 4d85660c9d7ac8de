//! Scenes, inputs and decoders in the terminal.

use std::fs;

use decoupler_core::decoupling::DecoderKind;
use serde_json::Value;

use crate::calls::{has, json, number, read, refused, said, success};

const SMALL: &str =
    "--array 3x4_2x12 --hidden 4 --epochs 20 --samples 300 --set validation-samples=30 --set test-samples=30";

#[test]
fn training_reports_decoders_model_based_errors_and_size_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let report = |arguments: &str| json(&format!("train {SMALL} --json {arguments}"), folder.path());
    let known = report("--preset best --noise 1e-3");
    for name in ["mean", "ridge", "network", "network_f32", "rbf", "newton", "polish"] {
        for figure in ["z_percent", "z_mm", "frame_us"] {
            assert!(number(&known["decoders"][name], figure) > 0.0, "{name} {figure}");
        }
    }
    assert!(number(&known["model_based"], "z_percent") > 0.0);
    assert_eq!(
        ["unknowns", "equations", "networks"].map(|name| number(&known, name)),
        [12.0, 36.0, 3.0]
    );
    assert_eq!(known["published"], Value::Null);
    let sideways = report("--preset best --rows 2 --axes xyz --loading smooth:4 --decoder newton,mean");
    assert_eq!(
        ["unknowns", "equations"].map(|name| number(&sideways, name)),
        [12.0, 12.0]
    );
    assert!(sideways["decoders"].as_object().unwrap().keys().eq(["mean", "newton"]));
    let log = report("--inputs log --scaling whiten --loading indenter");
    assert_eq!(
        (&log["networks"], &log["inputs"]["scaling"]),
        (&1.into(), &"whitening".into())
    );
    assert!(number(&log["model_based"], "z_mm") < 1e-10);
}

/// Twelve readings determine four nodes up to rounding, so that error ratios are meaningless; three readings do not.
#[test]
fn ratios_need_a_model_based_error_above_rounding() {
    let folder = tempfile::tempdir().unwrap();
    let ratio = |array: &str| {
        let call = format!("train {SMALL} --array {array} --preset best --epochs 1 --decoder newton");
        let text = success(
            &call
                .replacen("--array 3x4_2x12 ", "", 1)
                .replacen("--epochs 20 ", "", 1),
            folder.path(),
        );
        let line = text.lines().find(|line| line.starts_with("Newton ")).unwrap();
        let ratio = line.split_whitespace().nth(3).unwrap().parse::<f64>().unwrap();
        let ratio = text.contains("times model-based").then_some(ratio);
        assert_eq!(text.contains("nothing but rounding"), ratio.is_none(), "{text}");
        ratio
    };
    assert_eq!(ratio("3x4_2x12"), None);
    let open = ratio("3x4_2x3").unwrap();
    assert_eq!(open, 1.0, "the model-based decoder is Newton's method");
}

#[test]
fn simulated_samples_are_decoded_row_by_row() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    success(
        &format!("train {SMALL} --preset best --out net.json --decoder mean"),
        path,
    );
    success(
        "simulate --array 3x4_2x12 --preset best --samples 30 --decoder newton --out all.csv",
        path,
    );
    let lines = |name: &str| -> Vec<Vec<String>> {
        let text = read(path, name);
        text.lines()
            .map(|line| line.split(',').map(str::to_owned).collect())
            .collect()
    };
    let all = lines("all.csv");
    assert_eq!(all[0][2 + 12 + 12], "decoded_x_1");
    for line in &all[1..] {
        let number = |place: usize| line[place].parse::<f64>().unwrap();
        for coordinate in 14..26 {
            assert!((number(coordinate) - number(coordinate + 12)).abs() < 1e-9);
        }
    }
    success("decode --network net.json --data all.csv --out in_order.csv", path);
    // The same readings without the row column, and in another order with it.
    let without: Vec<String> = all.iter().map(|line| line[2..14].join(",")).collect();
    fs::write(path.join("without.csv"), without.join("\n")).unwrap();
    success(
        "decode --network net.json --data without.csv --out without_out.csv",
        path,
    );
    assert_eq!(lines("without_out.csv"), lines("in_order.csv"));
    let mut turned: Vec<String> = all.iter().map(|line| line.join(",")).collect();
    turned[1..].reverse();
    fs::write(path.join("turned.csv"), turned.join("\n")).unwrap();
    success("decode --network net.json --data turned.csv --out turned_out.csv", path);
    let mut expected = lines("in_order.csv");
    expected[1..].reverse();
    assert_eq!(lines("turned_out.csv"), expected);
    fs::write(path.join("part.csv"), without[..6].join("\n")).unwrap();
    let part = "decode --network net.json --data part.csv --out x.csv";
    refused(part, path, 1, "lines are not a multiple of 3 rows");
    success(
        "simulate --array 3x4_2x12 --rows 2 --samples 4 --noise 1e-3 --out row.csv",
        path,
    );
    let row = lines("row.csv");
    assert_eq!(row.len(), 5);
    assert!(row[1..].iter().all(|line| line[1] == "2" && line[14] == "9.0"));
}

#[test]
fn a_trade_off_is_reported_in_text_and_json() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = "trade --array 2x3_2x9 --hidden 2,3 --epochs 5 --samples 60 --set test-samples=20 --noise 0,1e-2 \
                     --under-percent 1e-6 --under-us 1e9";
    let report = json(&format!("{arguments} --json"), folder.path());
    let levels = report["levels"].as_array().unwrap();
    assert_eq!(levels.len(), 2);
    let alone = DecoderKind::ALL.iter().filter(|kind| !kind.needs_network()).count();
    for level in levels {
        // Two presets, each with the decoders without a network, and for two networks: network, single precision and
        // polish.
        let points = level["points"].as_array().unwrap();
        assert_eq!(points.len(), 2 * (alone + 2 * 3));
        assert!(points.iter().any(|point| point["on_decoding_front"] == true));
        let command = level["most_accurate_under"]["command"].as_str().unwrap();
        assert!(command.starts_with("decoupler train --array 2x3_2x9"), "{command}");
    }
    assert!(levels[0]["fastest_under"]["point"].is_u64());
    assert_eq!(levels[1]["fastest_under"]["point"], Value::Null, "noise forbids it");
    let text = success(
        &format!("{arguments} --preset best --decoder newton,network"),
        folder.path(),
    );
    has(&text, &["Fastest under", "Network f32"]);
    assert!(!text.contains("paper  "), "{text}");
    // With noise only in the test, some points are worse than the mean, and have a remark.
    let noisy = "trade --array 2x3_2x9 --hidden 2 --epochs 30 --samples 40 --set test-samples=20 --noise 3e-1 \
                 --set noise-in=test --preset paper --decoder mean,ridge,network";
    let message = said(noisy, folder.path());
    let is_remark =
        |line: &str| line.starts_with("warning: ") && line.contains("times that of always answering the mean");
    assert!(message.lines().any(is_remark), "{message}");
}
