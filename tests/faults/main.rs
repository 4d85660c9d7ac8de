//! Every command that writes, on a file system that fails at its N-th operation, for every N: the old file stays or the new
//! one is complete, the error is clear, and nothing temporary is left.
//!
//! A library that is preloaded into the program injects the faults, so that the program itself has no code for them.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use tempfile::TempDir;

#[path = "../support/faults.rs"]
mod faults;
#[path = "../support/folders.rs"]
mod folders;

use faults::{Faults, KINDS, fail_at, has_failed};
use folders::names;

fn run(arguments: &str, folder: &Path, faults: Option<&Faults>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command.args(arguments.split_whitespace()).current_dir(folder);
    if let Some(faults) = faults {
        faults.preload(&mut command, folder);
    }
    command.output().unwrap()
}

/// Contents of a file, or of the files of a folder in order; `None` if there is nothing.
fn contents(path: &Path) -> Option<Vec<Vec<u8>>> {
    if path.is_dir() {
        let files = names(path).into_iter();
        return Some(
            files
                .map(|name| fs::read(path.join(name)).unwrap_or_default())
                .collect(),
        );
    }
    fs::read(path).ok().map(|bytes| vec![bytes])
}

/// A folder with a network, `n.json`, readings, `readings.csv`, a recording, `data.csv`, and a sweep, `runs`.
fn prepared() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..40).map(|k| format!("{k},{},{}\n", k * k % 7, 2 * k)).collect();
    fs::write(folder.path().join("data.csv"), format!("t,u,d\n{rows}")).unwrap();
    fs::write(
        folder.path().join("sweep.json"),
        r#"{"train": {"array": "2x2_2x6", "samples": 40, "epochs": 1, "decoder": ["mean"]}, "axes": {"hidden": [2, 3]}}"#,
    )
    .unwrap();
    for arguments in [
        &format!("train {ARRAY} --out n.json"),
        "simulate --array 2x2_2x6 --samples 4 --out readings.csv",
        "sweep --spec sweep.json --out runs",
    ] {
        let output = run(arguments, folder.path(), None);
        assert!(
            output.status.success(),
            "{arguments}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    folder
}

const ARRAY: &str =
    "--array 2x2_2x6 --samples 40 --validation-samples 0 --test-samples 10 --hidden 2 --epochs 1 --decoder mean";

/// Commands that write one file or folder, with its name; those that write a folder do not replace it.
const COMMANDS: [(&str, &str); 12] = [
    ("simulate --array 2x2_2x6 --samples 6 --out", "out.csv"),
    ("train @ --out", "out.json"),
    ("train @ --save-recipe", "recipe.json"),
    (
        "train --data data.csv --inputs t,u --targets d --hidden 2 --epochs 1 --decoder mean --intervals never --out",
        "recorded.json",
    ),
    ("decode --network n.json --input readings.csv --output", "decoded.csv"),
    ("export --network n.json --format json --out", "copy.json"),
    ("export --network n.json --format numpy --out", "numpy"),
    ("export --network n.json --format onnx --out", "onnx"),
    ("export --network n.json --format matlab --out", "matlab"),
    ("sweep --merge runs --out", "table.csv"),
    ("sweep --merge runs --out", "table.json"),
    ("train @ --checkpoint", "checkpoint.json"),
];

fn is_written_once(name: &str) -> bool {
    ["copy.json", "numpy", "onnx", "matlab", "checkpoint.json"].contains(&name)
}

/// Checks one command at every operation; returns their number.
fn check(faults: &Faults, folder: &Path, (command, name): (&str, &str)) -> usize {
    let arguments = format!("{} {name}", command.replace('@', ARRAY));
    let target: PathBuf = folder.join(name);
    let clear = || {
        let _ = fs::remove_dir_all(&target);
        let _ = fs::remove_file(&target);
    };
    clear();
    let mut allowed = names(folder);
    allowed.push(name.to_owned());
    let whole = run(&arguments, folder, None);
    assert!(
        whole.status.success(),
        "{arguments}: {}",
        String::from_utf8_lossy(&whole.stderr)
    );
    let new = contents(&target).unwrap();
    for at in 1.. {
        let (kind, code) = KINDS[at % KINDS.len()];
        clear();
        let old = (!is_written_once(name)).then(|| {
            fs::write(&target, "the old file").unwrap();
            vec![b"the old file".to_vec()]
        });
        fail_at(&faults.plan(), at, code);
        let output = run(&arguments, folder, Some(faults));
        let message = String::from_utf8_lossy(&output.stderr);
        let place = format!("{arguments}: {kind} at operation {at}: {message}");
        let found = contents(&target);
        match output.status.code() {
            // What failed was of no consequence, such as making a folder survive a power failure.
            Some(0) => {
                assert!(found.is_some() && found != old, "{place}");
                assert_eq!(found.unwrap().len(), new.len(), "{place}");
            }
            Some(1) => {
                assert_eq!(found, old, "{place}");
                let errors = message.lines().filter(|line| line.starts_with("error: ")).count();
                assert!(errors == 1 && message.contains(name), "{place}");
            }
            other => panic!("{other:?}: {place}"),
        }
        let left = Vec::from_iter(names(folder).into_iter().filter(|left| !allowed.contains(left)));
        assert!(left.is_empty(), "{left:?}: {place}");
        if !has_failed(&faults.plan()) {
            assert!(output.status.success(), "{place}");
            clear();
            return at - 1;
        }
    }
    unreachable!("there is an end to the operations")
}

#[test]
fn a_fault_leaves_the_old_file_or_the_new_one() {
    let (faults, folder) = (Faults::new(), prepared());
    for command in COMMANDS {
        let operations = check(&faults, folder.path(), command);
        // At least one file is made, written and synchronised.
        assert!(operations >= 3, "{command:?}: {operations}");
    }
}
