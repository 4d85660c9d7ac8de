//! A real sensor in the terminal: calibration, training on the calibrated model, and fine-tuning on its frames.

use std::{fmt::Write as _, fs, path::Path};

use decoupler_core::{
    dataset::{Dataset, Seed, Stream},
    scene::{Loading, Noise, Scene},
    sensor::SensorModel,
};

use crate::{printed::json, terminal::decoupler};

const ARRAY: &str = "4x4_3x12";
const FRAMES: &str = "--data frames.csv --inputs r_1..r_12 --depths d_1..d_4 --row-wire row --group frame";

/// Writes frames of a sensor that differs from the nominal one, with the depths of its nodes as the only known targets.
fn record(folder: &Path) -> SensorModel {
    let nominal = SensorModel::new(ARRAY.parse().unwrap());
    let mut real = nominal;
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
    let names = |letter: &str, count| {
        (1..=count)
            .map(|number| format!("{letter}_{number}"))
            .collect::<Vec<_>>()
    };
    let mut text = format!("frame,row,{},{}\n", names("r", 12).join(","), names("d", 4).join(","));
    for sample in 0..set.samples() {
        let row = set.row_wire(sample).unwrap();
        write!(text, "{},{}", set.groups()[sample], row + 1).unwrap();
        set.sample_readings(sample)
            .iter()
            .for_each(|ohm| write!(text, ",{ohm}").unwrap());
        let rest = real.geometry.height_mm;
        let depths = set.sample_targets(sample).chunks(3).map(|node| rest - node[2]);
        depths.for_each(|depth| write!(text, ",{depth}").unwrap());
        text.push('\n');
    }
    fs::write(folder.join("frames.csv"), text).unwrap();
    real
}

#[test]
fn a_real_sensor_is_calibrated_and_a_network_trained_and_fine_tuned() {
    let folder = tempfile::tempdir().unwrap();
    let real = record(folder.path());
    let path = folder.path();
    let report = json(
        &format!("calibrate --array {ARRAY} {FRAMES} --out sensor.json --json"),
        path,
    );
    let fitted = |name: &str| {
        let parameters = report["parameters"].as_array().unwrap();
        let found = parameters.iter().find(|parameter| parameter["name"] == name).unwrap();
        (found["value"].as_f64().unwrap(), found["half_width"].as_f64().unwrap())
    };
    for (name, truth) in [
        ("height", real.geometry.height_mm),
        ("node pitch", real.geometry.node_pitch_mm),
        ("x of the first column node", real.geometry.column_node_x0_mm),
    ] {
        let (value, half_width) = fitted(name);
        assert!(
            (value - truth).abs() <= half_width && half_width < 0.03 * truth,
            "{name}: {value} ± {half_width}"
        );
    }
    let residual = |name: &str| report[name].as_f64().unwrap();
    assert!(residual("residual") < 1.2e-3 && residual("nominal_residual") > 1e-2);
    let train = "--rows known --inputs conductance --loading smooth:4 --noise 1e-3 --samples 400 --set validation-samples=80 \
                 --hidden 6 --epochs 15 --decoder mean --json";
    json(
        &format!("train --sensor sensor.json {train} --out calibrated.json"),
        path,
    );
    json(&format!("train --array {ARRAY} {train} --out nominal.json"), path);
    let tune = |network: &str| {
        let arguments =
            format!("fine-tune --network {network}.json {FRAMES} --epochs 15 --out {network}_tuned.json --json");
        let report = json(&arguments, path);
        ["z_mm_before", "z_mm_after"].map(|name| report[name].as_f64().unwrap())
    };
    let (calibrated, nominal) = (tune("calibrated"), tune("nominal"));
    assert!(calibrated[0] < 0.5 * nominal[0], "{calibrated:?} {nominal:?}");
    assert!(
        nominal[1] < nominal[0] && calibrated[1] < 1.2 * calibrated[0],
        "{calibrated:?} {nominal:?}"
    );
    let output = decoupler(
        "export --network calibrated_tuned.json --format numpy --out bundle",
        path,
    );
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(decoupler(&format!("calibrate --array {ARRAY} {FRAMES}"), path).stdout).unwrap();
    assert!(text.contains("height: 5.2") && text.contains(" before, "), "{text}");
}

