//! Specifications of sweeps. None is trained: the command looks for results in an empty folder.

use std::{fs, path::Path, process::Command};

use crate::{
    corpus::replay,
    mutation::{accepted, mutated_document},
};

/// Returns true if the specification is accepted; otherwise checks its error message.
fn check(bytes: &[u8], folder: &Path) -> bool {
    fs::write(folder.join("spec.json"), bytes).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_decoupler"))
        .args(["sweep", "--merge", ".", "--spec", "spec.json", "--out", "table.csv"])
        .current_dir(folder)
        .env("DECOUPLER_MEMORY_GB", "1")
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    let text = || String::from_utf8_lossy(bytes);
    assert!(!message.contains("panicked"), "{}: {message}", text());
    match output.status.code() {
        Some(1 | 2) => {
            assert!(message.starts_with("error: "), "{}: {message}", text());
            assert!(message.len() < 3000, "{}: {message}", text());
        }
        other => panic!("{}: {other:?} {message}", text()),
    }
    message.contains("no sweep in '.'")
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("press.csv"),
        "a,b,force\n1,2,3\n2,3,4\n3,5,5\n4,7,6\n5,8,8\n",
    )
    .unwrap();
    let check = |bytes: &[u8]| check(bytes, folder.path());
    replay!(3, |bytes: &[u8]| {
        usize::from(check(bytes)) + accepted(6, |rng| check(&mutated_document(bytes, rng)))
    });
}
