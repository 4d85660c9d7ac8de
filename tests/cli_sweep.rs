//! Sweeps in the terminal: divided, repeated, killed, by several programs at once, and merged.

#![cfg(feature = "cli")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{
    collections::BTreeSet,
    fs::{self, File},
    path::Path,
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant, SystemTime},
};

use serde_json::{Value, json};
use tempfile::TempDir;

fn command(arguments: &str, folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    command.args(arguments.split_whitespace()).current_dir(folder);
    command
}

fn run(arguments: &str, folder: &Path) -> Output {
    command(arguments, folder).output().unwrap()
}

fn success(arguments: &str, folder: &Path) -> String {
    let output = run(arguments, folder);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{arguments}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// What a call that must end with `status` and one line prints on standard output and standard error.
fn failure(arguments: &str, folder: &Path, status: i32) -> (String, String) {
    let output = run(arguments, folder);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{arguments}: {text}");
    assert!(
        text.starts_with("error: ") && text.lines().count() == 1,
        "{arguments}: {text}"
    );
    (String::from_utf8(output.stdout).unwrap(), text)
}

fn spawn(command: &mut Command) -> Child {
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn wait_until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{what}");
        thread::sleep(Duration::from_millis(2));
    }
}

/// Six trials, each a fraction of a second.
fn six() -> Value {
    json!({
        "train": {"array": "10x6_3x18", "samples": 100, "epochs": 8, "decoder": ["ridge", "network"]},
        "axes": {"hidden": [3, 4, 10], "seed": [0, 7]},
    })
}

fn folder_with(specification: &Value) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("sweep.json"), specification.to_string()).unwrap();
    folder
}

fn names(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).unwrap();
    entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

/// Results in a folder, with the times of their files.
fn results(folder: &Path) -> BTreeSet<(String, SystemTime)> {
    let is_result = |name: &String| name.ends_with(".json") && !name.starts_with("sweep-");
    let names = names(folder).into_iter().filter(is_result);
    names
        .map(|name| {
            let modified = fs::metadata(folder.join(&name)).unwrap().modified().unwrap();
            (name, modified)
        })
        .collect()
}

fn fill(more: &str, folder: &Path) -> Value {
    serde_json::from_str(&success(&format!("sweep --spec sweep.json --json {more}"), folder)).unwrap()
}

/// The merged table without the times, which alone may differ.
fn merged(folders: &str, folder: &Path) -> Value {
    success(&format!("sweep --merge {folders} --out merged.json"), folder);
    let mut table: Value = serde_json::from_slice(&fs::read(folder.join("merged.json")).unwrap()).unwrap();
    for trial in table["trials"].as_array_mut().unwrap() {
        trial.as_object_mut().unwrap().remove("time");
    }
    table
}

/// Removes what `train --json` says of times.
fn without_times(mut report: Value) -> Value {
    report.as_object_mut().unwrap().remove("epoch_ms");
    for decoder in report["decoders"].as_object_mut().unwrap().values_mut() {
        let is_time = |name: &String| ["frame_us", "fit_seconds"].contains(&name.as_str());
        decoder.as_object_mut().unwrap().retain(|name, _| !is_time(name));
    }
    report
}

