//! Networks of recordings, exported in the terminal with the names and units of their columns.

use std::{fs, path::Path};

use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use serde_json::Value;
use tempfile::TempDir;

use crate::terminal::decoupler;

/// A folder with a recording and its network `n.json`: readings of both signs, targets whose scales differ by 1e6, and
/// names with characters that end a comment or a cell.
fn trained(rows: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut text = "\"hall, a (µT)\",b */ x,c,row,force (N),torque (N·m)\n".to_owned();
    for sample in 0..240 {
        let [x, y]: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let row = [1, 3][sample % 2];
        text += &format!(
            "{},{},{},{row},{},{}\n",
            1e3 * x,
            y - 0.3 * x * x,
            5.0 + x * y,
            2e3 * x,
            1e-3 * y
        );
    }
    fs::write(folder.path().join("own.csv"), text).unwrap();
    // A recipe, because the terminal of a test splits arguments at spaces.
    let recipe = r#"{"format": "decoupler recipe", "version": 1, "program": "a test", "source": {"recording": {"import": {"data": "own.csv",
        "inputs": ["hall, a", "b */ x", "c"], "targets": ["force", "torque"], "row_wire": "row"}}}}"#;
    fs::write(folder.path().join("recipe.json"), recipe).unwrap();
    let arguments = format!("train --recipe recipe.json {rows} --hidden 4 --epochs 20 --out n.json --json");
    let output = decoupler(&arguments, folder.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    folder
}

fn export(arguments: &str, folder: &Path) -> Value {
    let output = decoupler(&format!("export --network n.json {arguments} --json"), folder);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments}: {message}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn columns(path: &Path, names: &[&str]) -> Vec<Vec<f64>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let headers = reader.headers().unwrap().clone();
    let index = |name: &&str| headers.iter().position(|other| other == *name).unwrap();
    let wanted: Vec<usize> = names.iter().map(index).collect();
    let record = |record: csv::StringRecord| wanted.iter().map(|&column| record[column].parse().unwrap()).collect();
    reader.records().map(|read| record(read.unwrap())).collect()
}

#[test]
fn golden_vectors_in_the_users_units_agree_with_decode() {
    let folder = trained("");
    let report = export("--format onnx --out bundle", folder.path());
    assert_eq!((&report["limit"], report.get("output_range_mm")), (&1e-12.into(), None));
    let golden = folder.path().join("bundle/golden.csv");
    let output = decoupler(
        "decode --network n.json --data bundle/golden.csv --out decoded.csv",
        folder.path(),
    );
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let golden = columns(&golden, &["force", "torque"]);
    let decoded = columns(&folder.path().join("decoded.csv"), &["force (N)", "torque (N·m)"]);
    assert!(golden.len() >= 7 && golden.len() == decoded.len());
    // Each target is accurate to the last digits of its range.
    for (golden, decoded) in golden.iter().zip(&decoded) {
        assert!((golden[0] - decoded[0]).abs() < 4e-9 && (golden[1] - decoded[1]).abs() < 2e-15);
    }
    let spread = |target: usize| {
        let values = golden.iter().map(|row| row[target]);
        values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
    };
    assert!(spread(0) > 1e3 && spread(1) < 1e-1, "{} {}", spread(0), spread(1));
    let metadata = fs::read_to_string(folder.path().join("bundle/metadata.json")).unwrap();
    let metadata: Value = serde_json::from_str(&metadata).unwrap();
    assert_eq!(metadata["inputs"]["names"][0], "hall, a");
    assert_eq!(metadata["inputs"]["units"][0], "µT");
    assert_eq!(metadata["outputs"]["units"], serde_json::json!(["N", "N·m"]));
    assert_eq!(metadata["files"], serde_json::json!(["own.csv"]));
    let range = |target: usize| metadata["output_ranges"][target].as_f64().unwrap();
    assert!((range(0) / 4e3 - 1.0).abs() < 0.1 && (range(1) / 2e-3 - 1.0).abs() < 0.1);
}

