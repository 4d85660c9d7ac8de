//! Failures in the terminal state what, where, and the remedy; invalid arguments end with status 2.

use std::fs;

use serde_json::Value;

use crate::terminal::decoupler;

const SMALL: &str = "train --array 2x3_2x9 --samples 40 --set test-samples=10 --hidden 2 --epochs 3 --decoder mean";

/// Standard error and status of the program.
fn refused(arguments: &str) -> (String, i32) {
    let folder = tempfile::tempdir().unwrap();
    let output = decoupler(arguments, folder.path());
    assert!(output.stdout.is_empty(), "{arguments}");
    let text = String::from_utf8(output.stderr).unwrap();
    (text, output.status.code().unwrap())
}

#[test]
fn contradictory_arguments_end_with_status_2_and_the_given_numbers() {
    let cases = [
        ("train --rows 11", "row 11 does not exist: the array has rows 1 to 10"),
        (
            "simulate --rows 11",
            "row 11 does not exist: the array has rows 1 to 10",
        ),
        (
            "train --array 10x2_2x6 --set mu=1e12",
            "mu is 1e12, above largest mu, which is 1e10: lower mu, or raise largest mu",
        ),
        (
            "train --array 10x2_2x6 --samples 100000 --set validation-samples=900010",
            "100000 training and 900010 validation samples, held together as whole snapshots of 10 rows, are 1000010: \
             the limit is 1000000; give fewer for validation",
        ),
        (
            "train --method gdx --set momentum=1",
            "momentum is 1: it must be from 0 to 0.999999",
        ),
        ("train --noise 1e300", "the relative noise is 1e300: give from 0 to 1"),
        ("train --array 10x2_2x6 --hidden 512 --starts 100 --method br", "use"),
    ];
    for (arguments, words) in cases {
        let (text, status) = refused(arguments);
        assert_eq!(status, 2, "{arguments}: {text}");
        // For a large run an estimate is printed first, if the machine has enough memory.
        let message = text.lines().last().unwrap();
        assert!(message.contains(words), "{arguments}: {text}");
        assert!(text.lines().count() <= 2 && message.len() < 300, "{arguments}: {text}");
    }
}

#[test]
fn system_errors_of_files_are_explained_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    fs::create_dir(at("folder")).unwrap();
    fs::write(at("file"), "").unwrap();
    let cases = [
        (
            format!("decode --network {} --data a.csv --out b.csv", at("none.json")),
            "there is no such file or folder; check the name",
        ),
        (
            format!("decode --network {} --data a.csv --out b.csv", at("folder")),
            "it is a folder; give the name of a file",
        ),
        (
            format!("decode --network {}/a --data a.csv --out b.csv", at("file")),
            "a part of the path is a file, not a folder",
        ),
        (
            format!("{SMALL} --checkpoint {} --resume", at("none.checkpoint")),
            "there is no such file or folder; check the name",
        ),
        (
            format!("{SMALL} --out {}/a.json", at("none")),
            "does not exist; make it first",
        ),
        (
            format!("{SMALL} --out {}", at(&"n".repeat(300))),
            "the name is too long",
        ),
    ];
    for (arguments, words) in cases {
        let (text, status) = refused(&arguments);
        assert_eq!(status, 1, "{arguments}: {text}");
        assert!(
            text.contains(words) && !text.contains("os error"),
            "{arguments}: {text}"
        );
        assert_eq!(text.lines().count(), 1, "{arguments}: {text}");
    }
}

/// Warnings of the training are the same in text and JSON, and name the settings of the method.
#[test]
fn an_untrained_network_is_reported_with_cause_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        (
            "--method scg --set lambda=1e300",
            "no better than its random start",
            "lambda to 5e-7 (now 1e300)",
        ),
        (
            "--method gd --set learning-rate=1e300",
            "diverged in epoch 1",
            "learning rate to 0.01 (now 1e300)",
        ),
        (
            "--method gdx --set learning-rate=1e300",
            "no better than its random start",
            "learning rate to 0.01 (now 1e300)",
        ),
        (
            "--method rp --set first-step-length=1e300 --set largest-step-length=1e300",
            "diverged in epoch 1",
            "first step length to 0.07 (now 1e300)",
        ),
        (
            "--method br --set mu=1e300 --set largest-mu=1e300",
            "no better than its random start",
            "mu to 0.005 (now 1e300)",
        ),
        (
            "--method lm --set goal=1e9",
            "no better than its random start after 0 epochs (goal reached)",
            "set a lower goal",
        ),
    ];
    for (arguments, cause, cure) in cases {
        let arguments = format!("{SMALL} {arguments}");
        let text = String::from_utf8(decoupler(&arguments, folder.path()).stderr).unwrap();
        let line = text
            .lines()
            .find(|line| line.starts_with("warning: ") && line.contains(cause));
        assert!(line.is_some_and(|line| line.contains(cure)), "{arguments}: {text}");
        let json = decoupler(&format!("{arguments} --json"), folder.path()).stdout;
        let json: Value = serde_json::from_slice(&json).unwrap();
        let warnings = json["warnings"].as_array().unwrap();
        assert!(
            warnings
                .iter()
                .any(|warning| line.unwrap().ends_with(warning.as_str().unwrap())),
            "{warnings:?}"
        );
    }
    let ordinary = String::from_utf8(
        decoupler(
            &format!("{SMALL} --epochs 30 --set validation-samples=0").replace("--epochs 3 ", ""),
            folder.path(),
        )
        .stdout,
    )
    .unwrap();
    assert!(!ordinary.contains("random start"), "{ordinary}");
}
