//! `decoupler export`, run as a program. That every decoder in every format agrees with its program is tested in the library.

use std::fs;

use tempfile::TempDir;

use crate::{
    calls::{column, has, json, number, read, success},
    folders::names,
};

/// A folder with a network, `n.json`.
fn trained(scene: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let train =
        "train --array 3x2_2x6 --samples 90 --set validation-samples=0 --set test-samples=9 --hidden 3 --epochs 5";
    success(&format!("{train} {scene} --decoder mean --out n.json"), folder.path());
    folder
}

/// `decode` of the golden readings of an exported network gives the golden coordinates.
#[test]
fn an_exported_network_agrees_with_decode() {
    let folder = trained("--rows known --noise 1e-3");
    let report = json(
        "export --network n.json --format onnx --out bundle --json",
        folder.path(),
    );
    let limit = number(&report, "limit");
    assert!((1e-12..1e-10).contains(&limit), "{limit}");
    assert_eq!(report["precision"], "f64");
    let files = ["README.txt", "golden.csv", "metadata.json", "network.onnx"];
    assert_eq!(names(&folder.path().join("bundle")), files);
    success(
        "decode --network n.json --data bundle/golden.csv --out decoded.csv",
        folder.path(),
    );
    for name in ["x_1", "y_1", "z_1", "z_2"] {
        let [golden, decoded] =
            ["bundle/golden.csv", "decoded.csv"].map(|file| column(&read(folder.path(), file), name));
        assert!(!golden.is_empty() && golden.len() == decoded.len());
        for (golden, decoded) in golden.iter().zip(decoded) {
            assert!((golden - decoded).abs() < 1e-11, "{name}: {golden} {decoded}");
        }
    }
}

#[test]
fn the_report_names_files_deviations_and_bounds_with_their_units() {
    let folder = trained("--noise 1e-3");
    for (format, precision, expected) in [
        ("onnx", "f32", &["network.onnx", "this program in single precision"][..]),
        (
            "c99",
            "fixed16",
            &[
                "out_c99_fixed16_decode.c",
                "C source, compiled and run",
                "Proven bound",
                " mm",
            ],
        ),
        (
            "matlab",
            "f64",
            &["out_matlab_f64_decode.m", "relative to the widest range"],
        ),
        ("numpy", "f32", &["decode.py", "network.npz"]),
    ] {
        let out = format!("out_{format}_{precision}");
        let export = format!("export --network n.json --format {format} --precision {precision} --out {out}");
        has(&success(&export, folder.path()), expected);
    }
    let readme = read(folder.path(), "out_c99_fixed16/README.txt");
    has(&readme, &["out_c99_fixed16_decode(", "Proven bound"]);
}

/// Each decoder is fitted to the samples of the network deterministically.
#[test]
fn other_decoders_are_fitted_alike_each_time() {
    let folder = trained("--rows known --noise 1e-3");
    let exported = |decoder: &str, out: &str| {
        let export = format!("export --network n.json --decoder {decoder} --format numpy --out {out} --json");
        assert!(number(&json(&export, folder.path()), "limit") < 1e-9);
        fs::read(folder.path().join(out).join("golden.csv")).unwrap()
    };
    let answers = ["network", "ridge", "rbf"].map(|decoder| {
        let first = exported(decoder, decoder);
        assert_eq!(first, exported(decoder, &format!("{decoder}_again")));
        first
    });
    assert!(answers[0] != answers[1] && answers[1] != answers[2]);
}
