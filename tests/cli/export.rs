//! `decoupler export`, run as a program.

use std::{fs, path::Path};

use serde_json::Value;
use tempfile::TempDir;

use crate::{folders::names, terminal::decoupler};

/// A folder with a network, `n.json`.
fn trained(scene: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let arguments = format!(
        "train --array 3x2_2x6 --samples 90 --set validation-samples=0 --set test-samples=9 --hidden 3 --epochs 5 {scene} \
         --decoder mean --out n.json"
    );
    let output = decoupler(&arguments, folder.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    folder
}

fn failure(arguments: &str, folder: &Path, status: i32) -> String {
    let output = decoupler(arguments, folder);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{arguments}: {message}");
    assert_eq!(
        (message.lines().count(), output.stdout.len()),
        (1, 0),
        "{arguments}: {message}"
    );
    message
}

/// `decode` of the golden readings of an exported network gives the golden coordinates.
#[test]
fn an_exported_network_agrees_with_decode() {
    let folder = trained("--rows known --noise 1e-3");
    let output = decoupler(
        "export --network n.json --format onnx --out bundle --json",
        folder.path(),
    );
    assert!(output.status.success() && output.stderr.is_empty());
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let limit = report["limit"].as_f64().unwrap();
    assert!((1e-12..1e-10).contains(&limit), "{limit}");
    assert_eq!(report["precision"], "f64");
    let bundle = folder.path().join("bundle");
    assert_eq!(
        names(&bundle),
        ["README.txt", "golden.csv", "metadata.json", "network.onnx"]
    );
    let output = decoupler(
        "decode --network n.json --data bundle/golden.csv --out decoded.csv",
        folder.path(),
    );
    assert!(output.status.success());
    let column = |path: &Path, name: &str| {
        let text = fs::read_to_string(path).unwrap();
        let index = text
            .lines()
            .next()
            .unwrap()
            .split(',')
            .position(|other| other == name)
            .unwrap();
        let fields = text
            .lines()
            .skip(1)
            .map(|line| line.split(',').nth(index).unwrap().parse().unwrap());
        fields.collect::<Vec<f64>>()
    };
    for name in ["x_1", "y_1", "z_1", "z_2"] {
        let golden = column(&bundle.join("golden.csv"), name);
        let decoded = column(&folder.path().join("decoded.csv"), name);
        assert!(!golden.is_empty() && golden.len() == decoded.len());
        for (golden, decoded) in golden.iter().zip(decoded) {
            assert!((golden - decoded).abs() < 1e-11, "{name}: {golden} {decoded}");
        }
    }
}

#[test]
fn the_report_names_files_deviations_and_bounds_with_their_units() {
    let folder = trained("--noise 1e-3");
    let cases = [
        ("onnx", "f32", vec!["network.onnx", "this program in single precision"]),
        (
            "c99",
            "fixed16",
            vec![
                "out_c99_fixed16_decode.c",
                "C source, compiled and run",
                "Proven bound",
                " mm",
            ],
        ),
        (
            "matlab",
            "f64",
            vec!["out_matlab_f64_decode.m", "relative to the widest range"],
        ),
        ("numpy", "f32", vec!["decode.py", "network.npz"]),
    ];
    for (format, precision, expected) in cases {
        let arguments =
            format!("export --network n.json --format {format} --precision {precision} --out out_{format}_{precision}");
        let output = decoupler(&arguments, folder.path());
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        for expected in expected {
            assert!(text.contains(expected), "{text}");
        }
    }
    let readme = fs::read_to_string(folder.path().join("out_c99_fixed16/README.txt")).unwrap();
    assert!(
        readme.contains("out_c99_fixed16_decode(") && readme.contains("Proven bound"),
        "{readme}"
    );
}

#[test]
fn errors_take_one_line_and_leave_no_files() {
    let folder = trained("");
    fs::create_dir(folder.path().join("full")).unwrap();
    fs::write(folder.path().join("full/kept"), "").unwrap();
    let before = names(folder.path());
    let cases = [
        ("--format tflite --out b", 2, "give onnx, c99, matlab or numpy"),
        ("--format onnx --precision f16 --out b", 2, "give f64, f32 or fixed16"),
        ("--format onnx --precision fixed16 --out b", 2, "give f64 or f32"),
        ("--format onnx --out n.json", 2, "name the same file"),
        ("--format json --out b", 2, "is not a format"),
        ("--format onnx --out full", 1, "is there already"),
        ("--format onnx --out none/b", 1, "does not exist"),
    ];
    for (arguments, status, expected) in cases {
        let message = failure(&format!("export --network n.json {arguments}"), folder.path(), status);
        assert!(message.contains(expected), "{message}");
    }
    assert_eq!(names(folder.path()), before);
    assert_eq!(names(&folder.path().join("full")), ["kept"]);
}

#[test]
fn help_lists_formats_precisions_and_units() {
    let output = decoupler("export --help", Path::new("."));
    let text = String::from_utf8(output.stdout).unwrap();
    for expected in ["ohm", "mm", "opset 13", "fixed16", "1e-12", "README.txt", "nanometres"] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

#[cfg(unix)]
/// Each decoder is fitted to the samples of the network deterministically.
#[test]
fn other_decoders_are_exported_or_refused_with_a_reason() {
    let folder = trained("--rows known --noise 1e-3");
    let path = folder.path();
    let exported = |decoder: &str, out: &str| {
        let arguments = format!("export --network n.json --decoder {decoder} --format numpy --out {out} --json");
        let output = decoupler(&arguments, path);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(report["limit"].as_f64().unwrap() < 1e-9, "{report}");
        fs::read(path.join(out).join("golden.csv")).unwrap()
    };
    let answers: Vec<_> = ["network", "ridge", "rbf"]
        .map(|decoder| {
            (
                exported(decoder, decoder),
                exported(decoder, &format!("{decoder} again").replace(' ', "_")),
            )
        })
        .into();
    for (index, (first, again)) in answers.iter().enumerate() {
        assert_eq!(first, again);
        assert!(answers[..index].iter().all(|(other, _)| other != first));
    }
    for (arguments, status, expected) in [
        (
            "--decoder newton --format c99 --out b",
            2,
            "solves the equations of the sensor",
        ),
        ("--decoder fuzzy --format c99 --out b", 2, "only for comparison"),
        (
            "--decoder rbf --format c99 --precision fixed16 --out b",
            2,
            "no Gaussians",
        ),
        ("--decoder knn --format c99 --out b", 2, "ridge"),
    ] {
        let message = failure(&format!("export --network n.json {arguments}"), path, status);
        assert!(message.contains(expected), "{message}");
    }
    assert!(!path.join("b").exists());
}

#[test]
fn only_the_folder_of_a_killed_export_is_removed_by_the_next() {
    let folder = trained("");
    let path = |name: &str| folder.path().join(name);
    for name in [
        ".decoupler-abc123.part",
        ".decoupler-atwork.part",
        ".decoupler-folder",
        ".other-abc123.part",
    ] {
        fs::create_dir(path(name)).unwrap();
        fs::write(path(name).join("network.onnx"), "half").unwrap();
    }
    let at_work = fs::File::open(path(".decoupler-atwork.part")).unwrap();
    at_work.lock().unwrap();
    let output = decoupler("export --network n.json --format onnx --out bundle", folder.path());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let expected = [
        ".decoupler-atwork.part",
        ".decoupler-folder",
        ".other-abc123.part",
        "bundle",
        "n.json",
    ];
    assert_eq!(names(folder.path()), expected);
}
