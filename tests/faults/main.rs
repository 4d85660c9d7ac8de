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

use serde_json::Value;
use tempfile::TempDir;

#[path = "../support/faults.rs"]
mod faults;
#[path = "../support/folders.rs"]
mod folders;

use faults::{Faults, KINDS, fail_at, has_failed};
use folders::names;

fn run(arguments: &str, folder: &Path, faults: Option<&Faults>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command
        .args(arguments.split_whitespace())
        .arg("--force")
        .current_dir(folder);
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

const ARRAY: &str = "--array 2x2_2x6 --samples 40 --set validation-samples=0 --set test-samples=10 --hidden 2 --epochs 1 --decoder mean";

const RECORDING: &str =
    "--data data.csv --inputs t,u --targets d --hidden 2 --epochs 1 --decoder mean --intervals never";

/// Lines of `presses.csv`: a row-wire at one moment, and where its nodes are.
const FRAMES: &str = "--data presses.csv --inputs r_1..r_6 --targets x_1..z_2 --row-wire row --group snapshot";

/// Arguments in which `@` stands for a small array, `@recording` for a small recording, and `@frames` for presses.
fn in_full(arguments: &str) -> String {
    let arguments = arguments.replace("@recording", RECORDING).replace("@frames", FRAMES);
    arguments.replace('@', ARRAY)
}

/// A folder with what the commands read: networks, `n.json` and `fitted.json`, the checkpoint of a training,
/// `begun.json`, readings, `readings.csv`, a recording, `data.csv`, presses, `presses.csv`, and a sweep, `runs`.
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
        "train @ --out n.json",
        "train @ --checkpoint begun.json",
        "train @recording --out recording.json",
        "simulate --array 2x2_2x6 --samples 4 --out readings.csv",
        "simulate --array 2x2_2x6 --samples 40 --out presses.csv",
        "calibrate --array 2x2_2x6 @frames --out nominal.json",
        "train --sensor nominal.json --rows known --samples 40 --set validation-samples=0 --set test-samples=10 --hidden 2 \
         --epochs 1 --decoder mean --out fitted.json",
        "sweep --spec sweep.json --out runs",
    ] {
        let output = run(&in_full(arguments), folder.path(), None);
        assert!(
            output.status.success(),
            "{arguments}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    folder
}

/// What is there before a command writes.
#[derive(Clone, Copy, Debug)]
enum Before {
    /// Nothing.
    Nothing,
    /// A file that the command replaces.
    AnyFile,
    /// A copy of this file, which the command continues.
    CopyOf(&'static str),
}

/// A command that writes one file or folder, named last, and what is there before.
type Written = (&'static str, Before);

/// Commands that write one file. `trade` writes none, nor does `decode --follow`, and those of `simulate` with faults are
/// written by the same code.
const FILES: [Written; 15] = [
    ("simulate --array 2x2_2x6 --samples 6 --out out.csv", Before::AnyFile),
    (
        "simulate --array 2x2_2x6 --samples 6 --decoder newton --out too.csv",
        Before::AnyFile,
    ),
    ("train @ --out out.json", Before::AnyFile),
    ("train @ --report report.html", Before::AnyFile),
    ("train @ --checkpoint checkpoint.json", Before::Nothing),
    (
        "train --epochs 3 --resume --checkpoint resumed.json",
        Before::CopyOf("begun.json"),
    ),
    ("train @recording --out recorded.json", Before::AnyFile),
    ("train @recording --report recorded.html", Before::AnyFile),
    (
        "inspect --data data.csv --inputs t,u --targets d --recipe-out recipe.json",
        Before::AnyFile,
    ),
    (
        "decode --network n.json --data readings.csv --out decoded.csv",
        Before::AnyFile,
    ),
    (
        "decode --network recording.json --data data.csv --out recording.csv",
        Before::AnyFile,
    ),
    ("calibrate --array 2x2_2x6 @frames --out sensor.json", Before::AnyFile),
    (
        "fine-tune --network fitted.json @frames --epochs 1 --out tuned.json",
        Before::AnyFile,
    ),
    ("sweep --merge runs --out table.csv", Before::AnyFile),
    ("sweep --merge runs --out table.json", Before::AnyFile),
];

/// Exports, which write a folder whole or not at all.
const BUNDLES: [&str; 8] = [
    "export --network n.json --format numpy --out numpy",
    "export --network n.json --format onnx --out onnx",
    "export --network n.json --format onnx --precision f32 --out onnx_f32",
    "export --network n.json --format matlab --out matlab",
    "export --network n.json --format c99 --out c99",
    "export --network n.json --format c99 --precision fixed16 --out c99_fixed",
    "export --network n.json --decoder ridge --format matlab --out ridge",
    "export --network recording.json --format numpy --out numpy_recording",
];

/// Commands that fill a folder file by file. A sweep given by arguments is filled by the same code, and `--engine` writes
/// nothing.
const FILLED: [&str; 2] = [
    "sweep --spec sweep.json --threads 1 --out sweep",
    "reproduce --table 1 --seeds 1 --epochs 1 --starts 1 --hidden 2 --out tables",
];

/// Name of what a command writes.
fn written(command: &str) -> &str {
    command.rsplit(' ').next().unwrap()
}

fn remove(target: &Path) {
    let _ = fs::remove_dir_all(target);
    let _ = fs::remove_file(target);
}

/// Checks that the command failed with one clear error about `name`, and left nothing else in its folder.
fn check_error(output: &Output, name: &str, place: &str) {
    let message = String::from_utf8_lossy(&output.stderr);
    let errors = message.lines().filter(|line| line.starts_with("error: ")).count();
    assert!(errors == 1 && message.contains(name), "{place}");
}

fn check_names(folder: &Path, allowed: &[String], place: &str) {
    let left = Vec::from_iter(names(folder).into_iter().filter(|left| !allowed.contains(left)));
    assert!(left.is_empty(), "{left:?}: {place}");
}

/// Checks one command at every operation; returns their number.
fn check(faults: &Faults, folder: &Path, (command, before): Written) -> usize {
    let (arguments, name) = (in_full(command), written(command));
    let target: PathBuf = folder.join(name);
    let begin = || {
        remove(&target);
        match before {
            Before::Nothing => {}
            Before::AnyFile => fs::write(&target, "the old file").unwrap(),
            Before::CopyOf(other) => _ = fs::copy(folder.join(other), &target).unwrap(),
        }
        contents(&target)
    };
    remove(&target);
    let mut allowed = names(folder);
    allowed.push(name.to_owned());
    begin();
    let whole = run(&arguments, folder, None);
    assert!(
        whole.status.success(),
        "{arguments}: {}",
        String::from_utf8_lossy(&whole.stderr)
    );
    let new = contents(&target).unwrap();
    // Verifying a bundle in C takes a C compiler, and many of its operations are alike.
    let step = if name.starts_with("c99") { 3 } else { 1 };
    for at in (1..).step_by(step) {
        let (kind, code) = KINDS[at % KINDS.len()];
        let old = begin();
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
                // A training that fails to save its end leaves a checkpoint from before.
                let is_earlier = |files: &Vec<Vec<u8>>| {
                    command.contains("--checkpoint") && serde_json::from_slice::<Value>(&files[0]).is_ok()
                };
                assert!(found == old || found.as_ref().is_some_and(is_earlier), "{place}");
                check_error(&output, name, &place);
            }
            other => panic!("{other:?}: {place}"),
        }
        check_names(folder, &allowed, &place);
        if !has_failed(&faults.plan()) {
            assert!(output.status.success(), "{place}");
            remove(&target);
            return at - 1;
        }
    }
    unreachable!("there is an end to the operations")
}

/// Checks a command that fills a folder at every operation: every file is whole, and running the command again completes
/// the folder. Returns the number of operations.
fn check_filling(faults: &Faults, folder: &Path, arguments: &str) -> usize {
    let name = written(arguments);
    let target = folder.join(name);
    let complete = |place: &str| {
        let output = run(arguments, folder, None);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments}, after {place}: {message}");
        names(&target)
    };
    remove(&target);
    let mut allowed = names(folder);
    allowed.push(name.to_owned());
    let all = complete("nothing");
    for at in 1.. {
        let (kind, code) = KINDS[at % KINDS.len()];
        remove(&target);
        fail_at(&faults.plan(), at, code);
        let output = run(arguments, folder, Some(faults));
        let message = String::from_utf8_lossy(&output.stderr);
        let place = format!("{arguments}: {kind} at operation {at}: {message}");
        match output.status.code() {
            Some(0) => {}
            Some(1) => check_error(&output, name, &place),
            other => panic!("{other:?}: {place}"),
        }
        check_names(folder, &allowed, &place);
        for file in target.is_dir().then(|| names(&target)).into_iter().flatten() {
            // Files of a training that is continued later.
            if file.ends_with(".claim") || file.ends_with(".checkpoint") {
                continue;
            }
            assert!(all.contains(&file), "{file}: {place}");
            let bytes = fs::read(target.join(&file)).unwrap();
            assert!(is_whole(&file, &bytes), "{file}: {place}");
        }
        let is_over = !has_failed(&faults.plan());
        assert!(!is_over || output.status.success(), "{place}");
        if !target.is_dir() || names(&target) != all {
            assert_eq!(complete(&place), all, "{place}");
        }
        if is_over {
            remove(&target);
            return at - 1;
        }
    }
    unreachable!("there is an end to the operations")
}

