//! Networks of recordings, exported in the terminal with the names and units of their columns.

use std::{fs, path::Path};

use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use serde_json::Value;
use tempfile::TempDir;

use crate::calls::{column, failure, has, json, number, read, refused, success, write};

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
    write(folder.path(), "own.csv", text);
    // A recipe, because the terminal of a test splits arguments at spaces.
    let recipe = r#"{"format": "decoupler recipe", "version": 1, "program": "a test", "source": {"recording": {"import": {"data": "own.csv",
        "inputs": ["hall, a", "b */ x", "c"], "targets": ["force", "torque"], "row_wire": "row"}}}}"#;
    write(folder.path(), "recipe.json", recipe);
    success(
        &format!("train --recipe recipe.json {rows} --hidden 4 --epochs 20 --out n.json"),
        folder.path(),
    );
    folder
}

fn export(arguments: &str, folder: &Path) -> Value {
    json(&format!("export --network n.json {arguments} --json"), folder)
}

fn metadata(folder: &Path, bundle: &str) -> Value {
    serde_json::from_str(&read(&folder.join(bundle), "metadata.json")).unwrap()
}

#[test]
fn golden_vectors_in_the_users_units_agree_with_decode() {
    let folder = trained("");
    let report = export("--format onnx --out bundle", folder.path());
    assert_eq!((&report["limit"], report.get("output_range_mm")), (&1e-12.into(), None));
    success(
        "decode --network n.json --data bundle/golden.csv --out decoded.csv",
        folder.path(),
    );
    // Each target is accurate to the last digits of its range.
    for (target, tolerance, spread) in [("force", 4e-9, 1e3..5e3), ("torque", 2e-15, 0.0..1e-1)] {
        let [golden, decoded] =
            ["bundle/golden.csv", "decoded.csv"].map(|file| column(&read(folder.path(), file), target));
        assert!(golden.len() >= 7 && golden.len() == decoded.len());
        let apart = golden
            .iter()
            .zip(&decoded)
            .map(|(golden, decoded)| (golden - decoded).abs());
        assert!(apart.fold(0.0, f64::max) < tolerance, "{golden:?} {decoded:?}");
        let [low, high] = [f64::min, f64::max].map(|of| golden.iter().copied().reduce(of).unwrap());
        assert!(spread.contains(&(high - low)), "{target}: {low} to {high}");
    }
    let metadata = metadata(folder.path(), "bundle");
    assert_eq!(metadata["inputs"]["names"][0], "hall, a");
    assert_eq!(metadata["inputs"]["units"][0], "µT");
    assert_eq!(metadata["outputs"]["units"], serde_json::json!(["N", "N·m"]));
    assert_eq!(metadata["files"], serde_json::json!(["own.csv"]));
    for (target, range) in [(0, 4e3), (1, 2e-3)] {
        let found = metadata["output_ranges"][target].as_f64().unwrap();
        assert!((found / range - 1.0).abs() < 0.1, "{found}");
    }
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
        assert!(report["deviation"].as_f64().unwrap_or(0.0) <= number(&report, "limit"));
        assert!(report["verified_vectors"].as_u64().unwrap() > 50, "{report}");
        for file in [file, "README.txt"] {
            let text = read(&path.join(&name), file);
            let words = text.split_whitespace().filter(|word| !["%", "#"].contains(word));
            let plain = Vec::from_iter(words).join(" ");
            has(
                &plain,
                &["force (N)", "torque (N·m)", "hall, a (µT)", "2 is row-wire 3"],
            );
            assert!(!plain.contains(" mm") && !plain.contains("ohm"), "{file}: {text}");
        }
    }
}

#[test]
fn other_decoders_of_a_recording_keep_names_units_and_rows() {
    let folder = trained("--rows known");
    for decoder in ["ridge", "rbf"] {
        let report = export(
            &format!("--decoder {decoder} --format onnx --out {decoder}"),
            folder.path(),
        );
        assert!(number(&report, "limit") < 1e-9, "{report}");
        let metadata = metadata(folder.path(), decoder);
        assert_eq!(metadata["decoder"], decoder);
        assert_eq!(metadata["row_numbers"], serde_json::json!([1, 3]));
        assert_eq!(metadata["outputs"]["names"], serde_json::json!(["force", "torque"]));
        assert!(number(&metadata["errors"][0]["errors"], "rmse") > 0.0, "{metadata}");
        assert!(folder.path().join(decoder).join("decoder.onnx").exists());
    }
}

