//! Everything that the window writes, on a disk that fails at the N-th operation, for every N: the failure is shown, no part of
//! a file is left, and the window continues.

use std::{
    cell::Cell,
    env, fs,
    path::{Path, PathBuf},
    process::Command,
    time::Duration,
};

use decoupler::window::Notice;
use serde_json::Value;

use crate::{
    driver::Driver,
    experiments::{run_to_the_end, tiny},
    folders::names,
    live::number,
    preloaded::{Faults, KINDS, fail_at, has_failed},
};

/// Exports of each view. Every kind of file and every way to its contents is among them; other names of a menu differ only
/// in what is written.
const EXPORTS: [(&str, &[(&str, &str)]); 4] = [
    (
        "Train",
        &[
            ("Network file, JSON", "network.json"),
            ("Error table, CSV", "errors.csv"),
            ("Checkpoint, resumable", "training.checkpoint"),
            ("Surfaces, SVG", "surfaces.svg"),
            ("Chart, PNG", "chart.png"),
            ("Report, HTML", "report.html"),
            ("NumPy, f64", "numpy"),
            ("ONNX, f32", "onnx"),
            ("C99, f64", "c99"),
            ("MATLAB/Octave, f64", "matlab"),
        ],
    ),
    (
        "Compare",
        &[("A: Network file, JSON", "kept.json"), ("A: Report, HTML", "kept.html")],
    ),
    ("Sensor", &[("Singular values, SVG", "values.svg")]),
    (
        "Study",
        &[("Every trial, CSV", "trials.csv"), ("Figure, PNG", "chart.png")],
    ),
];

