//! Trainings in the terminal: killed, interrupted, resumed, and continued with another method.

use std::{
    io::Write as _,
    path::Path,
    process::{Child, Command},
    thread,
    time::Duration,
};

use decoupler_core::evaluation::Run;
use decoupler_files::export::{CheckpointFile, NetworkFile};
use serde_json::Value;
use tempfile::TempDir;

use crate::{
    calls::{SIGNALS, has, json, number, piped, refused, signal, spawn, success, wait_until},
    folders::names,
};

/// Two starts; the number of epochs is appended.
const LONG: &str = "--decoder mean --array 10x6_3x18 --samples 300 --hidden 8 --starts 2 --seed 2 --set max-fail=1000000 --set min-gradient=0 --epochs";
const SHORT: &str = "--decoder mean --array 10x6_3x18 --samples 100 --hidden 4 --seed 5 --epochs 10";
/// The same settings; the number of epochs is appended.
const UNTIL: &str = "--decoder mean --array 10x6_3x18 --samples 100 --hidden 4 --seed 5 --epochs";
const RESUME: &str = "train --checkpoint run.checkpoint --resume --decoder mean";

/// The network file without its times, which may differ.
fn network(folder: &Path, name: &str) -> NetworkFile {
    let mut file = NetworkFile::load(&folder.join(name)).unwrap();
    file.training.seconds = 0.0;
    file
}

fn checkpoint(folder: &Path) -> Option<CheckpointFile> {
    CheckpointFile::load(&folder.join("run.checkpoint")).ok()
}

/// Number of records of the training in the checkpoint: one more than epochs.
fn epochs(folder: &Path) -> usize {
    let file = checkpoint(folder);
    let epochs = file.and_then(|file| file.starts.iter().map(|start| start.history().len()).min());
    epochs.unwrap_or(0)
}

/// Waits until the checkpoint of a training contains a few epochs.
fn begun(child: Child, folder: &Path) -> Child {
    wait_until("a checkpoint of some epochs", || epochs(folder) > 5);
    child
}

/// An interrupted training saves its results and prints how to resume; one that is killed leaves its checkpoint.
#[test]
fn a_training_that_was_ended_is_resumed_bit_for_bit() {
    for (name, status) in [("KILL", None)]
        .into_iter()
        .chain(SIGNALS.map(|(name, status)| (name, Some(status))))
    {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let checkpointed = "--checkpoint run.checkpoint --checkpoint-interval 0.1 --out part.json --json";
        let child = begun(spawn(&format!("train {LONG} 1000000 {checkpointed}"), folder), folder);
        signal(name, &child);
        let output = child.wait_with_output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), status, "{name}: {message}");
        let mut resume = format!("{RESUME} --out part.json");
        if status.is_some() {
            let last = message.lines().last().unwrap();
            let interrupted = last.strip_prefix("interrupted after epoch ").unwrap();
            let (epoch, printed) = interrupted.split_once("; to resume: decoupler ").unwrap();
            resume = printed.to_owned();
            let report: Value = serde_json::from_slice(&output.stdout).unwrap();
            assert_eq!(report["stop_reason"], "stopped");
            let records = network(folder, "part.json").training.history.len();
            assert_eq!(
                (records, epochs(folder)),
                (epoch.parse::<usize>().unwrap() + 1, records)
            );
            assert_eq!(names(folder), ["part.json", "run.checkpoint"]);
        }
        let epochs = epochs(folder) + 30;
        success(&format!("{resume} --epochs {epochs}"), folder);
        success(&format!("train {LONG} {epochs} --out whole.json"), folder);
        let whole = network(folder, "whole.json");
        assert_eq!(network(folder, "part.json"), whole, "{name}");
        assert_eq!(whole.training.starts.len(), 2);
        assert!(whole.training.starts.iter().all(|start| start.epochs == epochs));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_hangup_that_is_ignored_stays_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut command = Command::new("env");
    command.args(["--ignore-signal=HUP", env!("CARGO_BIN_EXE_decoupler")]);
    let arguments = format!("train {LONG} 1000000 --checkpoint run.checkpoint --checkpoint-interval 0");
    let child = begun(
        piped(command.args(arguments.split_whitespace()).current_dir(folder)),
        folder,
    );
    signal("HUP", &child);
    let before = epochs(folder);
    wait_until("more epochs", || epochs(folder) > before + 5);
    signal("TERM", &child);
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(143));
}

#[test]
fn an_interrupted_training_without_a_checkpoint_suggests_one() {
    let folder = tempfile::tempdir().unwrap();
    let interrupted_after = |seconds| {
        let arguments =
            "train --decoder mean --epochs 1000000 --set max-fail=1000000 --set min-gradient=0 --out n.json";
        let child = spawn(arguments, folder.path());
        thread::sleep(Duration::from_secs(seconds));
        signal("INT", &child);
        let output = child.wait_with_output().unwrap();
        let [printed, message] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
        (output.status.code(), message, printed)
    };
    // Before the first epoch there is nothing to save and the program ends at once; then more time is allowed.
    let mut outputs = [1, 5, 20, 100, 500].into_iter().map(interrupted_after);
    let (status, message, printed) = outputs.find(|(_, message, _)| message.contains("after epoch")).unwrap();
    assert_eq!(status, Some(130), "{message}");
    has(&message, &["use --checkpoint FILE to be able to resume"]);
    has(&printed, &["stopped by you"]);
    assert!(NetworkFile::load(&folder.path().join("n.json")).is_ok());
}

