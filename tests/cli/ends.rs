//! Work that ends in the middle: files that are cut off, missing temporary folders, interrupted exports.

use std::{
    fs::{self, Permissions},
    os::unix::fs::PermissionsExt,
    path::Path,
    process::{Command, Output},
};

use crate::{
    calls::{SIGNALS, has, piped, read, said, signal, success, wait_until, write},
    files::trained,
    folders::names,
};

#[test]
fn files_that_are_cut_off_are_used_up_to_there() {
    let folder = trained("--rows known");
    let folder = folder.path();
    let decode = "decode --network n.json --data readings.csv --out out.csv";
    success(decode, folder);
    let whole = read(folder, "out.csv");
    let readings = read(folder, "readings.csv");
    write(folder, "readings.csv", &readings[..readings.len() - 30]);
    has(
        &said(decode, folder),
        &["readings.csv': line 41, the last, is cut off and left out"],
    );
    let found = read(folder, "out.csv");
    assert!(found.lines().eq(whole.lines().take(40)));
    // A recording is also trained on: cut off within the last number, or before it.
    let row = |k: u32| format!("{},{},{}\n", k, 0.5 + f64::from(k * k % 7), 2 * k);
    let recording = format!("t,u,d\n{}", (0..60).map(row).collect::<String>());
    for (cut, is_torn) in [(1, false), (2, false), (5, true)] {
        write(folder, "data.csv", &recording[..recording.len() - cut]);
        let train =
            "train --data data.csv --inputs t,u --targets d --hidden 2 --epochs 2 --decoder mean --intervals never";
        success(&format!("{train} --out r.json"), folder);
        let message = said("decode --network r.json --data data.csv --out out.csv", folder);
        assert_eq!(
            message.contains("line 61, the last, is cut off"),
            is_torn,
            "{cut}: {message}"
        );
        assert_eq!(
            read(folder, "out.csv").lines().count(),
            if is_torn { 60 } else { 61 },
            "{cut}"
        );
    }
}

#[test]
fn a_network_is_read_once_also_from_a_pipe() {
    let folder = trained("");
    let script = "\"$0\" decode --network <(cat n.json) --data readings.csv --out out.csv";
    let mut command = Command::new("bash");
    command.args(["-c", script, env!("CARGO_BIN_EXE_decoupler")]);
    let output = command.current_dir(folder.path()).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert_eq!(read(folder.path(), "out.csv").lines().count(), 41);
}

fn export(format: &str, folder: &Path, temporary: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    let export = format!("export --network n.json --format {format} --out bundle");
    command.args(export.split(' ')).env("TMPDIR", temporary);
    command.current_dir(folder).output().unwrap()
}

#[test]
fn a_missing_folder_for_temporary_files_is_named() {
    let folder = trained("");
    let output = export("c99", folder.path(), "/none");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    has(
        &message,
        &["the folder for temporary files '/none' (TMPDIR) cannot be written"],
    );
    assert_eq!(names(folder.path()), ["n.json", "readings.csv"]);
    let output = export("numpy", folder.path(), "/none");
    assert!(output.status.success(), "it needs no such folder");
}

#[test]
fn an_interrupted_export_leaves_nothing() {
    let folder = trained("");
    for (name, status) in SIGNALS {
        let tools = tempfile::tempdir().unwrap();
        let (compiler, temporary) = (tools.path().join("cc"), tools.path().join("tmp"));
        fs::create_dir(&temporary).unwrap();
        let ready = tools.path().join("ready");
        // A compiler that does not end.
        let script = format!("#!/bin/sh\n: > '{}'\nexec sleep 1000\n", ready.display());
        fs::write(&compiler, script).unwrap();
        fs::set_permissions(&compiler, Permissions::from_mode(0o755)).unwrap();
        let path = format!("{}:{}", tools.path().display(), std::env::var("PATH").unwrap());
        let mut command = Command::new("env");
        command.args(["--default-signal", env!("CARGO_BIN_EXE_decoupler")]);
        command.args("export --network n.json --format c99 --out bundle".split(' '));
        command.env("PATH", path).env("TMPDIR", &temporary);
        let mut child = piped(command.current_dir(folder.path()));
        wait_until("the compiler runs", || ready.exists());
        signal(name, &child);
        assert_eq!(child.wait().unwrap().code(), Some(status), "{name}");
        assert_eq!(names(folder.path()), ["n.json", "readings.csv"]);
        assert_eq!(names(&temporary), [""; 0]);
    }
}
