//! A real sensor in the terminal: calibration, training on the calibrated model, and fine-tuning on its frames.

use std::{fmt::Write as _, path::Path};

use decoupler_core::{
    dataset::{Dataset, Seed, Stream},
    scene::{Loading, Noise, Scene},
    sensor::SensorModel,
};

use crate::calls::{failure, has, json, number, read, said, success, write};

const ARRAY: &str = "4x4_3x12";
const FRAMES: &str = "--data frames.csv --inputs r_1..r_12 --depths d_1..d_4 --row-wire row --group frame";

/// Writes frames of a sensor that differs from the nominal one, with the depths of its nodes as the only known targets.
fn record(folder: &Path) -> SensorModel {
    let mut real = SensorModel::new(ARRAY.parse().unwrap());
    real.geometry.height_mm *= 1.05;
    real.geometry.node_pitch_mm *= 0.95;
    real.geometry.column_node_x0_mm *= 1.05;
    let scene = Scene {
        loading: Loading::SmoothField {
            correlation_length_mm: 4.0,
        },
        noise: Noise::relative(1e-3),
        ..Scene::default()
    };
    let mut set = Dataset::simulate(&real, &scene, 240, &mut Seed(1).rng(Stream::Training)).unwrap();
    set.disturb(&real, &scene.noise, &mut Seed(1).rng(Stream::TrainingNoise))
        .unwrap();
    let names = (1..=12)
        .map(|column| format!(",r_{column}"))
        .chain((1..=4).map(|node| format!(",d_{node}")));
    let mut text = format!("frame,row{}\n", names.collect::<String>());
    for sample in 0..set.samples() {
        let row = set.row_wire(sample).unwrap();
        write!(text, "{},{}", set.groups()[sample], row + 1).unwrap();
        let depths = set
            .sample_targets(sample)
            .chunks(3)
            .map(|node| real.geometry.height_mm - node[2]);
        for value in set.sample_readings(sample).iter().copied().chain(depths) {
            write!(text, ",{value}").unwrap();
        }
        text.push('\n');
    }
    write(folder, "frames.csv", text);
    real
}

#[test]
fn a_real_sensor_is_calibrated_and_a_network_trained_and_fine_tuned() {
    let folder = tempfile::tempdir().unwrap();
    let real = record(folder.path());
    let path = folder.path();
    let calibrate = format!("calibrate --array {ARRAY} {FRAMES}");
    let report = json(&format!("{calibrate} --out sensor.json --json"), path);
    let parameters = report["parameters"].as_array().unwrap();
    for (name, truth) in [
        ("height", real.geometry.height_mm),
        ("node pitch", real.geometry.node_pitch_mm),
        ("x of the first column node", real.geometry.column_node_x0_mm),
    ] {
        let found = parameters.iter().find(|parameter| parameter["name"] == name).unwrap();
        let [value, half_width] = ["value", "half_width"].map(|name| number(found, name));
        let is_found = (value - truth).abs() <= half_width && half_width < 0.03 * truth;
        assert!(is_found, "{name}: {value} ± {half_width}");
    }
    assert!(number(&report, "residual") < 1.2e-3 && number(&report, "nominal_residual") > 1e-2);
    assert_eq!(report["warnings"], serde_json::json!([]));
    has(&success(&calibrate, path), &["height: 5.2", " before, "]);
    let wrong = said(&format!("calibrate --array 4x4_4x12 {FRAMES}"), path);
    has(
        &wrong,
        &["standard deviations from nominal values", "check the array scale"],
    );
    let train = "--rows known --inputs conductance --loading smooth:4 --noise 1e-3 --samples 400 --set validation-samples=80 \
                 --hidden 6 --epochs 15 --decoder mean --json";
    success(
        &format!("train --sensor sensor.json {train} --out calibrated.json"),
        path,
    );
    success(&format!("train --array {ARRAY} {train} --out nominal.json"), path);
    let tune = |network: &str| {
        let tune = format!("fine-tune --network {network}.json {FRAMES} --epochs 15 --out {network}_tuned.json --json");
        let report = json(&tune, path);
        ["z_mm_before", "z_mm_after"].map(|name| number(&report, name))
    };
    let (calibrated, nominal) = (tune("calibrated"), tune("nominal"));
    assert!(calibrated[0] < 0.5 * nominal[0], "{calibrated:?} {nominal:?}");
    let is_better = nominal[1] < nominal[0] && calibrated[1] < 1.2 * calibrated[0];
    assert!(is_better, "{calibrated:?} {nominal:?}");
    success(
        "export --network calibrated_tuned.json --format numpy --out bundle",
        path,
    );
}

/// Line 6 of the file has an impossible value; both commands apply the same checks.
#[test]
fn impossible_readings_and_depths_are_refused_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path());
    let path = folder.path();
    let small = "--decoder mean --samples 40 --set validation-samples=0 --set test-samples=8 --epochs 1";
    success(&format!("train --array {ARRAY} {small} --out net.json"), path);
    let valid = read(path, "frames.csv");
    let calibrate = format!("calibrate --array {ARRAY} {FRAMES}");
    let tune = format!("fine-tune --network net.json {FRAMES} --epochs 1 --out tuned.json");
    // Columns are frame, row, r_1 to r_12 and d_1 to d_4. Without a scene, depths are limited only by the height.
    for (column, value, commands, cause) in [
        (
            3,
            "-5",
            &[&calibrate, &tune][..],
            "column 2: the reading -5 is not a resistance",
        ),
        (
            13,
            "1e300",
            &[&calibrate, &tune],
            "column 12: the reading 1e300 ohm is implausible",
        ),
        (14, "-3", &[&calibrate, &tune], "node 1: it is pressed down by -3 mm"),
        (
            15,
            "1.7",
            &[&tune],
            "node 2: it is pressed down by 1.7 mm, but only 0 to 1 mm is possible",
        ),
    ] {
        let mut lines = Vec::from_iter(valid.lines().map(str::to_owned));
        let mut cells = Vec::from_iter(lines[5].split(','));
        cells[column] = value;
        lines[5] = cells.join(",");
        write(path, "frames.csv", lines.join("\n"));
        for command in commands {
            has(&failure(command, path, 1), &[cause, "frames.csv': line 6:", "--where"]);
        }
        assert!(!path.join("tuned.json").exists());
    }
}
