//! Work that ends in the middle: files that are cut off, missing temporary folders, interrupted exports.

use std::{
    fs::{self, Permissions},
    os::unix::fs::PermissionsExt,
    path::Path,
    process::{Command, Output, Stdio},
};

use tempfile::TempDir;

use crate::{folders::names, sweep::driver::wait_until, terminal::decoupler};

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn succeed(arguments: &str, folder: &Path) -> String {
    let output = decoupler(arguments, folder);
    assert!(output.status.success(), "{arguments}: {}", text(&output.stderr));
    text(&output.stderr)
}

/// A folder with the network of an array, `n.json`, and readings, `readings.csv`.
fn trained() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let small = "--array 2x2_2x6 --rows known";
    succeed(
        &format!(
            "train {small} --samples 100 --set validation-samples=0 --set test-samples=10 --hidden 2 --epochs 2 --decoder mean --out n.json"
        ),
        folder.path(),
    );
    succeed(
        &format!("simulate {small} --samples 8 --out readings.csv"),
        folder.path(),
    );
    folder
}

fn lines(folder: &Path, name: &str) -> Vec<String> {
    let text = fs::read_to_string(folder.join(name)).unwrap();
    text.lines().map(str::to_owned).collect()
}

#[test]
fn readings_of_an_array_that_are_cut_off_are_decoded_up_to_there() {
    let folder = trained();
    let folder = folder.path();
    let decode = "decode --network n.json --data readings.csv --out out.csv";
    succeed(decode, folder);
    let whole = lines(folder, "out.csv");
    let readings = fs::read(folder.join("readings.csv")).unwrap();
    fs::write(folder.join("readings.csv"), &readings[..readings.len() - 30]).unwrap();
    let message = succeed(decode, folder);
    assert!(
        message.contains("readings.csv': line 9, the last, is cut off and left out"),
        "{message}"
    );
    assert_eq!(lines(folder, "out.csv"), whole[..8]);
}

#[test]
fn a_recording_that_is_cut_off_is_trained_on_and_decoded_up_to_there() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let row = |k: u32| format!("{},{},{}\n", k, 0.5 + f64::from(k * k % 7), 2 * k);
    let recording: String = (0..60).map(row).collect();
    let recording = format!("t,u,d\n{recording}");
    // Within the last number, or before it.
    for cut in [1, 2, 5] {
        fs::write(folder.join("data.csv"), &recording[..recording.len() - cut]).unwrap();
        succeed(
            "train --data data.csv --inputs t,u --targets d --hidden 2 --epochs 2 --decoder mean --intervals never --out n.json",
            folder,
        );
        let message = succeed("decode --network n.json --data data.csv --out out.csv", folder);
        let is_torn = cut == 5;
        assert_eq!(
            message.contains("line 61, the last, is cut off"),
            is_torn,
            "{cut}: {message}"
        );
        assert_eq!(lines(folder, "out.csv").len(), if is_torn { 60 } else { 61 }, "{cut}");
    }
}

#[test]
fn a_network_is_read_once_also_from_a_pipe() {
    let folder = trained();
    let script = "\"$0\" decode --network <(cat n.json) --data readings.csv --out out.csv";
    let mut command = Command::new("bash");
    command.args(["-c", script, env!("CARGO_BIN_EXE_decoupler")]);
    let output = command.current_dir(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert_eq!(lines(folder.path(), "out.csv").len(), 9);
}

fn export(folder: &Path, variable: (&str, &Path)) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command.args("export --network n.json --format c99 --out bundle".split(' '));
    command
        .env(variable.0, variable.1)
        .current_dir(folder)
        .output()
        .unwrap()
}

#[test]
fn a_missing_folder_for_temporary_files_is_named() {
    let folder = trained();
    let output = export(folder.path(), ("TMPDIR", Path::new("/none")));
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(
        message.contains("the folder for temporary files '/none' (TMPDIR) cannot be written"),
        "{message}"
    );
    assert_eq!(names(folder.path()), ["n.json", "readings.csv"]);
    let numpy = "export --network n.json --format numpy --out numpy";
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command
        .args(numpy.split(' '))
        .env("TMPDIR", "/none")
        .current_dir(folder.path());
    assert!(command.output().unwrap().status.success(), "it needs no such folder");
}

#[test]
fn an_interrupted_export_leaves_nothing() {
    for (signal, status) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        interrupt_an_export(signal, status);
    }
}

fn interrupt_an_export(signal: &str, code: i32) {
    let folder = trained();
    let tools = tempfile::tempdir().unwrap();
    let (compiler, temporary) = (tools.path().join("cc"), tools.path().join("tmp"));
    fs::create_dir(&temporary).unwrap();
    let ready = tools.path().join("ready");
    // A compiler that does not end.
    fs::write(
        &compiler,
        format!("#!/bin/sh\n: > '{}'\nexec sleep 1000\n", ready.display()),
    )
    .unwrap();
    fs::set_permissions(&compiler, Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", tools.path().display(), std::env::var("PATH").unwrap());
    let mut command = Command::new("env");
    command.args(["--default-signal", env!("CARGO_BIN_EXE_decoupler")]);
    command.args("export --network n.json --format c99 --out bundle".split(' '));
    command
        .env("PATH", path)
        .env("TMPDIR", &temporary)
        .current_dir(folder.path());
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_until("the compiler runs", || ready.exists());
    let kill = [format!("-{signal}"), child.id().to_string()];
    assert!(Command::new("kill").args(kill).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(code), "{signal}");
    assert_eq!(names(folder.path()), ["n.json", "readings.csv"]);
    assert_eq!(names(&temporary), [""; 0]);
}
