use serde_json::json;

use super::driver::{fill, folder_with, merged, results, six};
use crate::{
    calls::{self, number, success, write},
    commands::without_times,
};

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
    assert_eq!(trials[5]["result"], without_times(calls::json(line, folder)));
    success("sweep --merge shards --out table.csv", folder);
    let mut table = csv::Reader::from_path(folder.join("table.csv")).unwrap();
    let headings = table.headers().unwrap().clone();
    let column = |name: &str| headings.iter().position(|heading| heading == name).unwrap();
    let (hidden, z_mm, seconds) = (column("hidden"), column("result.errors.z_mm"), column("time.seconds"));
    for (record, trial) in table.records().map(Result::unwrap).zip(trials) {
        assert_eq!(record[hidden], trial["options"]["hidden"].to_string());
        let z_mm: f64 = record[z_mm].parse().unwrap();
        assert_eq!(z_mm, number(&trial["result"]["errors"], "z_mm"));
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
    write(folder, "sweep.json", more.to_string());
    let more = fill("--out runs", folder);
    assert_eq!((&more["present"], &more["trained"]), (&json!(6), &json!(3)));
    let after = results(&folder.join("runs"));
    assert!(after.is_superset(&before) && after.len() == 9);
    assert_eq!(merged("runs", folder)["trials"].as_array().unwrap().len(), 9);
}
