use serde_json::json;

use super::driver::{folder_with, incomplete};
use crate::{
    calls::{has, refused, write},
    terminal::decoupler,
};

#[test]
fn an_invalid_specification_is_refused_with_option_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sweep = "sweep --spec sweep.json --out runs";
    for (text, expected) in [
        ("", "not a specification"),
        ("[1]", "not a specification"),
        (r#"{"train": {}}"#, "missing field `axes`"),
        (r#"{"axes": {}, "axis": {}}"#, "unknown field `axis`"),
        (r#"{"axes": {"seed": [1]}, "axes": {}}"#, "duplicate field `axes`"),
        (
            r#"{"axes": {"seed": [1], "seed": [2]}}"#,
            "seed is given twice; remove one at line 1",
        ),
        (
            r#"{"axes": {"hiden": [1]}}"#,
            "axes.hiden, value 1: train has no such option; it has preset, array",
        ),
        (
            r#"{"axes": {}, "train": {"out": "a"}}"#,
            "train.out: a sweep manages its results and checkpoints itself",
        ),
        (
            r#"{"axes": {}, "train": {"help": "a"}}"#,
            "train.help: train has no such option",
        ),
        (r#"{"axes": {"hidden": 3}}"#, "axes.hidden: 3 is not a list of values"),
        (r#"{"axes": {"hidden": []}}"#, "axes.hidden: [] is not a list of values"),
        (
            r#"{"axes": {"hidden": [3, 0]}}"#,
            "axes.hidden, value 2: invalid value '0' for '--hidden <N|auto>': give a whole number from 1 to 512",
        ),
        (
            r#"{"axes": {"hidden": [3, null]}}"#,
            "value 2: null is neither a number nor a text",
        ),
        (
            r#"{"axes": {"hidden": [[3, 4]]}}"#,
            "hidden takes one value; to vary it",
        ),
        (
            r#"{"axes": {"hidden": [3]}, "train": {"hidden": 3}}"#,
            "axes.hidden: it is also in train",
        ),
        (
            r#"{"axes": {"hidden": [3, 4, "3"]}}"#,
            "trial 3 (hidden 3): the same options as trial 1 (hidden 3)",
        ),
        (
            r#"{"axes": {"method": ["lm", "gdm"]}, "train": {"set": "mu=0.1"}}"#,
            "trial 2 (method gdm): --set mu: gdm has no such setting; it has",
        ),
        (
            r#"{"axes": {"array": ["10x10_5x30", "2x6_3x18"]}, "train": {"rows": 3}}"#,
            "trial 2 (array 2x6_3x18): ",
        ),
        (r#"{"axes": {"seed": [-1]}}"#, "axes.seed, value 1"),
        (
            r#"{"axes": {}, "train": {"hidden": "3 --json"}}"#,
            "train.hidden: invalid value '3 --json'",
        ),
        (r#"{"axes": {}, "train": {"samples=3": 1}}"#, "no such option"),
        (
            r#"{"axes": {}, "train": {"decoder": []}}"#,
            "train.decoder: the list is empty",
        ),
    ] {
        write(folder, "sweep.json", text);
        refused(sweep, folder, 2, expected);
        refused(sweep, folder, 2, "'sweep.json'");
        assert!(!folder.join("runs").exists(), "{text}");
    }
    let many = json!({"axes": {"seed": Vec::from_iter(0..400), "samples": Vec::from_iter(1..300)}});
    write(folder, "sweep.json", many.to_string());
    refused(sweep, folder, 2, "more than 100000 combinations");
}

/// One trial cannot be trained, but the others are.
#[test]
fn a_failed_trial_is_reported_and_does_not_stop_others() {
    let folder = folder_with(&json!({
        "train": {"array": "10x6_3x18", "epochs": 3, "decoder": "network", "rows": "known", "scaling": "whiten"},
        "axes": {"samples": [10, 100]},
    }));
    let output = decoupler("sweep --spec sweep.json --out runs", folder.path());
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    has(&message, &["warning: trial 1 (samples 10): "]);
    assert!(
        message.ends_with("error: 1 of 2 trials failed, for the reasons above; the others are kept\n"),
        "{message}"
    );
    let (said, _) = incomplete("sweep --merge runs --spec sweep.json --out table.csv", folder.path());
    has(&said, &["missing: trial 1 (samples 10)"]);
}
