use std::{fs, path::Path};

use decoupler_files::export::{MergedSweep, SweepTableFormat, Trial, TrialOptions};
use serde_json::{Value, json};

use crate::{
    corpus::replay,
    mutation::{accepted, for_each_seed, mutated},
    sealing::{mutated_and_sealed, resealed},
};

/// Options of a trial with this many hidden nodes.
fn options(hidden: u64) -> TrialOptions {
    [
        ("hidden".to_owned(), json!(hidden)),
        ("method".to_owned(), json!("lm")),
        ("decoder".to_owned(), json!(["mean"])),
    ]
    .into()
}

/// Fills a folder with two trials; a third is begun.
fn fill(folder: &Path) {
    let report = |error: f64| {
        json!({
            "hidden": 8, "epochs": 20, "epoch_ms": 1.5, "stop_reason": "epochs",
            "test": {"x_mm": error, "z_mm": null, "frame_us": 3.25},
            "decoders": [{"name": "mean", "rmse": 0.5, "fit_seconds": 0.125}],
            "remarks": ["one remark", "another one"],
        })
    };
    for (hidden, error) in [(8, 0.25), (10, 1e-3)] {
        Trial::new(options(hidden), report(error), 2.5).save_in(folder).unwrap();
    }
    let begun = Trial::path(folder, Trial::id_of(&options(12)));
    fs::write(begun.with_extension("claim"), "").unwrap();
}

/// Checks the tables of a merge: the JSON contains every row, and the CSV has one line for each, all of the same width.
fn check_tables(merged: &MergedSweep) {
    for message in merged.damaged.iter().chain(&merged.missing).chain(&merged.conflicting) {
        assert!(message.len() < 4000 && !message.contains('\n'), "{message}");
    }
    let mut text = Vec::new();
    SweepTableFormat::Json.write(merged, &mut text).unwrap();
    let table: Value = serde_json::from_slice(&text).unwrap();
    assert_eq!(table["trials"].as_array().unwrap().len(), merged.trials.len());
    let mut text = Vec::new();
    SweepTableFormat::Csv.write(merged, &mut text).unwrap();
    if !merged.trials.is_empty() {
        let rows = csv::Reader::from_reader(&*text).into_records();
        assert_eq!(rows.map(Result::unwrap).count(), merged.trials.len());
    }
}

/// Returns the rows as text, by which two merges are compared.
fn rows(merged: &MergedSweep) -> Vec<String> {
    let rows = merged.trials.iter();
    rows.map(|row| format!("{:?} {} {:?}", row.options, row.result, row.time))
        .collect()
}

/// Files of the folder.
fn files(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut paths = Vec::from_iter(fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()));
    paths.sort();
    paths
}

#[test]
fn damage_changes_no_result_and_is_listed() {
    let folder = tempfile::tempdir().unwrap();
    fill(folder.path());
    let read = || MergedSweep::read(&[folder.path().to_owned()]).unwrap();
    let is_result = |path: &std::path::PathBuf| path.extension().is_some_and(|extension| extension == "json");
    let whole = read();
    assert_eq!(
        (whole.trials.len(), whole.missing.len(), whole.damaged.len()),
        (2, 1, 0)
    );
    let valid_rows = rows(&whole);
    for path in files(folder.path()).into_iter().filter(is_result) {
        let valid = fs::read(&path).unwrap();
        for_each_seed(150, |rng| {
            let damaged = mutated(&valid, rng);
            fs::write(&path, &damaged).unwrap();
            let merged = read();
            check_tables(&merged);
            let text = String::from_utf8_lossy(&damaged);
            assert!(merged.damaged.len() <= 1, "{text}");
            assert!(rows(&merged).iter().all(|row| valid_rows.contains(row)), "{text}");
            let is_listed = merged.damaged.len() == 1;
            assert!(is_listed || rows(&merged) == valid_rows, "{text}");
        });
        fs::write(&path, &valid).unwrap();
    }
}

/// Returns the name that the file has as a trial with these contents, if its options can be read.
fn name_of(bytes: &[u8]) -> Option<String> {
    let document: Value = serde_json::from_slice(bytes).ok()?;
    let options: TrialOptions = serde_json::from_value(document["run"]["options"].clone()).ok()?;
    let report = document["run"]["report"].clone();
    let folder = tempfile::tempdir().unwrap();
    Trial::new(options, report, 1.0).save_in(folder.path()).ok()?;
    Some(files(folder.path()).first()?.file_name()?.to_str()?.to_owned())
}

/// Reads each input as a trial, with valid checksums and under the name of its options.
#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    fill(folder.path());
    let read = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        let before = fs::read(&path).ok();
        fs::write(&path, bytes).unwrap();
        let merged = MergedSweep::read(&[folder.path().to_owned()]).unwrap();
        check_tables(&merged);
        match before {
            Some(before) => fs::write(&path, before).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
        merged.trials.len()
    };
    let check = |bytes: &[u8]| {
        let name = name_of(bytes).unwrap_or_else(|| "00000000000000000000000000000000.json".to_owned());
        read(&name, bytes) > 2
    };
    replay!(20, |bytes: &[u8]| {
        let sealed = check(&resealed(bytes).unwrap_or_default());
        let mutations = accepted(60, |rng| check(&mutated_and_sealed(bytes, rng).unwrap_or_default()));
        usize::from(check(bytes)) + usize::from(sealed) + mutations
    });
}
