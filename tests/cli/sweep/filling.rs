use std::fs;

use serde_json::{Value, json};

use super::driver::{fill, folder_with, merged, results, six, success};

#[test]
fn shards_give_the_results_of_one_program_and_of_train() {
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
fn running_again_trains_only_missing_trials() {
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

/// Removes the times from the output of `train --json`.
fn without_times(mut report: Value) -> Value {
    report.as_object_mut().unwrap().remove("epoch_ms");
    for decoder in report["decoders"].as_object_mut().unwrap().values_mut() {
        let is_time = |name: &String| ["frame_us", "fit_seconds"].contains(&name.as_str());
        decoder.as_object_mut().unwrap().retain(|name, _| !is_time(name));
    }
    report
}
