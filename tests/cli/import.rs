//! Recordings in the terminal: inspection, training, resuming and decoding; options of a simulated sensor are refused.

use std::{
    fs,
    io::Write as _,
    path::Path,
    process::{Command, Stdio},
};

use decoupler_files::export::{NetworkFile, RecipeFile};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use serde_json::Value;
use tempfile::TempDir;

use crate::{printed::json, terminal::decoupler};

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
    fs::write(folder.path().join("sensor.csv"), sensor).unwrap();
    fs::write(folder.path().join("states.csv"), states).unwrap();
    folder
}

fn failure(arguments: &str, folder: &Path, status: i32) -> String {
    let output = decoupler(arguments, folder);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(
        (output.status.code(), message.lines().count()),
        (Some(status), 1),
        "{arguments}: {message}"
    );
    message
}

#[test]
fn a_network_is_trained_on_joined_files_and_evaluated_for_each_target() {
    let folder = recordings();
    let report = json(
        &format!("{TRAIN} --split time --test-fraction 0.2 --json"),
        folder.path(),
    );
    assert_eq!(report["split"], "time");
    let count = |name: &str| report[name].as_u64().unwrap();
    assert_eq!(
        count("samples") + count("validation_samples") + count("test_samples"),
        270
    );
    assert_eq!(count("test_samples"), 54);
    assert_eq!(report["dropped"][0]["rows"], 30);
    assert_eq!(report["dropped"][0]["reason"], "states.c4<3 is not met");
    assert_eq!(report["files"][1]["join"]["without_partner"], 0);
    for (index, (name, unit)) in [("states.c2", Value::from("mm")), ("states.c3", Value::Null)]
        .into_iter()
        .enumerate()
    {
        let target = &report["targets"][index];
        assert_eq!((&target["name"], &target["unit"]), (&Value::from(name), &unit));
        let rmse = |from: &Value| from[index]["rmse"].as_f64().unwrap();
        let [network, ridge, mean] = [
            &report["targets"],
            &report["baselines"]["ridge"],
            &report["baselines"]["mean"],
        ]
        .map(rmse);
        assert!(network < 0.5 * ridge && ridge < mean, "{network} {ridge} {mean}");
        assert!(target["r2"].as_f64().unwrap() > 0.9 && target["worst"].as_f64().unwrap() >= network);
    }
}

#[test]
fn a_recipe_trains_the_same_network_and_folds_test_every_sample() {
    let folder = recordings();
    let first = json(&format!("{TRAIN} --recipe-out import.json --json"), folder.path());
    let again = json(
        "train --recipe import.json --hidden 6 --starts 1 --epochs 60 --json",
        folder.path(),
    );
    assert_eq!(
        (&first["targets"], &first["dropped"]),
        (&again["targets"], &again["dropped"])
    );
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
    let recipe = fs::read_to_string(folder.path().join("none.json")).unwrap();
    let fraction = |share: &str| recipe.replace("\"validation_fraction\": 0.0", share);
    assert_ne!(fraction(""), recipe);
    fs::write(
        folder.path().join("null.json"),
        fraction("\"validation_fraction\": null"),
    )
    .unwrap();
    assert_eq!(held_out("--recipe null.json", "lm"), 48);
}