#[test]
fn every_format_is_verified_and_documents_names_units_and_rows() {
    let folder = trained("--rows known");
    let path = folder.path();
    for (format, precision, file) in [
        ("c99", "f64", "c99_f64_decode.h"),
        ("c99", "f32", "c99_f32_decode.h"),
        ("matlab", "f64", "matlab_f64_decode.m"),
        ("numpy", "f32", "decode.py"),
        ("onnx", "f32", "README.txt"),
    ] {
        let name = format!("{format}_{precision}");
        let report = export(&format!("--format {format} --precision {precision} --out {name}"), path);
        assert!(report["deviation"].as_f64().unwrap_or(0.0) <= report["limit"].as_f64().unwrap());
        assert!(report["verified_vectors"].as_u64().unwrap() > 50, "{report}");
        for file in [file, "README.txt"] {
            let text = fs::read_to_string(path.join(&name).join(file)).unwrap();
            let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
            for expected in ["force (N)", "torque (N·m)", "hall, a (µT)", "2 is row-wire 3"] {
                let plain = words.replace(" % ", " ").replace(" # ", " ");
                assert!(plain.contains(expected), "{file}: {expected} in {text}");
            }
            assert!(!words.contains(" mm") && !words.contains("ohm"), "{file}: {text}");
        }
    }
}

#[test]
fn other_decoders_of_a_recording_keep_names_units_and_rows() {
    let folder = trained("--rows known");
    let path = folder.path();
    for decoder in ["ridge", "rbf"] {
        let report = export(&format!("--decoder {decoder} --format onnx --out {decoder}"), path);
        assert!(report["limit"].as_f64().unwrap() < 1e-9, "{report}");
        let metadata = fs::read_to_string(path.join(decoder).join("metadata.json")).unwrap();
        let metadata: Value = serde_json::from_str(&metadata).unwrap();
        assert_eq!(metadata["decoder"], decoder);
        assert_eq!(metadata["row_numbers"], serde_json::json!([1, 3]));
        assert_eq!(metadata["outputs"]["names"], serde_json::json!(["force", "torque"]));
        assert!(
            metadata["errors"][0]["errors"]["rmse"].as_f64().unwrap() > 0.0,
            "{metadata}"
        );
        assert!(path.join(decoder).join("decoder.onnx").exists());
    }
    let output = decoupler("export --network n.json --decoder newton --format c99 --out b", path);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        !output.status.success() && message.contains("solves the equations of the sensor"),
        "{message}"
    );
}

/// For the golden vectors, rounded to the units in the header, the answers of the program's model and, if there is a
/// compiler, of the compiled source are within the bound of each target.
#[test]
fn integers_have_separate_units_for_each_column() {
    for rows in ["", "--rows known"] {
        let folder = trained(rows);
        let report = export("--format c99 --precision fixed16 --out whole", folder.path());
        let limit = report["limit"].as_f64().unwrap();
        assert!(
            report["deviation"].as_f64().unwrap() <= limit && limit < 0.02,
            "{report}"
        );
        let bounds = report["error_bounds"].as_array().unwrap();
        let of_target = |index: usize| {
            (
                &bounds[index]["name"],
                &bounds[index]["unit"],
                bounds[index]["bound"].as_f64(),
            )
        };
        let ((force, newton, of_force), (torque, _, of_torque)) = (of_target(0), of_target(1));
        assert_eq!(
            (force, newton, torque),
            (&"force".into(), &"N".into(), &"torque".into())
        );
        // Ranges of 4000 N and 0.002 N·m.
        assert!((4e3 * 1e-5..4e3 * 0.02).contains(&of_force.unwrap()), "{bounds:?}");
        assert!((2e-3 * 1e-5..2e-3 * 0.02).contains(&of_torque.unwrap()), "{bounds:?}");
        let header = fs::read_to_string(folder.path().join("whole/whole_decode.h")).unwrap();
        let units = |name: &str| -> Vec<f64> {
            let line = header.lines().find(|line| line.contains(name)).unwrap();
            let list = line.split_once('{').unwrap().1.trim_end_matches(['}', ' ']);
            list.split(',').map(|unit| unit.trim().parse().unwrap()).collect()
        };
        // Readings up to 1000, 1.3 and 6, and a tenth of the range next to them, in 30 bits.
        assert_eq!(units("WHOLE_READING_UNITS"), [1e-5, 1e-8, 1e-8]);
        assert_eq!(units("WHOLE_TARGET_UNITS"), [1e-3, 1e-9]);
        for expected in ["force (N)", "hall, a (µT)", "int32_t readings[WHOLE_CHANNELS]"] {
            assert!(header.contains(expected), "{expected} in {header}");
        }
        assert!(!header.contains("ohm") && !header.contains("nm"), "{header}");
    }
}

