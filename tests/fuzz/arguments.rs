//! Command-line arguments: every call ends with one of our exit statuses, and a failed call prints the reason in one
//! line.

use std::{path::Path, process::Command};

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
};

const CALLS: [&str; 4] = [
    "simulate --array 1x1_1x3 --samples 2 --seed 17 --noise 1e-3 --set noise-ohm=0.5 --set adc-bits=12 --set drift=1e-4",
    "simulate --array 2x2_1x3 --samples 2 --rows known --axes xyz --loading smooth:2.5 --set noise-in=test",
    "train --array 1x1_1x3 --samples 6 --set validation-samples=0 --set test-samples=2 --hidden 1 --epochs 2 --decoder mean \
     --method lm --set mu=0.01 --set largest-mu=1e10 --set goal=1e-9 --set min-gradient=1e-7 --set max-fail=3 --json",
    "train --array 1x1_1x3 --samples 6 --set validation-samples=0 --set test-samples=2 --hidden 1 --epochs 2 --decoder mean \
     --method scg --set sigma=1e-5 --inputs log --scaling whiten --seed 3",
];

/// Returns true if the call is accepted; otherwise checks its error message.
fn check(arguments: &[String], folder: &Path) -> bool {
    let output = Command::new(env!("CARGO_BIN_EXE_decoupler"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!message.contains("panicked"), "{arguments:?}: {message}");
    match output.status.code() {
        Some(0) => return true,
        Some(1 | 2) => {
            assert!(message.starts_with("error: "), "{arguments:?}: {message}");
            assert!(message.len() < 2000, "{arguments:?}: {message}");
        }
        other => panic!("{arguments:?}: {other:?} {message}"),
    }
    false
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    replay!(1, |bytes: &[u8]| {
        let text = String::from_utf8_lossy(bytes).replace('\0', "");
        let arguments = Vec::from_iter(text.split_whitespace().map(str::to_owned));
        // Without a command the program would open its window.
        let is_command = |first: &String| first == "simulate" || first == "train";
        usize::from(arguments.first().is_some_and(is_command) && check(&arguments, folder.path()))
    });
}

#[test]
fn every_call_ends_with_a_status_and_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let mut accepted = 0;
    for call in CALLS {
        let mut arguments: Vec<String> = call.split_whitespace().map(str::to_owned).collect();
        for_each_seed(12, |rng| {
            use rand::RngExt;
            let place = rng.random_range(1..arguments.len());
            let changed = mutated(arguments[place].as_bytes(), rng);
            let changed = String::from_utf8_lossy(&changed).replace('\0', "");
            // Counts with more digits only take longer.
            if changed.len() > 6 && changed.bytes().all(|byte| byte.is_ascii_digit()) {
                return;
            }
            let old = std::mem::replace(&mut arguments[place], changed);
            accepted += usize::from(check(&arguments, folder.path()));
            arguments[place] = old;
        });
    }
    assert!(accepted > 3, "only {accepted} calls were accepted");
}