/// A pipe without data as the input, so that the output remains incomplete.
#[test]
fn an_interrupted_decoding_leaves_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    success(&format!("train {SHORT} --out network.json"), folder);
    let mut child = spawn("decode --network network.json --data - --out out.csv", folder);
    let mut input = child.stdin.take().unwrap();
    input
        .write_all(format!("{}\n", ["600"; 18].join(",")).as_bytes())
        .unwrap();
    let is_begun = || names(folder).iter().any(|name| name.ends_with(".part"));
    wait_until("the output is begun", is_begun);
    signal("INT", &child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "interrupted\n");
    assert_eq!(names(folder), ["network.json"]);
}

fn checkpoint_of(arguments: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    success(&format!("train {arguments} --checkpoint run.checkpoint"), folder.path());
    folder
}

#[test]
fn more_epochs_and_another_method_continue_from_the_current_weights() {
    let folder = checkpoint_of(&format!("{SHORT} --method gdm"));
    let folder = folder.path();
    let before = checkpoint(folder).unwrap().starts[0].history().to_vec();
    has(
        &success(&format!("{RESUME} --epochs 20 --out more.json"), folder),
        &["Trained for 20 epochs"],
    );
    success(&format!("train {UNTIL} 20 --method gdm --out whole.json"), folder);
    assert_eq!(network(folder, "more.json"), network(folder, "whole.json"));
    // Momentum first, Levenberg-Marquardt to finish.
    let line = format!("{RESUME} --method lm --set mu=0.1 --epochs 25 --out network.json");
    has(&success(&line, folder), &["Momentum, Eq. (11)", "Method from epoch 21"]);
    let file = network(folder, "network.json");
    let stages = file.training.stages.iter();
    let stages = Vec::from_iter(stages.map(|stage| (stage.first_epoch, stage.method.short_name())));
    assert_eq!(stages, [(0, "gdm"), (21, "lm")]);
    let history = &file.training.history;
    assert_eq!((history.len(), &history[..11]), (26, &before[..]));
    assert!(history[25].training_mse < 0.5 * history[20].training_mse);
    // The same command again changes nothing.
    success(&line, folder);
    assert_eq!(network(folder, "network.json"), file);
    let cause = "the checkpoint has run all of its 25 epochs: give more with --epochs";
    refused(&format!("{RESUME} --method scg"), folder, 2, cause);
    assert_eq!(network(folder, "network.json"), file);
}

/// The same settings give the same network in the terminal and the library, on any number of threads.
#[test]
fn threads_and_the_terminal_give_identical_networks() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["1", "3"].map(|threads| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
        let arguments = format!("train {SHORT} --starts 3 --out {threads}.json");
        command.args(arguments.split(' ')).env("RAYON_NUM_THREADS", threads);
        assert!(command.current_dir(folder.path()).output().unwrap().status.success());
        network(folder.path(), &format!("{threads}.json"))
    });
    let mut run = Run::prepare(files[0].settings).unwrap();
    while run.step().is_none() {}
    let mut library = NetworkFile::from_run(&run, None).unwrap();
    library.training.seconds = 0.0;
    for file in files {
        assert_eq!(file, library);
    }
}

#[test]
fn the_spread_of_the_starts_is_shown_and_the_best_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let train = format!("train {SHORT} --starts 4");
    let words = ["Start", "validation mse", "with the lowest error, is kept"];
    has(&success(&train, folder.path()), &words);
    let report = json(&format!("{train} --json"), folder.path());
    let starts = report["starts"].as_array().unwrap();
    assert_eq!(starts.len(), 4);
    let errors = starts.iter().map(|start| number(start, "validation_mse"));
    assert_eq!(number(&report, "validation_mse"), errors.fold(f64::INFINITY, f64::min));
    assert!(
        starts
            .iter()
            .any(|start| start["z_percent"] == report["errors"]["z_percent"])
    );
    let are_finished = |start: &Value| start["epochs"] == 10 && start["stop_reason"] == "epochs_reached";
    assert!(starts.iter().all(are_finished), "{starts:?}");
}

#[test]
fn every_stopping_rule_can_be_given() {
    let folder = tempfile::tempdir().unwrap();
    for (rule, reason) in [
        ("goal=0.5", "goal_reached"),
        ("min-gradient=1000", "gradient_small"),
        ("max-fail=1", "validation_rose"),
    ] {
        let report = json(&format!("train {UNTIL} 300 --set {rule} --json"), folder.path());
        assert_eq!(report["stop_reason"], reason);
    }
}
