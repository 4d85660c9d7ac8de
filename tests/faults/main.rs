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

#[path = "../support/folders.rs"]
mod folders;

use folders::names;

/// How an operation fails: half of a block is written before the disk is full, or an error of the system.
const KINDS: [(&str, &str); 5] = [
    ("short write", "short"),
    ("full disk", "28"),
    ("input/output error", "5"),
    ("permission denied", "13"),
    ("vanished folder", "2"),
];

/// The library that injects faults, compiled once.
struct Shim {
    home: TempDir,
}

impl Shim {
    fn new() -> Self {
        let home = tempfile::tempdir().unwrap();
        let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/faults/shim.c");
        // The linker of Rust is there in any case.
        let compiled = Command::new("cc")
            .args(["-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-o"])
            .arg(home.path().join("shim.so"))
            .args([source, "-ldl"])
            .output()
            .unwrap();
        assert!(
            compiled.status.success(),
            "{}",
            String::from_utf8_lossy(&compiled.stderr)
        );
        Self { home }
    }

    /// Runs a command in `folder` whose operation number `at` fails; returns its output and the number of operations.
    fn run(&self, arguments: &str, folder: &Path, at: usize, kind: &str) -> (Output, usize) {
        let count = self.home.path().join("count");
        let _ = fs::remove_file(&count);
        let output = Command::new(env!("CARGO_BIN_EXE_decoupler"))
            .args(arguments.split_whitespace())
            .current_dir(folder)
            .env("LD_PRELOAD", self.home.path().join("shim.so"))
            .env("FAULT_FOLDER", folder)
            .env("FAULT_AT", at.to_string())
            .env("FAULT_KIND", kind)
            .env("FAULT_COUNT", &count)
            .output()
            .unwrap();
        let count = fs::read_to_string(&count).unwrap_or_default().parse().unwrap_or(0);
        (output, count)
    }
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
        let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
        let output = command
            .args(arguments.split_whitespace())
            .current_dir(folder.path())
            .output()
            .unwrap();
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

/// Checks one command at every operation; returns the number of faults.
fn check(shim: &Shim, folder: &Path, (command, name): (&str, &str), kinds: &[(&str, &str)]) -> usize {
    let arguments = format!("{} {name}", command.replace('@', ARRAY));
    let target: PathBuf = folder.join(name);
    let clear = || {
        let _ = fs::remove_dir_all(&target);
        let _ = fs::remove_file(&target);
    };
    clear();
    let before = names(folder);
    let (whole, operations) = shim.run(&arguments, folder, 0, "short");
    let error = String::from_utf8_lossy(&whole.stderr);
    assert!(
        whole.status.success() && operations > 0,
        "{arguments}: {operations}, {error}"
    );
    let new = contents(&target).unwrap();
    let mut faults = 0;
    for at in 1..=operations {
        for (index, (kind, code)) in kinds.iter().enumerate() {
            // The other kinds are tried at other operations.
            if kinds.len() > 1 && index % 2 != at % 2 {
                continue;
            }
            clear();
            let old = (!is_written_once(name)).then(|| {
                fs::write(&target, "the old file").unwrap();
                vec![b"the old file".to_vec()]
            });
            let (output, _) = shim.run(&arguments, folder, at, code);
            let message = String::from_utf8_lossy(&output.stderr);
            let place = format!("{arguments}: {kind} at operation {at} of {operations}: {message}");
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
            let mut allowed = before.clone();
            allowed.push(name.to_owned());
            let left = Vec::from_iter(names(folder).into_iter().filter(|left| !allowed.contains(left)));
            assert!(left.is_empty(), "{left:?}: {place}");
            faults += 1;
        }
    }
    clear();
    faults
}

#[test]
fn a_fault_leaves_the_old_file_or_the_new_one() {
    let (shim, folder) = (Shim::new(), prepared());
    let mut faults = 0;
    for command in COMMANDS {
        faults += check(&shim, folder.path(), command, &KINDS);
    }
    assert!(faults > 150, "{faults}");
}
