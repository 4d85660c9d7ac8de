//! Trainings in the terminal: killed, interrupted, resumed, and continued with another method.

use std::{
    fs,
    path::Path,
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use decoupler_core::{evaluation::Run, job::Job};
use decoupler_files::export::{CheckpointFile, NetworkFile};
use serde_json::Value;
use tempfile::TempDir;

use crate::folders::names;

/// Two starts; the number of epochs is appended.
const LONG: &str = "--array 10x6_3x18 --samples 300 --hidden 8 --starts 2 --seed 2 --set max-fail=1000000 --set min-gradient=0 --epochs";
const SHORT: &str = "--array 10x6_3x18 --samples 100 --hidden 4 --seed 5 --epochs 10";
/// The same settings; the number of epochs is appended.
const UNTIL: &str = "--array 10x6_3x18 --samples 100 --hidden 4 --seed 5 --epochs";

fn command(arguments: &str, folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command
        .args(arguments.split_whitespace())
        .arg("--force")
        .current_dir(folder);
    command
}

/// Like `command`, with the signals enabled that are ignored if the tests run in the background.
#[cfg(target_os = "linux")]
fn interruptible(arguments: &str, folder: &Path) -> Command {
    let mut command = Command::new("env");
    command.args(["--default-signal", env!("CARGO_BIN_EXE_decoupler")]);
    command
        .args(arguments.split_whitespace())
        .arg("--force")
        .current_dir(folder);
    command
}

fn run(arguments: &str, folder: &Path) -> Output {
    command(arguments, folder).output().unwrap()
}

fn success(arguments: &str, folder: &Path) -> String {
    let output = run(arguments, folder);
    let errors = String::from_utf8_lossy(&output.stderr);
    let are_warnings = errors.lines().all(|line| line.starts_with("warning: "));
    assert!(output.status.success() && are_warnings, "{arguments}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn failure(arguments: &str, folder: &Path, status: i32) -> String {
    let output = run(arguments, folder);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{arguments}: {text}");
    assert_eq!(text.lines().count(), 1, "{arguments}: {text}");
    text
}

/// The network file without its times, which may differ.
fn network(path: &Path) -> NetworkFile {
    let mut file = NetworkFile::load(path).unwrap();
    file.training.seconds = 0.0;
    file
}

fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{what}");
        thread::sleep(Duration::from_millis(5));
    }
}

/// Starts a training and waits until its checkpoint contains a few epochs.
fn begun(mut command: Command, folder: &Path) -> Child {
    let checkpoint = folder.join("run.checkpoint");
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let epochs = || {
        let file = CheckpointFile::load(&checkpoint).ok()?;
        file.starts.iter().map(|start| start.history().len()).min()
    };
    wait_until("a checkpoint of some epochs", || {
        epochs().is_some_and(|epochs| epochs > 5)
    });
    child
}

#[test]
fn a_killed_training_is_resumed_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let arguments =
        format!("train {LONG} 1000000 --checkpoint run.checkpoint --checkpoint-interval 0 --out killed.json");
    let mut child = begun(command(&arguments, folder), folder);
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success());
    let checkpoint = CheckpointFile::load(&folder.join("run.checkpoint")).unwrap();
    let epochs = checkpoint.starts[0].history().len() + 30;
    success(&format!("{RESUME} --epochs {epochs} --out killed.json"), folder);
    success(&format!("train {LONG} {epochs} --out whole.json"), folder);
    let (killed, whole) = (
        network(&folder.join("killed.json")),
        network(&folder.join("whole.json")),
    );
    assert_eq!(killed, whole);
    assert_eq!(whole.training.starts.len(), 2);
    assert!(whole.training.starts.iter().all(|start| start.epochs == epochs));
}

#[cfg(target_os = "linux")]
fn interrupt(child: &Child) {
    signal("INT", child);
}