/// Returns `true` if a file ends as files of its kind do.
fn is_whole(name: &str, bytes: &[u8]) -> bool {
    match name.rsplit_once('.').unwrap_or_default().1 {
        "json" => serde_json::from_slice::<Value>(bytes).is_ok(),
        "png" => bytes.ends_with(b"IEND\xaeB`\x82"),
        "svg" => bytes.trim_ascii_end().ends_with(b"</svg>"),
        _ => bytes.ends_with(b"\n"),
    }
}

fn check_all(commands: impl IntoIterator<Item = Written>) {
    let (faults, folder) = (Faults::new(), prepared());
    for command in commands {
        let operations = check(&faults, folder.path(), command);
        // At least one file is made, written and synchronised.
        assert!(operations >= 3, "{command:?}: {operations}");
    }
}

#[test]
fn a_fault_leaves_the_old_file_or_the_new_one() {
    check_all(FILES);
}

#[test]
fn a_fault_leaves_a_whole_bundle_or_none() {
    check_all(BUNDLES.map(|command| (command, Before::Nothing)));
}

#[test]
fn a_fault_leaves_whole_files_in_a_folder_that_is_filled_by_the_next_run() {
    let (faults, folder) = (Faults::new(), prepared());
    for command in FILLED {
        assert!(check_filling(&faults, folder.path(), command) > 3);
    }
}