#[test]
fn frames_that_do_not_fit_the_array_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path());
    for (arguments, cause) in [
        (
            format!("--array 4x4_3x15 {FRAMES}"),
            "--inputs: 12 columns, where a row-wire of the array 4×4_3×15 needs 15",
        ),
        (
            format!("--array 3x4_4x12 {FRAMES}"),
            "'row' has row 4, and the array 3×4_4×12 has 3",
        ),
        (
            format!("--array {ARRAY} {}", FRAMES.replace("--row-wire row ", "")),
            "--row-wire: name the column",
        ),
        (
            format!("--array {ARRAY} {}", FRAMES.replace("--depths", "--targets")),
            "--targets: 4 columns",
        ),
        (
            format!("--array {ARRAY} --sensor x.json {FRAMES}"),
            "cannot be used with",
        ),
    ] {
        let output = decoupler(&format!("calibrate {arguments}"), folder.path());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(message.contains(cause), "{arguments}: {message}");
    }
    fs::write(folder.path().join("x.json"), "{}").unwrap();
    let output = decoupler("train --sensor x.json", folder.path());
    assert!(
        String::from_utf8_lossy(&output.stderr).contains("is not a sensor file"),
        "{output:?}"
    );
}

#[test]
fn arguments_that_divide_frames_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path());
    let path = folder.path();
    let trained =
        format!("train --array {ARRAY} --samples 40 --set test-samples=8 --epochs 1 --decoder mean --out net.json");
    assert!(decoupler(&trained, path).status.success());
    for argument in ["--split time", "--test-data none.csv"] {
        for command in [
            format!("calibrate --array {ARRAY} {FRAMES} {argument}"),
            format!("fine-tune --network net.json {FRAMES} --epochs 1 --out tuned.json {argument}"),
        ] {
            let output = decoupler(&command, path);
            let message = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(2), "{command}: {message}");
            let name = argument.split(' ').next().unwrap();
            assert!(
                message.contains(&format!("error: {name}: calibrate fits all frames")),
                "{message}"
            );
        }
    }
    assert!(!path.join("tuned.json").exists());
}

/// Line 6 of the file has an impossible value; both commands apply the same checks.
#[test]
fn impossible_readings_and_depths_are_refused_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path());
    let path = folder.path();
    let trained = decoupler(
        &format!(
            "train --array {ARRAY} --samples 40 --set validation-samples=0 --set test-samples=8 --epochs 1 --out net.json"
        ),
        path,
    );
    assert!(trained.status.success(), "{}", String::from_utf8_lossy(&trained.stderr));
    let valid = fs::read_to_string(path.join("frames.csv")).unwrap();
    // Columns are frame, row, r_1 to r_12 and d_1 to d_4.
    for (column, value, cause) in [
        (3, "-5", "column 2: the reading -5 is not a resistance"),
        (2, "0", "column 1: the reading 0 is not a resistance"),
        (13, "1e300", "column 12: the reading 1e300 ohm is implausible"),
        (14, "-3", "node 1: it is pressed down by -3 mm"),
        (17, "50", "node 4"),
        (
            15,
            "1.7",
            "node 2: it is pressed down by 1.7 mm, but only 0 to 1 mm is possible",
        ),
    ] {
        let damaged = valid.lines().enumerate().map(|(line, text)| {
            let mut cells: Vec<&str> = text.split(',').collect();
            if line == 5 {
                cells[column] = value;
            }
            cells.join(",") + "\n"
        });
        fs::write(path.join("frames.csv"), damaged.collect::<String>()).unwrap();
        let calibrated = format!("calibrate --array {ARRAY} {FRAMES}");
        let tuned = format!("fine-tune --network net.json {FRAMES} --epochs 1 --out tuned.json");
        for command in [&calibrated, &tuned] {
            // Without a scene, depths are limited only by the height.
            if value == "1.7" && command == &calibrated {
                continue;
            }
            let output = decoupler(command, path);
            let message = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(1), "{command}, {value}: {message}");
            assert!(
                message.contains(cause) && message.contains("frames.csv': line 6:") && message.contains("--where"),
                "{command}: {message}"
            );
        }
        assert!(!path.join("tuned.json").exists());
    }
}

#[test]
fn a_wrong_array_scale_causes_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path());
    let output = decoupler(&format!("calibrate --array 4x4_4x12 {FRAMES}"), folder.path());
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(
        text.contains("standard deviations from nominal values") && text.contains("check the array scale"),
        "{text}"
    );
    let report = json(&format!("calibrate --array {ARRAY} {FRAMES} --json"), folder.path());
    assert_eq!(report["warnings"], serde_json::json!([]));
}
