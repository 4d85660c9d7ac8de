//! Recordings in the terminal: inspection, training, resuming and decoding; options of a simulated sensor are refused.

use std::fs;

use decoupler_files::export::{NetworkFile, RecipeFile};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use serde_json::Value;
use tempfile::TempDir;

use crate::{
    calls::{both, column, failure, has, json, number, read, refused, success, write},
    terminal::decoupler,
};

const TRAIN: &str = "train --data sensor.csv --join states.csv --time c1 --inputs c2..c4 --targets states.c2,states.c3 \
                     --where states.c4<3 --unit states.c2=mm --hidden 6 --starts 1 --epochs 60";

/// Two recordings with clocks 2 ms apart: three readings, and the two positions and the height that determine them.
fn recordings() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let (mut sensor, mut states) = (String::new(), String::new());
    for frame in 0..300 {
        let (x, y): (f64, f64) = (rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
        let time = 0.1 * f64::from(frame);
        let height = if frame % 10 == 0 { 5 } else { 1 };
        sensor += &format!("{time},{},{},{}\n", x + 0.5 * y * y, y - 0.3 * x * x, x * y);
        states += &format!("{},{x},{y},{height}\n", time + 0.002);
    }
    write(folder.path(), "sensor.csv", sensor);
    write(folder.path(), "states.csv", states);
    folder
}

/// Changes digits of samples.
fn change(folder: &TempDir, name: &str) {
    let changed = read(folder.path(), name).replacen("0.", "0.1", 9);
    write(folder.path(), name, changed);
}

const OTHER_SAMPLES: &str = "has other samples than when the run was saved";

#[test]
fn a_network_is_trained_on_joined_files_and_evaluated_for_each_target() {
    let folder = recordings();
    let report = json(
        &format!("{TRAIN} --split time --test-fraction 0.2 --json"),
        folder.path(),
    );
    assert_eq!(report["split"], "time");
    let counts = ["samples", "validation_samples", "test_samples"].map(|name| number(&report, name));
    assert_eq!((counts.iter().sum::<f64>(), counts[2]), (270.0, 54.0));
    assert_eq!(report["dropped"][0]["rows"], 30);
    assert_eq!(report["dropped"][0]["reason"], "states.c4<3 is not met");
    assert_eq!(report["files"][1]["join"]["without_partner"], 0);
    for (index, name, unit) in [(0, "states.c2", "mm".into()), (1, "states.c3", Value::Null)] {
        let target = &report["targets"][index];
        assert_eq!((&target["name"], &target["unit"]), (&Value::from(name), &unit));
        let baselines = &report["baselines"];
        let errors = [&report["targets"], &baselines["ridge"], &baselines["mean"]];
        let [network, ridge, mean] = errors.map(|errors| number(&errors[index], "rmse"));
        assert!(network < 0.5 * ridge && ridge < mean, "{network} {ridge} {mean}");
        assert!(number(target, "r2") > 0.9 && number(target, "worst") >= network);
    }
}

#[test]
fn folds_test_every_sample_of_a_recipe() {
    let folder = recordings();
    json(&format!("{TRAIN} --recipe-out import.json --json"), folder.path());
    let folds = json(
        "train --recipe import.json --hidden 6 --starts 1 --epochs 30 --folds 3 --json",
        folder.path(),
    );
    assert_eq!(
        (folds["folds"].as_u64(), folds["test_samples"].as_u64()),
        (Some(3), Some(270))
    );
    assert!(folds["targets"][0]["r2"].as_f64().unwrap() > 0.9);
}

