use std::fs;

use serde_json::Value;

use super::driver::{fill, folder_with, incomplete, merged, six};
use crate::calls::refused;

#[test]
fn merging_lists_missing_and_conflicting_trials() {
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
    assert_eq!(
        merged("runs others", folder),
        whole,
        "the folders complement each other"
    );
    let (output, message) = incomplete("sweep --merge runs --spec sweep.json --out table.csv", folder);
    assert!(output.contains("missing: trial 2 (hidden 3, seed 7)\n"), "{output}");
    assert!(message.contains("1 missing, 0 conflicting"), "{message}");
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
    let (output, message) = incomplete("sweep --merge runs others --out table.json", folder);
    let line = output.lines().find(|line| line.starts_with("conflicting: ")).unwrap();
    assert!(
        line.contains(&id(4, 0)) && line.contains("runs") && line.contains("others"),
        "{output}"
    );
    assert!(message.contains("0 missing, 1 conflicting"), "{message}");
    let table: Value = serde_json::from_slice(&fs::read(folder.join("table.json")).unwrap()).unwrap();
    assert_eq!(table["trials"].as_array().unwrap().len(), 5, "neither result is used");

    // A digit changed without its checksum, and a result under another name.
    fs::write(&path, text.replace("\"weights\":", "\"weights\":1")).unwrap();
    fs::copy(
        folder.join("runs").join(id(4, 7)),
        folder.join("others").join(id(10, 0)),
    )
    .unwrap();
    let (output, message) = incomplete("sweep --merge others --spec sweep.json --out table.csv", folder);
    assert!(
        output.contains("checksum") && output.contains("its name belongs to another trial"),
        "{output}"
    );
    assert!(
        message.contains("2 missing, 0 conflicting, 2 files unreadable"),
        "{message}"
    );
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
fn an_invalid_merge_is_refused() {
    let folder = folder_with(&six());
    let folder = folder.path();
    fs::create_dir(folder.join("empty")).unwrap();
    for (arguments, status, expected) in [
        ("--merge empty --out table.txt", 2, "ends in .csv or .json"),
        ("--merge empty --out none/table.csv", 1, "does not exist"),
        ("--merge empty --out table.csv", 1, "no sweep in 'empty'"),
        ("--merge none --out table.csv", 1, "cannot read 'none'"),
        ("--merge empty --shard 1/2 --out table.csv", 2, "cannot be used with"),
        ("--out runs", 2, "--spec"),
        ("--spec sweep.json --out runs --shard 3/2", 2, "I/N"),
        ("--spec sweep.json --out sweep.json", 1, "cannot create the folder"),
    ] {
        refused(&format!("sweep {arguments}"), folder, status, expected);
    }
}