#[cfg(target_os = "linux")]
fn signal(name: &str, child: &Child) {
    let kill = format!("kill -{name} {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_training_saves_its_results_and_prints_how_to_resume() {
    for (name, status) in [("INT", 130), ("TERM", 143), ("HUP", 129)] {
        interrupted_training_is_resumed(name, status);
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
    command
        .args(arguments.split_whitespace())
        .arg("--force")
        .current_dir(folder);
    let child = begun(command, folder);
    signal("HUP", &child);
    let epochs = || {
        CheckpointFile::load(&folder.join("run.checkpoint")).unwrap().starts[0]
            .history()
            .len()
    };
    let before = epochs();
    wait_until("more epochs", || epochs() > before + 5);
    signal("TERM", &child);
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(143));
}

#[cfg(target_os = "linux")]
fn interrupted_training_is_resumed(name: &str, code: i32) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let arguments =
        format!("train {LONG} 1000000 --checkpoint run.checkpoint --checkpoint-interval 0.1 --out part.json --json");
    let child = begun(interruptible(&arguments, folder), folder);
    signal(name, &child);
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{message}");
    let last = message.lines().last().unwrap();
    let (epoch, resume) = last
        .strip_prefix("interrupted after epoch ")
        .unwrap()
        .split_once(';')
        .unwrap();
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["stop_reason"], "stopped");
    let part = network(&folder.join("part.json"));
    assert_eq!(part.training.history.len(), epoch.parse::<usize>().unwrap() + 1);
    let checkpoint = CheckpointFile::load(&folder.join("run.checkpoint")).unwrap();
    assert_eq!(checkpoint.starts[0].history().len(), part.training.history.len());
    assert_eq!(names(folder), ["part.json", "run.checkpoint"]);
    // The printed command, with fewer epochs.
    let resume = resume.strip_prefix(" to resume: decoupler ").unwrap();
    let epochs = part.training.history.len() + 30;
    success(&format!("{resume} --epochs {epochs}"), folder);
    success(&format!("train {LONG} {epochs} --out whole.json"), folder);
    assert_eq!(network(&folder.join("part.json")), network(&folder.join("whole.json")));
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_training_without_a_checkpoint_suggests_one() {
    let folder = tempfile::tempdir().unwrap();
    let interrupted_after = |seconds| {
        let arguments = "train --epochs 1000000 --set max-fail=1000000 --set min-gradient=0 --out n.json";
        let mut command = interruptible(arguments, folder.path());
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        thread::sleep(Duration::from_secs(seconds));
        interrupt(&child);
        let output = child.wait_with_output().unwrap();
        (
            output.status.code(),
            String::from_utf8(output.stderr).unwrap(),
            output.stdout,
        )
    };
    // Before the first epoch there is nothing to save and the program ends at once; then more time is allowed.
    let mut outputs = [1, 5, 20].into_iter().map(interrupted_after);
    let (status, message, printed) = outputs.find(|(_, message, _)| message.contains("after epoch")).unwrap();
    assert_eq!(status, Some(130), "{message}");
    assert!(
        message.contains("use --checkpoint FILE to be able to resume"),
        "{message}"
    );
    assert!(String::from_utf8(printed).unwrap().contains("stopped by you"));
    assert!(NetworkFile::load(&folder.path().join("n.json")).is_ok());
}

/// A pipe without data as the input, so that the output remains incomplete.
#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_decoding_leaves_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    success(&format!("train {SHORT} --out network.json"), folder);
    assert!(
        Command::new("mkfifo")
            .arg(folder.join("input"))
            .status()
            .unwrap()
            .success()
    );
    let mut command = interruptible("decode --network network.json --data input --out out.csv", folder);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut input = fs::File::options().write(true).open(folder.join("input")).unwrap();
    std::io::Write::write_all(&mut input, format!("{}\n", ["600"; 18].join(",")).as_bytes()).unwrap();
    wait_until("the output is begun", || {
        names(folder).iter().any(|name| name.ends_with(".part"))
    });
    interrupt(&child);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "interrupted\n");
    assert_eq!(names(folder), ["input", "network.json"]);
}

fn checkpoint_of(arguments: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    success(&format!("train {arguments} --checkpoint run.checkpoint"), folder.path());
    folder
}

const RESUME: &str = "train --checkpoint run.checkpoint --resume";

#[test]
fn more_epochs_and_another_method_continue_from_the_current_weights() {
    let folder = checkpoint_of(&format!("{SHORT} --method gdm"));
    let folder = folder.path();
    let before = CheckpointFile::load(&folder.join("run.checkpoint"))
        .unwrap()
        .resume(&Job::UNINTERRUPTED, &mut |_| ())
        .unwrap()
        .0;
    let text = success(&format!("{RESUME} --epochs 20 --out more.json"), folder);
    assert!(text.contains("Trained for 20 epochs"), "{text}");
    success(&format!("train {UNTIL} 20 --method gdm --out whole.json"), folder);
    assert_eq!(network(&folder.join("more.json")), network(&folder.join("whole.json")));
    // Momentum first, Levenberg-Marquardt to finish.
    let line = format!("{RESUME} --method lm --set mu=0.1 --epochs 25 --out network.json");
    let text = success(&line, folder);
    assert!(
        text.contains("Momentum, Eq. (11)") && text.contains("Method from epoch 21"),
        "{text}"
    );
    let file = network(&folder.join("network.json"));
    let stages = &file.training.stages;
    assert_eq!(stages.len(), 2);
    assert_eq!((stages[0].first_epoch, stages[0].method.short_name()), (0, "gdm"));
    assert_eq!(
        (stages[1].first_epoch, stages[1].method),
        (21, file.settings.training.method)
    );
    assert_eq!(file.training.history.len(), 26);
    assert_eq!(file.training.history[..11], *before.leader().history());
    assert!(file.training.history[25].training_mse < 0.5 * file.training.history[20].training_mse);
    // The same command again changes nothing.
    success(&line, folder);
    assert_eq!(network(&folder.join("network.json")), file);
    let refused = failure(&format!("{RESUME} --method scg"), folder, 2);
    assert!(
        refused.contains("the checkpoint has run all of its 25 epochs: give more with --epochs"),
        "{refused}"
    );
    assert_eq!(network(&folder.join("network.json")), file);
}