#[test]
fn a_recipe_without_a_validation_share_holds_out_what_the_method_needs() {
    let folder = recordings();
    let columns = "--data sensor.csv --join states.csv --time c1 --inputs c2..c4 --targets states.c2,states.c3";
    let settings = "--hidden 3 --starts 1 --epochs 5 --json";
    json(
        &format!("inspect {columns} --recipe-out usual.json --json"),
        folder.path(),
    );
    json(
        &format!("inspect {columns} --validation-fraction 0 --recipe-out none.json --json"),
        folder.path(),
    );
    let held_out = |source: &str, method: &str| {
        let report = json(&format!("train {source} --method {method} {settings}"), folder.path());
        report["validation_samples"].as_u64().unwrap()
    };
    for (method, expected) in [("lm", 48), ("br", 0)] {
        for (source, expected) in [
            (columns, expected),
            ("--recipe usual.json", expected),
            ("--recipe none.json", 0),
        ] {
            assert_eq!(held_out(source, method), expected, "{source} {method}");
        }
    }
    // Recipes of earlier versions give every share.
    let recipe = read(folder.path(), "none.json");
    let fraction = |share: &str| recipe.replace("\"validation_fraction\": 0.0", share);
    assert_ne!(fraction(""), recipe);
    write(folder.path(), "null.json", fraction("\"validation_fraction\": null"));
    assert_eq!(held_out("--recipe null.json", "lm"), 48);
}

#[test]
fn a_checkpoint_resumes_unless_its_samples_have_changed() {
    let folder = recordings();
    let whole = json(&format!("{TRAIN} --json"), folder.path());
    let part = TRAIN.replace("--epochs 60", "--epochs 5");
    json(&format!("{part} --checkpoint c.json --json"), folder.path());
    let resumed = json("train --checkpoint c.json --resume --epochs 60 --json", folder.path());
    assert_eq!(
        (&resumed["targets"], &resumed["epochs"]),
        (&whole["targets"], &whole["epochs"])
    );
    change(&folder, "sensor.csv");
    let changed = "train --checkpoint c.json --resume --epochs 70";
    refused(changed, folder.path(), 1, OTHER_SAMPLES);
}

#[test]
fn a_decoder_is_not_fitted_to_samples_that_have_changed() {
    let folder = recordings();
    json(&format!("{TRAIN} --out n.json --json"), folder.path());
    let export = "export --network n.json --decoder ridge --format numpy --json --out";
    assert_eq!(json(&format!("{export} first"), folder.path())["format"], "numpy");
    change(&folder, "sensor.csv");
    refused(&format!("{export} second"), folder.path(), 1, OTHER_SAMPLES);
    assert!(!folder.path().join("second").exists());
}

#[test]
fn moved_files_of_a_checkpoint_are_found_by_the_given_name() {
    let folder = recordings();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir_all(path("moved/again")).unwrap();
    let part = TRAIN.replace("--epochs 60", "--epochs 5");
    json(
        &format!("{part} --checkpoint runs/c.json --json").replace("runs/", ""),
        folder.path(),
    );
    fs::rename(path("c.json"), path("moved/c.json")).unwrap();
    for name in ["sensor.csv", "states.csv"] {
        fs::rename(path(name), path(&format!("moved/again/{name}"))).unwrap();
    }
    let resume = "train --checkpoint moved/c.json --resume --epochs 8";
    let causes = [
        "'moved/c.json'",
        "sensor.csv' is missing",
        "give its new path with --data FILE",
    ];
    has(&failure(resume, folder.path(), 1), &causes);
    let other = format!("{resume} --test-data moved/again/states.csv");
    refused(&other, folder.path(), 2, "--test-data: the checkpoint has no such file");
    // The joined file is in the same folder.
    let resumed = json(&format!("{resume} --data moved/again/sensor.csv --json"), folder.path());
    assert_eq!(resumed["epochs"], 8);
    // A file with another name is matched by its argument.
    fs::rename(path("moved/again/sensor.csv"), path("renamed.csv")).unwrap();
    let renamed = format!("{resume} --data renamed.csv --join moved/again/states.csv");
    json(
        &format!("{renamed} --epochs 9 --json").replacen("--epochs 8 ", "", 1),
        folder.path(),
    );
    change(&folder, "renamed.csv");
    refused(&renamed, folder.path(), 1, OTHER_SAMPLES);
}

#[test]
fn other_decoders_are_measured_on_a_recording_if_requested() {
    let folder = recordings();
    let report = json(&format!("{TRAIN} --json"), folder.path());
    assert_eq!(report.get("decoders"), None);
    let report = json(&format!("{TRAIN} --decoder mean,ridge,rbf --json"), folder.path());
    let decoders = report["decoders"].as_object().unwrap();
    assert_eq!(Vec::from_iter(decoders.keys()), ["mean", "rbf", "ridge"]);
    for name in ["mean", "ridge"] {
        let one = number(&decoders[name]["targets"][1], "rmse");
        let other = number(&report["baselines"][name][1], "rmse");
        assert!((one / other - 1.0).abs() < 1e-12, "{name}: {one} {other}");
        assert!(number(&decoders[name], "frame_us") > 0.0);
    }
}