/// For the golden vectors, rounded to the units in the header, the answers of the program's model and, if there is a
/// compiler, of the compiled source are within the bound of each target.
#[test]
fn integers_have_separate_units_for_each_column() {
    for rows in ["", "--rows known"] {
        let folder = trained(rows);
        let report = export("--format c99 --precision fixed16 --out whole", folder.path());
        let (deviation, limit) = (number(&report, "deviation"), number(&report, "limit"));
        assert!(deviation <= limit && limit < 0.02, "{report}");
        // Ranges of 4000 N and 0.002 N·m.
        for (bound, name, unit, range) in [(0, "force", "N", 4e3), (1, "torque", "N·m", 2e-3)] {
            let found = &report["error_bounds"][bound];
            assert_eq!((&found["name"], &found["unit"]), (&name.into(), &unit.into()));
            assert!(
                (range * 1e-5..range * 0.02).contains(&number(found, "bound")),
                "{found}"
            );
        }
        let header = read(folder.path(), "whole/whole_decode.h");
        let units = |name: &str| -> Vec<f64> {
            let line = header.lines().find(|line| line.contains(name)).unwrap();
            let list = line.split_once('{').unwrap().1.trim_end_matches(['}', ' ']);
            list.split(',').map(|unit| unit.trim().parse().unwrap()).collect()
        };
        // Readings up to 1000, 1.3 and 6, and a tenth of the range next to them, in 30 bits.
        assert_eq!(units("WHOLE_READING_UNITS"), [1e-5, 1e-8, 1e-8]);
        assert_eq!(units("WHOLE_TARGET_UNITS"), [1e-3, 1e-9]);
        has(
            &header,
            &["force (N)", "hall, a (µT)", "int32_t readings[WHOLE_CHANNELS]"],
        );
        assert!(!header.contains("ohm") && !header.contains("nm"), "{header}");
    }
}

/// Trains on readings of two normal forms of this size around this offset, and a force.
fn train_on(folder: &Path, offset: f64, ranges: [f64; 2]) {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let lines = (0..120).map(|_| {
        let [x, y]: [f64; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        format!(
            "{},{},{}\n",
            offset + ranges[0] * x,
            offset + ranges[1] * y,
            x + 0.3 * y
        )
    });
    write(folder, "own.csv", format!("a,b,force\n{}", lines.collect::<String>()));
    success(
        "train --data own.csv --inputs a,b --targets force --hidden 3 --epochs 15 --out n.json",
        folder,
    );
}

/// Readings that vary by a billionth of their size lose all information when rounded to single precision, and readings up to
/// 1e100 overflow.
#[test]
fn readings_that_single_precision_cannot_hold_are_refused_with_cause_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    // 1e-3 of a size of 1 leaves about 14 bits.
    for (offset, range, change) in [
        (0.0, 1.0, Some(0.0..1e-6)),
        (1.0, 1e-3, Some(1e-6..1e-4)),
        (1e6, 1.0, None),
    ] {
        train_on(path, offset, [range; 2]);
        let double = export("--format numpy --precision f64 --out b", path);
        assert!(double["change_by_rounding_readings"].is_null(), "{double}");
        for format in ["numpy", "onnx", "c99"] {
            let single = format!("--format {format} --precision f32 --out {format}_{offset}_{range}");
            let Some(change) = &change else {
                let message = failure(&format!("export --network n.json {single}"), path, 1);
                has(
                    &message,
                    &[
                        "single precision cannot resolve",
                        "precision f64",
                        "subtract a constant",
                    ],
                );
                continue;
            };
            let report = export(&single, path);
            assert!(
                change.contains(&number(&report, "change_by_rounding_readings")),
                "{offset} {range}: {report}"
            );
        }
        fs::remove_dir_all(path.join("b")).unwrap();
    }
    train_on(path, 0.0, [1e100, 1.0]);
    for format in ["onnx", "c99", "numpy", "matlab"] {
        let report = export(&format!("--format {format} --out {format}"), path);
        assert!(number(&report, "limit") < 1e-6, "{report}");
    }
    let single = "export --network n.json --format c99 --precision f32 --out b";
    refused(single, path, 1, "choose precision f64");
}
