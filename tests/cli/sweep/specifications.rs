use std::fs;

use serde_json::json;

use super::driver::{failure, folder_with, run};

#[test]
fn an_invalid_specification_is_refused_with_option_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let cases = [
        ("", 2, "not a specification"),
        ("[1]", 2, "not a specification"),
        (r#"{"train": {}}"#, 2, "missing field `axes`"),
        (r#"{"axes": {}, "axis": {}}"#, 2, "unknown field `axis`"),
        (r#"{"axes": {"seed": [1]}, "axes": {}}"#, 2, "duplicate field `axes`"),
        (
            r#"{"axes": {"seed": [1], "seed": [2]}}"#,
            2,
            "seed is given twice; remove one at line 1",
        ),
        (
            r#"{"axes": {"hiden": [1]}}"#,
            2,
            "axes.hiden, value 1: train has no such option; it has preset, array",
        ),
        (
            r#"{"axes": {}, "train": {"out": "a"}}"#,
            2,
            "train.out: a sweep manages its results and checkpoints itself",
        ),
        (
            r#"{"axes": {}, "train": {"help": "a"}}"#,
            2,
            "train.help: train has no such option",
        ),
        (
            r#"{"axes": {"hidden": 3}}"#,
            2,
            "axes.hidden: 3 is not a list of values",
        ),
        (
            r#"{"axes": {"hidden": []}}"#,
            2,
            "axes.hidden: [] is not a list of values",
        ),
        (
            r#"{"axes": {"hidden": [3, 0]}}"#,
            2,
            "axes.hidden, value 2: invalid value '0' for '--hidden <N|auto>': give a whole number from 1 to 512",
        ),
        (
            r#"{"axes": {"hidden": [3, null]}}"#,
            2,
            "value 2: null is neither a number nor a text",
        ),
        (
            r#"{"axes": {"hidden": [[3, 4]]}}"#,
            2,
            "hidden takes one value; to vary it",
        ),
        (
            r#"{"axes": {"hidden": [3]}, "train": {"hidden": 3}}"#,
            2,
            "axes.hidden: it is also in train",
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
            "train.decoder: the list is empty",
        ),
    ];
    for (text, status, expected) in cases {
        fs::write(folder.join("sweep.json"), text).unwrap();
        let (_, message) = failure("sweep --spec sweep.json --out runs", folder, status);
        assert!(
            message.contains(expected) && message.contains("'sweep.json'"),
            "{text}: {message}"
        );
        assert!(!folder.join("runs").exists(), "{text}");
    }
    let many = Vec::from_iter(0..400);
    let specification = json!({"axes": {"seed": many, "samples": Vec::from_iter(1..300)}});
    fs::write(folder.join("sweep.json"), specification.to_string()).unwrap();
    let (_, message) = failure("sweep --spec sweep.json --out runs", folder, 2);
    assert!(message.contains("more than 100000 combinations"), "{message}");
    let (_, message) = failure("sweep --spec none.json --out runs", folder, 1);
    assert!(message.contains("cannot read 'none.json'"), "{message}");
}

/// One trial cannot be trained, but the others are.
#[test]
fn a_failed_trial_is_reported_and_does_not_stop_others() {
    let folder = folder_with(&json!({
        "train": {"array": "10x6_3x18", "epochs": 3, "decoder": "network", "rows": "known", "scaling": "whiten"},
        "axes": {"samples": [10, 100]},
    }));
    let output = run("sweep --spec sweep.json --out runs", folder.path());
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("warning: trial 1 (samples 10): "), "{message}");
    assert!(
        message.ends_with("error: 1 of 2 trials failed, for the reasons above; the others are kept\n"),
        "{message}"
    );
    let (said, _) = failure("sweep --merge runs --spec sweep.json --out table.csv", folder.path(), 1);
    assert!(said.contains("missing: trial 1 (samples 10)"), "{said}");
}