#[test]
fn the_network_of_a_recording_decodes_files_and_lines_by_column_names() {
    let folder = recordings();
    json(&format!("{TRAIN} --out n.json --json"), folder.path());
    success(
        "decode --network n.json --data sensor.csv --out decoded.csv",
        folder.path(),
    );
    let decoded = read(folder.path(), "decoded.csv");
    let lines = Vec::from_iter(decoded.lines());
    let header = "c1,states.c2 (mm),states.c2_half_width_90 (mm),states.c3,states.c3_half_width_90,readings_outside,\
                  targets_outside";
    assert_eq!((lines[0], lines.len()), (header, 301));
    let states = column(&format!("t,x,y,height\n{}", read(folder.path(), "states.csv")), "x");
    let errors = column(&decoded, "states.c2")
        .into_iter()
        .zip(states)
        .map(|(one, other)| (one - other).abs());
    assert!(errors.sum::<f64>() / 300.0 < 0.1);
    // The same readings as lines, without the time.
    let sensor = read(folder.path(), "sensor.csv");
    let readings = sensor
        .lines()
        .take(5)
        .map(|line| line.split_once(',').unwrap().1.to_owned() + "\n");
    write(
        folder.path(),
        "in.csv",
        format!("c2,c3,c4\n{}1,2\n", readings.collect::<String>()),
    );
    let (followed, message) = both("decode --network n.json --follow --data in.csv", folder.path());
    let without_time = lines[..6].iter().map(|line| line.split_once(',').unwrap().1);
    assert!(followed.lines().eq(without_time), "{followed}");
    has(&message, &["line 7: 2 cells where 3 are needed"]);
}

/// A network with the inputs x1 and x2, `n.json`; y = x1 - 2 x2.
fn with_two_inputs() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let value = |k: u32, by: u32| f64::from(k * by % 101) / 50.0 - 1.0;
    let rows = (0..200).map(|k| {
        let (x1, x2) = (value(k, 37), value(k, 53));
        format!("{x1},{x2},{}\n", x1 - 2.0 * x2)
    });
    let text = format!("x1 (V),x2,y\n{}", rows.collect::<String>());
    write(folder.path(), "train.csv", text);
    let train = "train --data train.csv --inputs x1,x2 --targets y --hidden 4 --epochs 30 --out n.json --json";
    json(train, folder.path());
    folder
}

#[test]
fn columns_are_matched_by_name_in_files_and_streams() {
    let folder = with_two_inputs();
    let calls = [
        "decode --network n.json --follow --data in.csv",
        "decode --network n.json --data in.csv --out -",
    ];
    let answers = |call: &str| column(&success(call, folder.path()), "y");
    let are_right = |found: &[f64]| {
        let mut pairs = found.iter().zip([0.7, -1.1, 0.1]);
        found.len() == 3 && pairs.all(|(one, other)| (one - other).abs() < 0.05)
    };
    for text in [
        "x1,x2\n0.5,-0.1\n-0.3,0.4\n0.9,0.4\n",
        "time,note,x2,x1 (V)\n0,a,-0.1,0.5\n1,b,0.4,-0.3\n2,c,0.4,0.9\n",
        "\u{feff}\"x2\",x1\r\n-0.1,0.5\r\n0.4,-0.3\r\n0.4,0.9\r\n",
        "0.5,-0.1\n-0.3,0.4\n0.9,0.4\n",
    ] {
        write(folder.path(), "in.csv", text);
        for call in calls {
            let found = answers(call);
            assert!(are_right(&found), "{call}, {text}: {found:?}");
        }
    }
    // The header of a stream may be repeated, in another order.
    write(folder.path(), "in.csv", "x1,x2\n0.5,-0.1\nx2,x1\n0.4,-0.3\n0.4,0.9\n");
    assert!(are_right(&answers(calls[0])));
    for (text, words) in [
        ("x1,z\n0.5,-0.1\n", "there is no column 'x2'"),
        (
            "x2,x1 (mV)\n-0.1,0.5\n",
            "column 'x1' is in mV, and the network was trained on V",
        ),
        ("1,2,3\n4,5,6\n", "3 cells where 2 are needed"),
    ] {
        write(folder.path(), "in.csv", text);
        for call in calls {
            let output = decoupler(call, folder.path());
            let message = String::from_utf8(output.stderr).unwrap();
            assert!(output.status.code() == Some(1) && output.stdout.is_empty(), "{message}");
            let errors = Vec::from_iter(message.lines().filter(|line| line.starts_with("error")));
            assert!(errors.len() == 1 && errors[0].contains(words), "{message}");
        }
    }
}