#[test]
fn arguments_that_contradict_the_checkpoint_are_refused() {
    let folder = checkpoint_of(SHORT);
    let folder = folder.path();
    let bytes = fs::read(folder.join("run.checkpoint")).unwrap();
    let cases = [
        ("--hidden 5", "--hidden 5: the checkpoint has 4"),
        ("--array 10x8_4x24", "--array 10x8_4x24: the checkpoint has 10x6_3x18"),
        ("--seed 6", "--seed 6: the checkpoint has 5"),
        ("--samples 200", "--samples 200: the checkpoint has 100"),
        ("--set test-samples=10", "the checkpoint has 100"),
        ("--set validation-samples=10", "the checkpoint has 200"),
        ("--starts 2", "--starts 2: the checkpoint has 1"),
        ("--set momentum=0.5", "lm has no such setting"),
        ("--out ./run.checkpoint", "name the same file"),
    ];
    for (arguments, expected) in cases {
        let text = failure(&format!("{RESUME} {arguments}"), folder, 2);
        assert!(text.contains(expected), "{arguments}: {text}");
    }
    let restart = failure(&format!("train {SHORT} --checkpoint run.checkpoint"), folder, 2);
    assert!(restart.contains("exists: add --resume"), "{restart}");
    assert!(failure("train --resume", folder, 2).contains("--checkpoint <FILE>"));
    assert!(failure("train --checkpoint none --resume", folder, 1).contains("cannot read 'none'"));
    assert_eq!(
        fs::read(folder.join("run.checkpoint")).unwrap(),
        bytes,
        "nothing is lost"
    );
    success(&format!("{RESUME} {SHORT} --method lm"), folder);
    fs::write(folder.join("run.checkpoint"), &bytes[..bytes.len() / 2]).unwrap();
    assert!(failure(RESUME, folder, 1).contains("'run.checkpoint' is cut off at line 1"));
    assert_eq!(names(folder), ["run.checkpoint"]);
}

/// The same settings give the same network in the terminal and the library, on any number of threads.
#[test]
fn threads_and_the_terminal_give_identical_networks() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = format!("train {SHORT} --starts 3 --out");
    for threads in 1..=3 {
        let mut command = command(&format!("{arguments} {threads}.json"), folder.path());
        assert!(
            command
                .env("RAYON_NUM_THREADS", threads.to_string())
                .output()
                .unwrap()
                .status
                .success()
        );
    }
    let files = [1, 2, 3].map(|threads| network(&folder.path().join(format!("{threads}.json"))));
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
    let text = success(&format!("train {SHORT} --starts 4"), folder.path());
    for words in ["Start", "validation mse", "with the lowest error, is kept"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let json = success(&format!("train {SHORT} --starts 4 --json"), folder.path());
    let report: Value = serde_json::from_str(&json).unwrap();
    let starts = report["starts"].as_array().unwrap();
    assert_eq!(starts.len(), 4);
    let lowest = starts
        .iter()
        .map(|start| start["validation_mse"].as_f64().unwrap())
        .fold(f64::INFINITY, f64::min);
    assert_eq!(report["validation_mse"].as_f64().unwrap(), lowest);
    assert!(
        starts
            .iter()
            .any(|start| start["z_percent"] == report["errors"]["z_percent"])
    );
    assert!(
        starts
            .iter()
            .all(|start| start["epochs"] == 10 && start["stop_reason"] == "epochs_reached")
    );
}

#[test]
fn every_stopping_rule_can_be_given() {
    let folder = tempfile::tempdir().unwrap();
    let stopped = |rule: &str| {
        let json = success(&format!("train {UNTIL} 300 {rule} --json"), folder.path());
        let report: Value = serde_json::from_str(&json).unwrap();
        report["stop_reason"].as_str().unwrap().to_owned()
    };
    assert_eq!(stopped("--set goal=0.5"), "goal_reached");
    assert_eq!(stopped("--set min-gradient=1000"), "gradient_small");
    assert_eq!(stopped("--set max-fail=1"), "validation_rose");
    for rule in [
        "--set goal=-1",
        "--set goal=NaN",
        "--set max-fail=0",
        "--set min-gradient=inf",
    ] {
        assert!(
            failure(&format!("train {rule}"), folder.path(), 2).contains("it must be"),
            "{rule}"
        );
    }
}