#[test]
fn shards_give_what_one_program_gives_and_what_train_prints() {
    let folder = folder_with(&six());
    let folder = folder.path();
    assert_eq!(fill("--out whole", folder)["trained"], 6);
    for (shard, trained) in [("1/4", 2), ("2/4", 2), ("3/4", 1), ("4/4", 1)] {
        assert_eq!(
            fill(&format!("--out shards --shard {shard} --threads 1"), folder)["trained"],
            trained
        );
    }
    fill("--out first --shard 1/2", folder);
    fill("--out second --shard 2/2 --threads 3", folder);
    let whole = merged("whole", folder);
    assert_eq!(whole, merged("shards", folder));
    assert_eq!(whole, merged("first second", folder));
    assert_eq!(whole, merged("second whole first shards", folder));
    let trials = whole["trials"].as_array().unwrap();
    let places: Vec<_> = trials
        .iter()
        .map(|trial| (&trial["options"]["hidden"], &trial["options"]["seed"]))
        .collect();
    let expected = [3, 4, 10].map(|hidden| [(json!(hidden), json!(0)), (json!(hidden), json!(7))]);
    assert!(
        places
            .into_iter()
            .eq(expected.iter().flatten().map(|(hidden, seed)| (hidden, seed)))
    );
    let line = "train --array 10x6_3x18 --samples 100 --epochs 8 --decoder ridge,network --hidden 10 --seed 7 --json";
    let train: Value = serde_json::from_str(&success(line, folder)).unwrap();
    assert_eq!(trials[5]["result"], without_times(train));
    success("sweep --merge shards --out table.csv", folder);
    let mut table = csv::Reader::from_path(folder.join("table.csv")).unwrap();
    let headings = table.headers().unwrap().clone();
    let column = |name: &str| headings.iter().position(|heading| heading == name).unwrap();
    let (hidden, z_mm, seconds) = (column("hidden"), column("result.errors.z_mm"), column("time.seconds"));
    for (record, trial) in table.records().map(Result::unwrap).zip(trials) {
        assert_eq!(record[hidden], trial["options"]["hidden"].to_string());
        let z_mm: f64 = record[z_mm].parse().unwrap();
        assert_eq!(Some(z_mm), trial["result"]["errors"]["z_mm"].as_f64());
        assert!(record[seconds].parse::<f64>().unwrap() > 0.0);
    }
}

#[test]
fn running_again_trains_only_what_is_missing() {
    let folder = folder_with(&six());
    let folder = folder.path();
    fill("--out runs", folder);
    let before = results(&folder.join("runs"));
    assert_eq!(before.len(), 6);
    let again = fill("--out runs", folder);
    assert_eq!((&again["present"], &again["trained"]), (&json!(6), &json!(0)));
    // One more seed, and the same values in another order and spelling.
    let more = json!({
        "axes": {"seed": [9, "7", 0], "hidden": [10, 3, "4"]},
        "train": {"array": "10x6_3x18", "samples": 100, "epochs": 8, "decoder": "network,ridge", "preset": "paper"},
    });
    fs::write(folder.join("sweep.json"), more.to_string()).unwrap();
    let more = fill("--out runs", folder);
    assert_eq!((&more["present"], &more["trained"]), (&json!(6), &json!(3)));
    let after = results(&folder.join("runs"));
    assert!(after.is_superset(&before) && after.len() == 9);
    assert_eq!(merged("runs", folder)["trials"].as_array().unwrap().len(), 9);
}

#[test]
fn a_killed_sweep_loses_nothing_that_was_finished() {
    let folder = folder_with(&six());
    let folder = folder.path();
    let runs = folder.join("runs");
    let mut child = spawn(&mut command("sweep --spec sweep.json --out runs --threads 1", folder));
    wait_until("two results", || runs.is_dir() && results(&runs).len() >= 2);
    child.kill().unwrap();
    child.wait().unwrap();
    let before = results(&runs);
    let again = fill("--out runs --threads 2", folder);
    assert_eq!(again["present"], before.len());
    assert_eq!(again["trained"], 6 - before.len());
    assert!(results(&runs).is_superset(&before), "what was there is not touched");
    assert!(
        names(&runs).iter().all(|name| name.ends_with(".json")),
        "{:?}",
        names(&runs)
    );
    fill("--out whole", folder);
    assert_eq!(merged("runs", folder), merged("whole", folder));
}