/// Readings that vary by a billionth of their size lose all information when rounded to single precision.
#[test]
fn offsets_too_large_for_single_precision_are_refused_with_cause_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let draws: Vec<[f64; 2]> = (0..120)
        .map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
        .collect();
    for (offset, range, is_written) in [
        (0.0, 1.0, true),
        (1.0, 1e-3, true),
        (1.0, 1e-9, false),
        (1e6, 1.0, false),
    ] {
        let lines = draws.iter().map(|[x, y]| {
            let [a, b] = [x, y].map(|value| offset + range * value);
            format!("{a},{b},{}\n", x + 0.3 * y)
        });
        fs::write(
            path.join("own.csv"),
            format!("a,b,force\n{}", lines.collect::<String>()),
        )
        .unwrap();
        let train = "train --data own.csv --inputs a,b --targets force --hidden 3 --epochs 15 --out n.json";
        assert!(decoupler(train, path).status.success());
        for (format, precision) in [("numpy", "f32"), ("onnx", "f32"), ("c99", "f32"), ("numpy", "f64")] {
            let command = format!("export --network n.json --format {format} --precision {precision} --out b --json");
            let output = decoupler(&command, path);
            let message = String::from_utf8(output.stderr).unwrap();
            let expected = is_written || precision == "f64";
            assert_eq!(
                output.status.success(),
                expected,
                "{offset} {range} {command}: {message}"
            );
            if !expected {
                for words in [
                    "single precision cannot resolve",
                    "--precision f64",
                    "subtract a constant",
                ] {
                    assert!(message.contains(words), "{message}");
                }
                assert!(!path.join("b").exists());
                continue;
            }
            let report: Value = serde_json::from_slice(&output.stdout).unwrap();
            let change = &report["change_by_rounding_readings"];
            assert_eq!(change.is_null(), precision == "f64", "{report}");
            // 1e-3 of a size of 1 leaves about 14 bits.
            if let Some(change) = change.as_f64() {
                let wanted = if range == 1.0 { 0.0..1e-6 } else { 1e-6..1e-4 };
                assert!(wanted.contains(&change), "{offset} {range}: {report}");
            }
            fs::remove_dir_all(path.join("b")).unwrap();
        }
    }
}

/// Readings up to 1e100 overflow in single precision, but not in double.
#[test]
fn readings_beyond_single_precision_are_exported_in_double() {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let lines = (0..120).map(|_| {
        let [a, b]: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        format!("{},{b},{}\n", 1e100 * a, a + 0.2 * b)
    });
    fs::write(
        folder.path().join("own.csv"),
        format!("a,b,force\n{}", lines.collect::<String>()),
    )
    .unwrap();
    let train = "train --data own.csv --inputs a,b --targets force --hidden 3 --epochs 15 --out n.json";
    assert!(decoupler(train, folder.path()).status.success());
    for format in ["onnx", "c99", "numpy", "matlab"] {
        let report = export(&format!("--format {format} --out {format}"), folder.path());
        assert!(report["limit"].as_f64().unwrap() < 1e-6, "{report}");
    }
    let output = decoupler(
        "export --network n.json --format c99 --precision f32 --out b",
        folder.path(),
    );
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && message.contains("give --precision f64"),
        "{message}"
    );
}