#[test]
fn an_inspection_prints_layout_columns_and_times() {
    let folder = recordings();
    let report = json("inspect --data states.csv --json", folder.path());
    assert_eq!(
        (&report["rows"], &report["dialect"]["separator"]),
        (&Value::from(300), &Value::from("comma"))
    );
    assert_eq!(report["columns"][3]["kind"], "integer");
    assert_eq!(report["time"]["column"], "c1");
    assert!((report["time"]["median_interval"].as_f64().unwrap() - 0.1).abs() < 1e-9);
    let text = success("inspect --data states.csv", folder.path());
    has(
        &text,
        &["300 rows × 4 columns", "separator comma", "█", "median interval"],
    );
}

#[test]
fn positions_of_targets_are_reported_kept_in_the_recipe_and_checked_by_line() {
    let folder = recordings();
    let positions = |text: &str| write(folder.path(), "taxels.csv", text);
    positions("target,x,y\nstates.c2,0,0\nstates.c3,4,0\n");
    let arguments = TRAIN.replace("--unit states.c2=mm", "--positions taxels.csv");
    let text = success(&format!("{arguments} --recipe-out import.json"), folder.path());
    has(&text, &["2 targets have positions: a grid of 2 × 1"]);
    let report = json("train --recipe import.json --hidden 2 --epochs 3 --json", folder.path());
    let place = &report["positions"][1];
    assert_eq!((&place["target"], &place["x_mm"]), (&"states.c3".into(), &4.0.into()));
    positions("target,x,y\nstates.c2,0,0\nstates.c4,4,0\n");
    refused(
        &arguments,
        folder.path(),
        1,
        "'taxels.csv': line 3: there is no target 'states.c4'",
    );
}

#[test]
fn a_recipe_of_a_simulated_array_trains_the_same_network() {
    let folder = tempfile::tempdir().unwrap();
    let array = "--array 4x3_2x9 --axes xyz --noise 1e-3 --samples 60 --set test-samples=20";
    let train = "train --hidden 3 --epochs 5 --decoder mean --json";
    let first = json(&format!("{train} {array} --out n.json"), folder.path());
    let settings = NetworkFile::load(&folder.path().join("n.json")).unwrap().settings;
    RecipeFile::Simulated(*settings.simulation().unwrap())
        .save(&folder.path().join("array.json"))
        .unwrap();
    let again = json(&format!("{train} --recipe array.json"), folder.path());
    assert_eq!((&first["errors"], &first["scene"]), (&again["errors"], &again["scene"]));
    // Arguments change what the recipe describes.
    let other = json(&format!("{train} --recipe array.json --samples 80"), folder.path());
    assert_eq!((&other["samples"], &other["array"]), (&80.into(), &first["array"]));
    refused(
        "train --recipe array.json --split time",
        folder.path(),
        2,
        "--split needs --data",
    );
    refused(
        "trade --recipe array.json",
        folder.path(),
        1,
        "is the recipe of a simulated array",
    );
}

#[test]
fn separators_are_named_or_typed_and_names_of_encodings_have_any_case() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.csv"), "u;v\n1,5;2\n2,5;3\n").unwrap();
    for layout in [
        "--separator ; --decimal , --encoding UTF-8",
        "--separator semicolon --decimal comma --encoding utf-8",
    ] {
        let report = json(&format!("inspect --data a.csv {layout} --json"), folder.path());
        assert_eq!(
            report["format"], "text: separator semicolon, decimal comma, a header, utf-8",
            "{report}"
        );
    }
}