/// Runs the test `name` in a process into which the faults are preloaded.
#[track_caller]
fn run_with_faults(name: &str) {
    let (faults, folder) = (Faults::new(), tempfile::tempdir().unwrap());
    let mut command = Command::new(env::current_exe().unwrap());
    command.args(["--exact", &format!("faults::{name}"), "--ignored", "--nocapture"]);
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
fn a_fault_is_shown_and_leaves_nothing() {
    run_with_faults("exports_at_every_fault");
}

#[test]
fn a_fault_loses_no_run() {
    run_with_faults("kept_runs_at_every_fault");
}

#[test]
fn a_fault_leaves_settings_whole() {
    run_with_faults("settings_at_every_fault");
}

#[test]
fn a_fault_ends_a_recording_with_its_last_whole_frame() {
    run_with_faults("recordings_at_every_fault");
}

fn folder_and_plan() -> [PathBuf; 2] {
    ["FAULT_FOLDER", "FAULT_PLAN"].map(|name| PathBuf::from(env::var_os(name).unwrap()))
}

/// Calls `attempt` with the description of a fault at every operation, or at every `step`-th, until there are no more
/// operations that could fail; returns their number.
fn at_every_fault(plan: &Path, step: usize, mut attempt: impl FnMut(&str)) -> usize {
    for at in (1..).step_by(step) {
        let (kind, code) = KINDS[at % KINDS.len()];
        fail_at(plan, at, code);
        attempt(&format!("{kind} at operation {at}"));
        if !has_failed(plan) {
            return at - 1;
        }
    }
    unreachable!("there is an end to the operations")
}

#[test]
#[ignore = "needs the faults that a test above preloads"]
fn exports_at_every_fault() {
    let [folder, plan] = folder_and_plan();
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_kept_run();
    for (view, exports) in EXPORTS {
        driver.click_button(view);
        if view == "Sensor" {
            driver.wait("the analysis", |driver| driver.says("Condition number: "));
        }
        if view == "Study" {
            tiny(&mut driver);
            run_to_the_end(&mut driver);
        }
        for (export, name) in exports {
            let path = folder.join(name);
            // A folder of many files has many operations that are alike.
            let step = if name.contains('.') { 1 } else { 4 };
            let operations = at_every_fault(&plan, step, |fault| {
                let place = format!("{export}: {fault}");
                driver.save(export, &path);
                match driver.notice() {
                    Some(Notice::Failed(reason)) => {
                        assert!(reason.contains(name), "{place}: {reason}");
                        assert!(names(&folder).is_empty(), "{place}: {:?}", names(&folder));
                    }
                    Some(Notice::Done(_) | Notice::Saved(..)) => assert_eq!(names(&folder), [*name], "{place}"),
                    None => panic!("{place}"),
                }
                let _ = fs::remove_dir_all(&path);
                let _ = fs::remove_file(&path);
            });
            assert!(operations >= 3, "{export}: {operations}");
        }
    }
}

#[test]
#[ignore = "needs the faults that a test above preloads"]
fn kept_runs_at_every_fault() {
    let [folder, plan] = folder_and_plan();
    let runs = folder.join("data").join("runs");
    let mut driver = Driver::open_keeping(&runs);
    driver.configure_small();
    let trained = Cell::new(0);
    let operations = at_every_fault(&plan, 1, |fault| {
        driver.train();
        trained.set(trained.get() + 1);
        let listed = |driver: &Driver| driver.runs().len() == trained.get();
        driver.wait(fault, listed);
    });
    assert!(operations >= 6, "{operations}");
    // Those that could not be written are written with the last.
    driver.train();
    let expected = trained.get() + 1;
    driver.wait("all runs", |driver| {
        driver.runs().len() == expected && driver.state().runs.unwritten == 0
    });
    drop(driver);
    let written = names(&runs);
    let is_name = |name: &&String| name.ends_with(".name.json");
    let files = written.iter().filter(|name| !is_name(name));
    assert!(
        files
            .clone()
            .all(|name| name.starts_with("run-") && name.ends_with(".json")),
        "{written:?}"
    );
    assert_eq!(files.count(), expected, "{written:?}");
    let mut driver = Driver::open_keeping(&runs);
    driver.wait("the runs", |driver| driver.runs().len() == expected);
    assert_eq!(driver.notice(), None);
}

#[test]
#[ignore = "needs the faults that a test above preloads"]
fn settings_at_every_fault() {
    let [folder, plan] = folder_and_plan();
    let path = folder.join("window.json");
    let operations = at_every_fault(&plan, 1, |fault| {
        // A failure is reported only once.
        let mut driver = Driver::open_remembering(&path);
        let theme = if driver.state().look.is_dark {
            "Light theme"
        } else {
            "Dark theme"
        };
        driver.act(theme);
        std::thread::sleep(Duration::from_millis(50));
        driver.settle();
        if let Some(Notice::Failed(reason)) = driver.notice() {
            // If the folder cannot be made, the message names the folder.
            assert!(reason.contains(&folder.display().to_string()), "{fault}: {reason}");
        }
        drop(driver);
        let left = names(&folder);
        assert!(left.is_empty() || left == ["window.json"], "{fault}: {left:?}");
        if path.exists() {
            assert!(
                serde_json::from_slice::<Value>(&fs::read(&path).unwrap()).is_ok(),
                "{fault}"
            );
        }
    });
    assert!(operations >= 3, "{operations}");
    assert!(path.exists());
}

#[test]
#[ignore = "needs the faults that a test above preloads"]
fn recordings_at_every_fault() {
    const ENOUGH: usize = 12;
    let [folder, plan] = folder_and_plan();
    let home = folder.join("data");
    let mut driver = Driver::open_keeping(&home.join("runs"));
    driver.configure_small();
    driver.train();
    driver.wait_for_kept_run();
    driver.click_button("Live");
    driver.click("▶ Start");
    driver.wait("a frame", |driver| driver.has("Live decoded surface"));
    // Every frame is an operation, all alike after the first.
    for at in 1..=ENOUGH {
        let (kind, code) = KINDS[at % KINDS.len()];
        let place = format!("{kind} at operation {at}");
        fail_at(&plan, at, code);
        driver.act("Start or end recording");
        driver.wait(&place, |driver| matches!(driver.notice(), Some(Notice::Failed(_))));
        let Some(Notice::Failed(reason)) = driver.notice() else {
            panic!("{place}")
        };
        assert!(reason.contains("record"), "{place}: {reason}");
        assert!(!driver.has("■ End recording"), "{place}");
        driver.click("Dismiss");
        let recordings = home.join("recordings");
        for name in recordings.is_dir().then(|| names(&recordings)).into_iter().flatten() {
            let text = fs::read_to_string(recordings.join(&name)).unwrap();
            let cells = |line: &str| line.split(',').count();
            let header = text.lines().next().unwrap_or_default();
            assert!(text.ends_with('\n') && !header.is_empty(), "{place}: {text}");
            assert!(text.lines().all(|line| cells(line) == cells(header)), "{place}");
            fs::remove_file(recordings.join(name)).unwrap();
        }
    }
    driver.act("Start or end recording");
    driver.wait("a recording", |driver| number(driver, "● Recording: ") > 2.0);
}
