//! Exports of the window on a disk that fails at the N-th operation, for every N: the failure is shown, no part of a file is
//! left, and the window continues.

use std::{env, fs, path::PathBuf, process::Command};

use decoupler::window::Notice;

use crate::{
    driver::Driver,
    folders::names,
    preloaded::{Faults, KINDS, fail_at, has_failed},
};

const EXPORTS: [(&str, &str); 5] = [
    ("Network file, JSON", "network.json"),
    ("Error table, CSV", "errors.csv"),
    ("Checkpoint, resumable", "training.checkpoint"),
    ("Surfaces, SVG", "surfaces.svg"),
    ("NumPy, f64", "numpy"),
];

/// Runs the test below in a process into which the faults are preloaded.
#[test]
fn a_fault_is_shown_and_leaves_nothing() {
    let (faults, folder) = (Faults::new(), tempfile::tempdir().unwrap());
    let mut command = Command::new(env::current_exe().unwrap());
    command.args(["--exact", "faults::exports_at_every_fault", "--ignored", "--nocapture"]);
    faults.preload(&mut command, folder.path());
    let output = command.output().unwrap();
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(
        output.status.success() && text[0].contains("1 passed"),
        "{}",
        text.concat()
    );
}

#[test]
#[ignore = "needs the faults that the test above preloads"]
fn exports_at_every_fault() {
    let [folder, plan] = ["FAULT_FOLDER", "FAULT_PLAN"].map(|name| PathBuf::from(env::var_os(name).unwrap()));
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    for (export, name) in EXPORTS {
        let path = folder.join(name);
        for at in 1.. {
            let (kind, code) = KINDS[at % KINDS.len()];
            let place = format!("{export}: {kind} at operation {at}");
            fail_at(&plan, at, code);
            driver.save(export, &path);
            match driver.notice() {
                Some(Notice::Failed(reason)) => {
                    assert!(reason.contains(name), "{place}: {reason}");
                    assert!(names(&folder).is_empty(), "{place}: {:?}", names(&folder));
                }
                Some(Notice::Done(_)) => assert_eq!(names(&folder), [name], "{place}"),
                None => panic!("{place}"),
            }
            let _ = fs::remove_dir_all(&path);
            let _ = fs::remove_file(&path);
            if !has_failed(&plan) {
                assert!(at > 3, "{place}");
                break;
            }
        }
    }
}