#[test]
fn two_programs_fill_one_folder_together() {
    let folder = folder_with(&six());
    let folder = folder.path();
    let start = || {
        spawn(&mut command(
            "sweep --spec sweep.json --out runs --threads 1 --json",
            folder,
        ))
    };
    let outputs = [start(), start()].map(|child| child.wait_with_output().unwrap());
    let reports = outputs.map(|output| {
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    });
    let sum = |field: &str| {
        reports
            .iter()
            .map(|report| report[field].as_u64().unwrap())
            .sum::<u64>()
    };
    assert_eq!((sum("trained"), sum("present")), (6, 6), "nothing twice");
    assert_eq!(names(&folder.join("runs")).len(), 7, "six results and the plan");
}

/// The test stands for the other program: it holds the lock.
#[test]
fn a_trial_of_a_program_that_ends_without_a_result_is_taken_over() {
    let folder = folder_with(&six());
    let folder = folder.path();
    fill("--out runs", folder);
    let runs = folder.join("runs");
    let (name, _) = results(&runs).into_iter().nth(3).unwrap();
    fs::remove_file(runs.join(&name)).unwrap();
    let other = File::create(runs.join(name.replace(".json", ".claim"))).unwrap();
    other.lock().unwrap();
    let mut child = spawn(&mut command(
        "sweep --spec sweep.json --out runs --threads 2 --json",
        folder,
    ));
    // Long enough for the trial to be trained if the lock did not count.
    thread::sleep(Duration::from_millis(1500));
    assert!(child.try_wait().unwrap().is_none(), "it waits");
    assert!(!runs.join(&name).exists());
    drop(other);
    let report: Value = serde_json::from_slice(&child.wait_with_output().unwrap().stdout).unwrap();
    assert_eq!((&report["present"], &report["trained"]), (&json!(5), &json!(1)));
    assert!(runs.join(&name).exists());
}

