//! Scenes, inputs and decoders in the terminal.

use std::{fs, path::Path};

use serde_json::Value;

use crate::{printed::success, terminal::decoupler};

fn failure(arguments: &str, folder: &Path, status: i32) -> String {
    let output = decoupler(arguments, folder);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{arguments}: {text}");
    assert!(
        text.starts_with("error: ") && text.lines().count() == 1,
        "{arguments}: {text}"
    );
    text
}

const SMALL: &str =
    "--array 3x4_2x12 --hidden 4 --epochs 20 --samples 300 --set validation-samples=30 --set test-samples=30";

#[test]
fn training_reports_decoders_model_based_errors_and_size_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let report = |arguments: &str| -> Value {
        serde_json::from_str(&success(&format!("train {SMALL} --json {arguments}"), folder.path())).unwrap()
    };
    let known = report("--preset best --noise 1e-3");
    for name in ["mean", "ridge", "network", "network_f32", "rbf", "newton", "polish"] {
        for figure in ["z_percent", "z_mm", "frame_us"] {
            let value = known["decoders"][name][figure].as_f64();
            assert!(value.is_some_and(|value| value > 0.0), "{name} {figure}: {value:?}");
        }
    }
    assert!(known["model_based"]["z_percent"].as_f64().unwrap() > 0.0);
    assert_eq!((&known["unknowns"], &known["equations"]), (&12.into(), &36.into()));
    assert_eq!(known["networks"], 3);
    assert_eq!(known["published"], Value::Null);
    let sideways = report("--preset best --rows 2 --axes xyz --loading smooth:4 --decoder newton,mean");
    assert_eq!(
        (&sideways["unknowns"], &sideways["equations"]),
        (&12.into(), &12.into())
    );
    let names: Vec<_> = sideways["decoders"].as_object().unwrap().keys().collect();
    assert_eq!(names, ["mean", "newton"]);
    let log = report("--inputs log --scaling whiten --loading indenter");
    assert_eq!(
        (&log["networks"], &log["inputs"]["scaling"]),
        (&1.into(), &"whitening".into())
    );
    assert!(log["model_based"]["z_mm"].as_f64().unwrap() < 1e-10);
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
        let text = fs::read_to_string(path.join(name)).unwrap();
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
    let message = failure("decode --network net.json --data part.csv --out x.csv", path, 1);
    assert!(message.contains("lines are not a multiple of 3 rows"), "{message}");
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
    let report: Value = serde_json::from_str(&success(&format!("{arguments} --json"), folder.path())).unwrap();
    let levels = report["levels"].as_array().unwrap();
    assert_eq!(levels.len(), 2);
    for level in levels {
        // Two presets, each with five decoders without a network, and for two networks: network, single precision and
        // polish.
        let points = level["points"].as_array().unwrap();
        assert_eq!(points.len(), 2 * (5 + 2 * 3));
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
    assert!(
        text.contains("Fastest under") && text.contains("Network f32") && !text.contains("paper  "),
        "{text}"
    );
}

/// With noise only in the test, some points are worse than the mean, and each of them has a remark.
#[test]
fn a_point_worse_than_the_mean_has_a_remark() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = "trade --array 2x3_2x9 --hidden 2 --epochs 30 --samples 40 --set test-samples=20 --noise 3e-1 --set noise-in=test \
                     --preset paper --decoder mean,ridge,network";
    let report: Value = serde_json::from_str(&success(&format!("{arguments} --json"), folder.path())).unwrap();
    let points = report["levels"][0]["points"].as_array().unwrap();
    let error = |point: &Value| point["z_mm"].as_f64().unwrap();
    let of_mean = error(points.iter().find(|point| point["decoder"] == "mean").unwrap());
    let worse = Vec::from_iter(points.iter().filter(|point| error(point) > 1.001 * of_mean));
    assert!(!worse.is_empty(), "{points:?}");
    for point in worse {
        let remark = point["remarks"][0].as_str().unwrap();
        assert!(remark.contains("times that of always answering the mean"), "{remark}");
    }
    let text = String::from_utf8(decoupler(arguments, folder.path()).stderr).unwrap();
    assert!(
        text.contains("warning: Network, paper preset, 2 hidden: ") || text.contains("warning: Ridge, paper preset: "),
        "{text}"
    );
}

#[test]
fn errors_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        ("train --preset worst", "paper or best"),
        ("train --rows some", "all, known"),
        ("train --axes xy", "z or xyz"),
        ("train --loading smooth", "smooth:MM"),
        ("train --inputs volts", "resistance, conductance or log"),
        ("train --scaling none", "minmax or whiten"),
        ("train --noise -1", "0 or more"),
        ("train --noise 2", "from 0 to 1"),
        ("train --noise 0,1", "is not a number"),
        ("train --decoder knn", "rbf, fuzzy, newton or polish"),
        ("simulate --decoder mean,ridge", "only one here"),
        ("trade --hidden 0", "from 1"),
    ];
    for (arguments, expected) in cases {
        let message = failure(arguments, folder.path(), 2);
        assert!(message.contains(expected), "{arguments}: {message}");
    }
    let message = failure("train --rows 11", folder.path(), 2);
    assert!(message.contains("rows 1 to 10"), "{message}");
}