#[test]
fn a_checkpoint_resumes_unless_its_samples_have_changed() {
    let folder = recordings();
    let whole = json(&format!("{TRAIN} --json"), folder.path());
    let part = TRAIN.replace("--epochs 60", "--epochs 5");
    json(&format!("{part} --checkpoint c.json --json"), folder.path());
    fs::copy(folder.path().join("c.json"), folder.path().join("d.json")).unwrap();
    for (argument, value) in [
        ("--split", "random"),
        ("--inputs", "c3"),
        ("--scaling", "whiten"),
        ("--folds", "3"),
        ("--test-data", "states.csv"),
        ("--rows", "known"),
        ("--noise", "0.1"),
        ("--set", "drift=0.1"),
        ("--array", "4x3_2x8"),
        ("--samples", "10"),
        ("--loading", "indenter"),
        ("--preset", "best"),
        ("--decoder", "newton"),
        ("--recipe", "r.json"),
        ("--hidden", "99"),
        ("--starts", "9"),
        ("--seed", "99"),
    ] {
        let message = failure(
            &format!("train --checkpoint d.json --resume {argument} {value}"),
            folder.path(),
            2,
        );
        assert!(message.contains(argument), "{argument}: {message}");
    }
    let resumed = json("train --checkpoint c.json --resume --epochs 60 --json", folder.path());
    assert_eq!(
        (&resumed["targets"], &resumed["epochs"]),
        (&whole["targets"], &whole["epochs"])
    );
    let sensor = folder.path().join("sensor.csv");
    fs::write(&sensor, fs::read_to_string(&sensor).unwrap().replacen("0.", "0.1", 9)).unwrap();
    let message = failure("train --checkpoint d.json --resume --epochs 60", folder.path(), 1);
    assert!(
        message.contains("has other samples than when the run was saved"),
        "{message}"
    );
}

