//! Settings that are chosen automatically.

use std::fs;

use crate::{
    calls::{has, json, number, read, success, write},
    memory::creeping,
};

const TRAIN: &str = "train --time t --inputs u --targets force --hidden auto --budget 1 --data";

#[test]
fn the_answer_has_the_lowest_error_and_the_network_is_marked() {
    let folder = creeping();
    let report = json(&format!("{TRAIN} press.csv --json"), folder.path());
    let search = &report["search"];
    let tried = search["tried"].as_array().unwrap();
    let combined = search["combined"].as_f64().unwrap();
    let chosen = &tried[search["chosen"].as_u64().unwrap() as usize];
    // Those on the chosen features could all be part of it.
    let rivals = tried.iter().filter(|tried| tried["memory"] == chosen["memory"]);
    for model in ["mean", "ridge"] {
        let of_model = rivals.clone().find(|tried| tried["model"] == model).unwrap();
        assert!(combined <= number(of_model, "error") * (1.0 + 1e-12), "{search}");
    }
    assert!(combined <= number(chosen, "error") * (1.0 + 1e-12), "{search}");
    let shares: f64 = tried.iter().map(|tried| number(tried, "share")).sum();
    assert!((shares - 1.0).abs() < 1e-9, "{search}");
    // A reading that creeps needs its past, and the trainings that it begins with are recorded.
    assert!(chosen["memory"].is_object(), "{chosen}");
    assert!(
        tried.iter().any(|tried| tried["model"]["network"]["begin"] == "ridge"),
        "{search}"
    );

    let text = success(&format!("{TRAIN} press.csv"), folder.path());
    has(&text, &["Answer chosen from", "within a budget of 1 s"]);
    let is_marked = |line: &&str| line.contains("hidden nodes, ") && line.contains("*  ");
    assert_eq!(text.lines().filter(is_marked).count(), 1, "{text}");
}

#[test]
fn test_samples_take_no_part_in_the_choice() {
    let folder = creeping();
    // The last fifth of the 600 rows is for testing.
    let text = read(folder.path(), "press.csv");
    let replaced = text
        .lines()
        .enumerate()
        .map(|(number, line)| match line.split(',').next() {
            Some(time) if number > 480 => format!("{time},{},{}\n", number % 7, number % 5),
            _ => format!("{line}\n"),
        });
    write(folder.path(), "other.csv", replaced.collect::<String>());
    let [one, other] = ["press.csv", "other.csv"].map(|file| json(&format!("{TRAIN} {file} --json"), folder.path()));
    assert_eq!(one["search"], other["search"]);
    assert_ne!(one["targets"], other["targets"]);
}

#[test]
fn the_sample_recording_raises_no_warning() {
    let folder = tempfile::tempdir().unwrap();
    let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/samples/soft_skin.csv");
    fs::copy(sample, folder.path().join("skin.csv")).unwrap();
    let train =
        "train --data skin.csv --inputs b1,b2,b3,b4,b5,b6,b7 --targets force,x,y --time time --group press --json";
    let report = json(train, folder.path());
    assert_eq!(report["warnings"], serde_json::json!([]));
    for target in report["targets"].as_array().unwrap() {
        assert!(
            number(target, "r2") > 0.9 && target["r2_interval"][0].as_f64().unwrap() > 0.5,
            "{target}"
        );
    }
}

#[test]
fn a_column_that_looks_like_a_group_is_proposed_once() {
    let folder = creeping();
    let text = read(folder.path(), "press.csv");
    let rows = text.lines().enumerate().map(|(row, line)| match row {
        0 => format!("trial,{line}\n"),
        row => format!("{},{line}\n", row / 60),
    });
    let rows: String = rows.collect();
    for file in ["trials.csv", "others.csv"] {
        fs::write(folder.path().join(file), &rows).unwrap();
    }
    let found = |options: &str| {
        let arguments = format!("{TRAIN} trials.csv --test-data others.csv {options} --json");
        let report = json(&arguments, folder.path());
        let warnings = report["warnings"].as_array().unwrap().iter();
        let proposals = warnings.filter(|warning| warning.as_str().unwrap().contains("trial looks like a group"));
        proposals.count()
    };
    assert_eq!(found(""), 1);
    assert_eq!(found("--group trial"), 0);
}