/// A trial of some seconds, and how it is stopped after its beginning.
#[cfg(target_os = "linux")]
fn stopped_by(signal: &str) -> (TempDir, i32, String) {
    let folder = folder_with(&json!({
        "train": {"array": "10x6_3x18", "samples": 200, "hidden": 6, "max-fail": 1_000_000, "min-gradient": 0,
                  "decoder": "network", "epochs": 1500},
        "axes": {"seed": [3]},
    }));
    let mut command = Command::new("env");
    command.args(["--default-signal=INT", env!("CARGO_BIN_EXE_decoupler")]);
    command
        .args("sweep --spec sweep.json --out runs".split(' '))
        .current_dir(folder.path());
    let child = spawn(&mut command);
    let runs = folder.path().join("runs");
    let is_begun = || names(&runs).iter().any(|name| name.ends_with(".claim"));
    wait_until("the trial is begun", || runs.is_dir() && is_begun());
    let kill = format!("kill -{signal} {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    (folder, output.status.code().unwrap(), told)
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_trial_is_resumed_with_the_same_bits() {
    for (signal, status) in [("INT", 130), ("TERM", 143)] {
        let (folder, ended, told) = stopped_by(signal);
        let folder = folder.path();
        assert_eq!(ended, status, "{told}");
        let last = told.lines().last().unwrap();
        assert_eq!(
            last,
            "interrupted after 0 of 1 trials; the same command trains the rest"
        );
        let runs = names(&folder.join("runs"));
        assert!(runs.iter().any(|name| name.ends_with(".checkpoint")), "{runs:?}");
        assert_eq!(fill("--out runs", folder)["trained"], 1);
        assert_eq!(names(&folder.join("runs")).len(), 2, "the result and the plan");
        fill("--out whole", folder);
        let whole = merged("whole", folder);
        assert_eq!(merged("runs", folder), whole);
        assert_eq!(whole["trials"][0]["result"]["epochs"], 1500);
    }
}

#[test]
fn merging_names_what_is_missing_and_what_conflicts() {
    let folder = folder_with(&six());
    let folder = folder.path();
    fill("--out runs", folder);
    fill("--out others", folder);
    let whole = merged("runs others", folder);
    let id = |hidden: u64, seed: u64| {
        let trials = whole["trials"].as_array().unwrap().iter();
        let mut found = trials.filter(|trial| trial["options"]["hidden"] == hidden && trial["options"]["seed"] == seed);
        format!("{}.json", found.next().unwrap()["trial"].as_str().unwrap())
    };
    fs::remove_file(folder.join("runs").join(id(3, 7))).unwrap();
    fs::remove_file(folder.join("others").join(id(10, 0))).unwrap();
    assert_eq!(merged("runs others", folder), whole, "each has what the other lacks");
    let (said, told) = failure("sweep --merge runs --out table.csv", folder, 1);
    assert!(said.contains("missing: trial 2 (hidden 3, seed 7)\n"), "{said}");
    assert!(told.contains("1 missing, 0 conflicting"), "{told}");
    assert_eq!(fs::read_to_string(folder.join("table.csv")).unwrap().lines().count(), 6);

    // Another result for the same options.
    let path = folder.join("others").join(id(4, 0));
    let text = fs::read_to_string(&path).unwrap();
    let (heading, record) = text.trim_end().split_once("\"run\":").unwrap();
    let record = record.strip_suffix('}').unwrap();
    let changed = record.replace("\"weights\":", "\"weights\":1");
    assert_ne!(record, changed);
    let old = format!("{:08x}", crc32(record.as_bytes()));
    assert!(heading.contains(&old), "the checksum is the usual CRC-32");
    let heading = heading.replace(&old, &format!("{:08x}", crc32(changed.as_bytes())));
    fs::write(&path, format!("{heading}\"run\":{changed}}}\n")).unwrap();
    let (said, told) = failure("sweep --merge runs others --out table.json", folder, 1);
    let line = said.lines().find(|line| line.starts_with("conflicting: ")).unwrap();
    assert!(
        line.contains(&id(4, 0)) && line.contains("runs/") && line.contains("others/"),
        "{said}"
    );
    assert!(told.contains("0 missing, 1 conflicting"), "{told}");
    let table: Value = serde_json::from_slice(&fs::read(folder.join("table.json")).unwrap()).unwrap();
    assert_eq!(table["trials"].as_array().unwrap().len(), 5, "neither result is taken");

    // A digit changed without its checksum, and a result under another name.
    fs::write(&path, text.replace("\"weights\":", "\"weights\":1")).unwrap();
    fs::copy(
        folder.join("runs").join(id(4, 7)),
        folder.join("others").join(id(10, 0)),
    )
    .unwrap();
    let (said, told) = failure("sweep --merge others --out table.csv", folder, 1);
    assert!(
        said.contains("checksum") && said.contains("its name belongs to another trial"),
        "{said}"
    );
    assert!(told.contains("2 missing, 0 conflicting, 2 files unreadable"), "{told}");
}

/// CRC-32 of ISO 3309, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let mut remainder = u32::MAX;
    for &byte in bytes {
        remainder ^= u32::from(byte);
        for _ in 0..8 {
            remainder = (remainder >> 1) ^ (0xEDB8_8320 & (remainder & 1).wrapping_neg());
        }
    }
    !remainder
}

#[test]
fn a_wrong_merge_is_refused() {
    let folder = folder_with(&six());
    let folder = folder.path();
    fs::create_dir(folder.join("empty")).unwrap();
    for (arguments, status, expected) in [
        ("--merge empty --out table.txt", 2, "ends in .csv or .json"),
        ("--merge empty --out none/table.csv", 1, "does not exist"),
        ("--merge empty --out table.csv", 1, "no sweep in 'empty'"),
        ("--merge none --out table.csv", 1, "cannot read 'none'"),
        (
            "--merge empty --spec sweep.json --out table.csv",
            2,
            "cannot be used with",
        ),
        ("--out runs", 2, "--spec"),
        ("--spec sweep.json --out runs --shard 3/2", 2, "I/N"),
        ("--spec sweep.json --out runs --jobs 2", 2, "--engine"),
        ("--spec sweep.json --out sweep.json", 1, "cannot make the folder"),
    ] {
        let (_, told) = failure(&format!("sweep {arguments}"), folder, status);
        assert!(told.contains(expected), "{arguments}: {told}");
    }
}

#[test]
fn a_wrong_specification_is_refused_with_option_place_and_cure() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let cases = [
        ("", 2, "no specification"),
        ("[1]", 2, "no specification"),
        (r#"{"train": {}}"#, 2, "missing field `axes`"),
        (r#"{"axes": {}, "axis": {}}"#, 2, "unknown field `axis`"),
        (r#"{"axes": {"seed": [1]}, "axes": {}}"#, 2, "duplicate field `axes`"),
        (
            r#"{"axes": {"seed": [1], "seed": [2]}}"#,
            2,
            "seed is there twice; leave one out at line 1",
        ),
        (
            r#"{"axes": {"hiden": [1]}}"#,
            2,
            "axes.hiden, value 1: train has no such option; it has preset, rows",
        ),
        (
            r#"{"axes": {}, "train": {"out": "a"}}"#,
            2,
            "train.out: a sweep keeps its results and checkpoints itself",
        ),
        (
            r#"{"axes": {}, "train": {"help": "a"}}"#,
            2,
            "train.help: train has no such option",
        ),
        (r#"{"axes": {"hidden": 3}}"#, 2, "axes.hidden: 3 is no list of values"),
        (r#"{"axes": {"hidden": []}}"#, 2, "axes.hidden: [] is no list of values"),
        (
            r#"{"axes": {"hidden": [3, 0]}}"#,
            2,
            "axes.hidden, value 2: invalid value '0' for '--hidden <N>': give a whole number from 1 to 512",
        ),
        (
            r#"{"axes": {"hidden": [3, null]}}"#,
            2,
            "value 2: null is neither a number nor a text",
        ),
        (
            r#"{"axes": {"hidden": [[3, 4]]}}"#,
            2,
            "hidden takes one value; several are an axis",
        ),
        (
            r#"{"axes": {"hidden": [3]}, "train": {"hidden": 3}}"#,
            2,
            "axes.hidden: it is in train as well",
        ),
        (
            r#"{"axes": {"hidden": [3, 4, "3"]}}"#,
            2,
            "trial 3 (hidden 3): the same options as trial 1 (hidden 3)",
        ),
        (
            r#"{"axes": {"method": ["lm", "gdm"]}, "train": {"set": "mu=0.1"}}"#,
            2,
            "trial 2 (method gdm): --set mu: gdm has no such setting; it has",
        ),
        (
            r#"{"axes": {"array": ["10x10_5x30", "2x6_3x18"]}, "train": {"rows": 3}}"#,
            2,
            "trial 2 (array 2x6_3x18): ",
        ),
        (r#"{"axes": {"seed": [-1]}}"#, 2, "axes.seed, value 1"),
        (
            r#"{"axes": {}, "train": {"hidden": "3 --json"}}"#,
            2,
            "train.hidden: invalid value '3 --json'",
        ),
        (r#"{"axes": {}, "train": {"samples=3": 1}}"#, 2, "no such option"),
        (
            r#"{"axes": {}, "train": {"decoder": []}}"#,
            2,
            "train.decoder: an empty list",
        ),
    ];
    for (text, status, expected) in cases {
        fs::write(folder.join("sweep.json"), text).unwrap();
        let (_, told) = failure("sweep --spec sweep.json --out runs", folder, status);
        assert!(
            told.contains(expected) && told.contains("'sweep.json'"),
            "{text}: {told}"
        );
        assert!(!folder.join("runs").exists(), "{text}");
    }
    let many = Vec::from_iter(0..400);
    let specification = json!({"axes": {"seed": many, "samples": Vec::from_iter(1..300)}});
    fs::write(folder.join("sweep.json"), specification.to_string()).unwrap();
    let (_, told) = failure("sweep --spec sweep.json --out runs", folder, 2);
    assert!(told.contains("more than 100000 combinations"), "{told}");
    let (_, told) = failure("sweep --spec none.json --out runs", folder, 1);
    assert!(told.contains("cannot read 'none.json'"), "{told}");
}

/// One trial cannot be trained; the others are.
#[test]
fn a_trial_that_fails_is_named_and_stops_no_other() {
    let folder = folder_with(&json!({
        "train": {"array": "10x6_3x18", "epochs": 3, "decoder": "network", "rows": "known", "scaling": "whiten"},
        "axes": {"samples": [10, 100]},
    }));
    let output = run("sweep --spec sweep.json --out runs", folder.path());
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("warning: trial 1 (samples 10): "), "{told}");
    assert!(
        told.ends_with("error: 1 of 2 trials failed, for the reasons above; the others are kept\n"),
        "{told}"
    );
    let (said, _) = failure("sweep --merge runs --out table.csv", folder.path(), 1);
    assert!(said.contains("missing: trial 1 (samples 10)"), "{said}");
}

/// The scripts as the engines run them, without the engines: `.ci/engines` has those.
#[cfg(target_os = "linux")]
#[test]
fn job_scripts_train_every_trial_and_ask_for_another_run_when_their_time_is_over() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("it's a folder");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("sweep.json"), six().to_string()).unwrap();
    fill("--out whole", &folder);
    for (engine, variable, ending) in [
        ("slurm", "SLURM_ARRAY_TASK_ID", "sh"),
        ("hyperqueue", "HQ_TASK_ID", "sh"),
    ] {
        let script = success(
            &format!("sweep --spec sweep.json --out {engine} --engine {engine} --jobs 2"),
            &folder,
        );
        assert!(script.contains("1-2"), "{script}");
        let path = folder.join(format!("{engine}.{ending}"));
        fs::write(&path, script).unwrap();
        for task in 1..=2 {
            let mut bash = Command::new("bash");
            let output = bash
                .arg(&path)
                .env(variable, task.to_string())
                .current_dir("/")
                .output()
                .unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            assert!(String::from_utf8_lossy(&output.stdout).starts_with("3 trials: 0 were there, 3 trained"));
        }
        assert_eq!(merged(engine, &folder), merged("whole", &folder), "{engine}");
    }
    let script = success("sweep --spec sweep.json --out many --engine parallel", &folder);
    assert!(
        script.starts_with("#!/bin/bash\n") && script.contains("seq 6 |"),
        "{script}"
    );

    // A minute before the time of the job is over.
    let long = json!({
        "train": {"max-fail": 1_000_000, "min-gradient": 0, "epochs": 1_000_000},
        "axes": {},
    });
    fs::write(folder.join("sweep.json"), long.to_string()).unwrap();
    let script = success("sweep --spec sweep.json --out long --engine slurm", &folder);
    fs::write(folder.join("long.sh"), script).unwrap();
    let scontrol = folder.join("scontrol");
    fs::write(&scontrol, "#!/bin/sh\necho \"$@\" > \"$0.called\"\n").unwrap();
    fs::set_permissions(&scontrol, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
    let mut bash = Command::new("bash");
    let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap());
    bash.arg("long.sh").current_dir(&folder).env("PATH", path);
    bash.envs([("SLURM_ARRAY_TASK_ID", "1"), ("SLURM_ARRAY_JOB_ID", "77")]);
    let child = spawn(&mut bash);
    let long = folder.join("long");
    let is_begun = || names(&long).iter().any(|name| name.ends_with(".claim"));
    wait_until("the trial is begun", || long.is_dir() && is_begun());
    let kill = format!("kill -USR1 {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(
        output.status.code(),
        Some(143),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(
        fs::read_to_string(folder.join("scontrol.called")).unwrap(),
        "requeue 77_1\n"
    );
    assert!(names(&long).iter().any(|name| name.ends_with(".checkpoint")));
}