#[test]
fn a_decoder_is_not_fitted_to_samples_that_have_changed() {
    let folder = recordings();
    json(&format!("{TRAIN} --out n.json --json"), folder.path());
    let export = "export --network n.json --decoder ridge --format numpy --json --out";
    assert_eq!(json(&format!("{export} first"), folder.path())["format"], "numpy");
    let sensor = folder.path().join("sensor.csv");
    fs::write(&sensor, fs::read_to_string(&sensor).unwrap().replacen("0.", "0.1", 9)).unwrap();
    let message = failure(&format!("{export} second"), folder.path(), 1);
    assert!(
        message.contains("has other samples than when the run was saved"),
        "{message}"
    );
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
    let message = failure(resume, folder.path(), 1);
    for expected in [
        "'moved/c.json'",
        "sensor.csv' is missing",
        "give its new path with --data FILE",
    ] {
        assert!(message.contains(expected), "{message}");
    }
    let message = failure(
        &format!("{resume} --test-data moved/again/states.csv"),
        folder.path(),
        2,
    );
    assert!(
        message.contains("--test-data: the checkpoint has no such file"),
        "{message}"
    );
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
    fs::write(
        path("renamed.csv"),
        fs::read_to_string(path("renamed.csv"))
            .unwrap()
            .replacen("0.", "0.1", 9),
    )
    .unwrap();
    let message = failure(&renamed, folder.path(), 1);
    assert!(
        message.contains("has other samples than when the run was saved"),
        "{message}"
    );
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
        let [one, other] = [&decoders[name], &report["baselines"]].map(|from| {
            let targets = if from.is_object() && from.get("targets").is_some() {
                &from["targets"]
            } else {
                &from[name]
            };
            targets[1]["rmse"].as_f64().unwrap()
        });
        assert!((one / other - 1.0).abs() < 1e-12, "{name}: {one} {other}");
        assert!(decoders[name]["frame_us"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn the_network_of_a_recording_decodes_files_and_lines_by_column_names() {
    let folder = recordings();
    json(&format!("{TRAIN} --out n.json --json"), folder.path());
    let output = decoupler(
        "decode --network n.json --data sensor.csv --out decoded.csv",
        folder.path(),
    );
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let decoded = fs::read_to_string(folder.path().join("decoded.csv")).unwrap();
    let lines: Vec<&str> = decoded.lines().collect();
    assert_eq!(
        (lines[0], lines.len()),
        (
            "c1,states.c2 (mm),states.c2_half_width_90 (mm),states.c3,states.c3_half_width_90,readings_outside,\
             targets_outside",
            301
        )
    );
    let states = fs::read_to_string(folder.path().join("states.csv")).unwrap();
    let number = |line: &str, column: usize| line.split(',').nth(column).unwrap().parse::<f64>().unwrap();
    let errors = lines[1..]
        .iter()
        .zip(states.lines())
        .map(|(decoded, state)| (number(decoded, 1) - number(state, 1)).abs());
    assert!(errors.sum::<f64>() / 300.0 < 0.1);
    // The same readings as lines, without the time.
    let mut follow = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    follow
        .args(["decode", "--network", "n.json", "--follow"])
        .current_dir(folder.path());
    let mut follow = follow
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let sensor = fs::read_to_string(folder.path().join("sensor.csv")).unwrap();
    let readings: String = sensor
        .lines()
        .take(5)
        .map(|line| line.split_once(',').unwrap().1.to_owned() + "\n")
        .collect();
    follow
        .stdin
        .take()
        .unwrap()
        .write_all(format!("c2,c3,c4\n{readings}1,2\n").as_bytes())
        .unwrap();
    let output = follow.wait_with_output().unwrap();
    let followed = String::from_utf8(output.stdout).unwrap();
    let without_time = lines[..6].iter().map(|line| line.split_once(',').unwrap().1);
    assert_eq!(followed.lines().collect::<Vec<_>>(), Vec::from_iter(without_time));
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("line 7: 2 cells where 3 are needed"), "{message}");
    let message = failure(
        "decode --network n.json --data states.csv --out x.csv --fault-noise 1",
        folder.path(),
        2,
    );
    assert!(message.contains("cannot be used with '--fault-noise"), "{message}");
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
    fs::write(folder.path().join("train.csv"), text).unwrap();
    let train = "train --data train.csv --inputs x1,x2 --targets y --hidden 4 --epochs 30 --out n.json --json";
    json(train, folder.path());
    folder
}

#[test]
fn columns_are_matched_by_name_in_files_and_streams() {
    let folder = with_two_inputs();
    let write = |text: &str| fs::write(folder.path().join("in.csv"), text).unwrap();
    let follow = || decoupler("decode --network n.json --follow --data in.csv", folder.path());
    let decode = || decoupler("decode --network n.json --data in.csv --out out.csv", folder.path());
    let answers = |text: &str| {
        let lines = text.lines().skip(1);
        lines
            .map(|line| line.split(',').next().unwrap().parse::<f64>().unwrap())
            .collect::<Vec<_>>()
    };
    let expected = [0.7, -1.1, 0.1];
    for text in [
        "x1,x2\n0.5,-0.1\n-0.3,0.4\n0.9,0.4\n",
        "x2,x1\n-0.1,0.5\n0.4,-0.3\n0.4,0.9\n",
        "time,note,x2,x1 (V)\n0,a,-0.1,0.5\n1,b,0.4,-0.3\n2,c,0.4,0.9\n",
        "\u{feff}\"x2\",x1\r\n-0.1,0.5\r\n0.4,-0.3\r\n0.4,0.9\r\n",
        "0.5,-0.1\n-0.3,0.4\n0.9,0.4\n",
    ] {
        write(text);
        let output = follow();
        assert!(
            output.status.success(),
            "{text}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        let followed = answers(&String::from_utf8(output.stdout).unwrap());
        let output = decode();
        assert!(
            output.status.success(),
            "{text}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        let decoded = answers(&fs::read_to_string(folder.path().join("out.csv")).unwrap());
        for found in [followed, decoded] {
            assert_eq!(found.len(), 3, "{text}");
            let pairs = found.iter().zip(expected);
            assert!(
                pairs.into_iter().all(|(one, other)| (one - other).abs() < 0.05),
                "{text}: {found:?}"
            );
        }
    }
    for (text, words) in [
        ("x1,z\n0.5,-0.1\n", "there is no column 'x2'"),
        ("a,b\n0.5,-0.1\n", "there is no column 'x1'"),
        (
            "x2,x1 (mV)\n-0.1,0.5\n",
            "column 'x1' is in mV, and the network was trained on V",
        ),
        ("1,2,3\n4,5,6\n", "3 cells where 2 are needed"),
    ] {
        write(text);
        for output in [follow(), decode()] {
            let message = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(1), "{message}");
            let errors: Vec<&str> = message.lines().filter(|line| line.starts_with("error")).collect();
            assert!(errors.len() == 1 && errors[0].contains(words), "{message}");
            assert!(output.stdout.is_empty());
        }
    }
    // The header may be repeated, in another order.
    write("x1,x2\n0.5,-0.1\nx2,x1\n0.4,-0.3\n0.4,0.9\n");
    let followed = answers(&String::from_utf8(follow().stdout).unwrap());
    assert!(
        followed
            .iter()
            .zip(expected)
            .all(|(one, other)| (one - other).abs() < 0.05),
        "{followed:?}"
    );
}

#[test]
fn options_of_a_simulated_sensor_are_refused_with_a_reason() {
    let folder = recordings();
    for (arguments, cause) in [
        ("--array 2x2_2x6", "--array: a recording (--data) has no array"),
        ("--noise 0.1", "--noise: a recording (--data) has its own noise"),
        ("--loading random", "--loading: a recording (--data) has no scene"),
        ("--samples 10", "--samples: all rows"),
        ("--rows known", "--row-wire"),
        (
            "--decoder newton",
            "--decoder newton: it solves the equations of a simulated array",
        ),
        ("--split group", "--group"),
        ("--targets states.c9", "there is no column 'states.c9'"),
    ] {
        let message = failure(&format!("{TRAIN} {arguments}"), folder.path(), 2);
        assert!(message.contains(cause), "{arguments}: {message}");
    }
    for (arguments, cause) in [
        ("train --split time", "--split needs --data or --recipe"),
        ("train --inputs c2,c3", "columns need --data"),
        ("train --inputs volt", "volt"),
        ("train --data sensor.csv --inputs c2", "--targets: name the columns"),
    ] {
        let message = failure(arguments, folder.path(), 2);
        assert!(message.contains(cause), "{arguments}: {message}");
    }
    let message = failure("train --data none.csv --inputs c1 --targets c2", folder.path(), 1);
    assert!(message.contains("there is no such file"), "{message}");
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
    let text = String::from_utf8(decoupler("inspect --data states.csv", folder.path()).stdout).unwrap();
    assert!(
        text.contains("300 rows × 4 columns") && text.contains("separator comma"),
        "{text}"
    );
    assert!(text.contains('█') && text.contains("median interval"), "{text}");
}

#[test]
fn positions_of_targets_are_reported_kept_in_the_recipe_and_checked_by_line() {
    let folder = recordings();
    let positions = |text: &str| fs::write(folder.path().join("taxels.csv"), text).unwrap();
    positions("target,x,y\nstates.c2,0,0\nstates.c3,4,0\n");
    let arguments = TRAIN.replace("--unit states.c2=mm", "--positions taxels.csv");
    let output = decoupler(&format!("{arguments} --recipe-out import.json"), folder.path());
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("2 targets have positions: a grid of 2 × 1"), "{text}");
    let report = json("train --recipe import.json --hidden 2 --epochs 3 --json", folder.path());
    assert_eq!(report["positions"][1]["target"], "states.c3");
    assert_eq!(report["positions"][1]["x_mm"], 4.0);

    let units = format!("{TRAIN} --positions taxels.csv");
    let message = failure(&units, folder.path(), 1);
    assert!(
        message.contains("states.c2 (mm) and states.c3 have positions but different units"),
        "{message}"
    );
    positions("target,x,y\nstates.c2,0,0\nstates.c4,4,0\n");
    let message = failure(&arguments, folder.path(), 1);
    assert!(
        message.contains("'taxels.csv': line 3: there is no target 'states.c4'"),
        "{message}"
    );
    let message = failure("inspect --data sensor.csv --positions taxels.csv", folder.path(), 2);
    assert!(message.contains("--targets <COLUMNS>"), "{message}");
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
    let message = failure("train --recipe array.json --split time", folder.path(), 2);
    assert!(message.contains("--split needs --data"), "{message}");
    let message = failure("trade --recipe array.json", folder.path(), 1);
    assert!(message.contains("is the recipe of a simulated array"), "{message}");
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
