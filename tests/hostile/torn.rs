//! Files that are cut off, nested, or of another kind than their name says.

use std::{
    collections::BTreeMap,
    fs,
    io::{Cursor, Read, Write},
    path::{Path, PathBuf},
    process::Command,
};

use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

use crate::ended;

const FIXTURES: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/crates/decoupler-files/tests/fixtures/import"
);

/// A file that commands read, and such a command; the command writes nothing but its outputs.
const READ: [(&str, &str); 12] = [
    ("n.json", "decode --network n.json --data readings.csv --out out.csv"),
    ("n.json", "export --network n.json --format numpy --out out"),
    ("r.json", "decode --network r.json --data press.csv --out out.csv"),
    (
        "readings.csv",
        "decode --network n.json --data readings.csv --out out.csv",
    ),
    ("readings.csv", "decode --network n.json --follow --data readings.csv"),
    ("press.csv", "decode --network r.json --data press.csv --out out.csv"),
    ("press.csv", "decode --network r.json --follow --data press.csv"),
    (
        "c.checkpoint",
        "train --checkpoint c.checkpoint --resume --out out.json",
    ),
    (
        "recipe.json",
        "train --recipe recipe.json --hidden 1 --epochs 1 --out out.json",
    ),
    (
        "sensor.json",
        "train --sensor sensor.json --samples 6 --set test-samples=2 --set validation-samples=0 --hidden 1 --epochs 1 --out out.json",
    ),
    ("spec.json", "sweep --spec spec.json --out out"),
    ("runs/TRIAL", "sweep --merge runs --out out.csv"),
];

/// Runs the program without a limit; it must succeed.
fn run(arguments: &str, folder: &Path) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_decoupler"));
    let output = command.args(arguments.split(' ')).current_dir(folder).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments}: {message}");
}

/// Makes one file of every kind, and returns the name of the trial of a sweep.
fn make(folder: &Path) -> String {
    let small = "--samples 12 --set test-samples=4 --set validation-samples=4 --hidden 1 --epochs 2";
    let array = "--array 2x2_1x3";
    run(
        &format!("train {array} {small} --decoder mean --checkpoint c.checkpoint --out n.json"),
        folder,
    );
    run("simulate --array 2x2_1x3 --samples 4 --out samples.csv", folder);
    let rows = (0..40).map(|row| format!("{},{},{},{}\n", row, row % 7, row % 5, row % 3));
    fs::write(
        folder.join("press.csv"),
        format!("t (s),a,b,force\n{}", rows.collect::<String>()),
    )
    .unwrap();
    let columns = "--data press.csv --inputs a,b --targets force --time t";
    run(&format!("inspect {columns} --recipe-out recipe.json"), folder);
    run("train --recipe recipe.json --hidden 1 --epochs 2 --out r.json", folder);
    fs::write(
        folder.join("readings.csv"),
        "row,r_1,r_2,r_3\n1,100,200,300\n2,150,250,350\n1,101,201,301\n2,151,251,351\n",
    )
    .unwrap();
    let sensor = r#"{"format":"decoupler sensor","version":1,"program":"by hand","sensor":{"scale":"2x2_1x3"}}"#;
    fs::write(folder.join("sensor.json"), sensor).unwrap();
    let specification = r#"{"train":{"array":"1x1_1x3","samples":6,"test-samples":2,"validation-samples":0,"epochs":2,"decoder":"mean"},"axes":{"hidden":[1,2]}}"#;
    fs::write(folder.join("spec.json"), specification).unwrap();
    run("sweep --spec spec.json --out runs", folder);
    let mut names = fs::read_dir(folder.join("runs"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name());
    let is_trial = |name: &std::ffi::OsString| name.len() == 37;
    names.find(is_trial).unwrap().into_string().unwrap()
}

/// Returns every file of a folder with its contents.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(contents(&path));
        } else {
            found.insert(path.clone(), fs::read(&path).unwrap());
        }
    }
    found
}

#[test]
fn every_torn_or_mislabelled_file_is_refused_in_one_line_or_read_and_leaves_the_others_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let trial = make(folder.path());
    let valid = contents(folder.path());
    for (name, command) in READ {
        let name = name.replace("TRIAL", &trial);
        let path = folder.path().join(&name);
        let bytes = &valid[&path];
        let others = ["n.json", "c.checkpoint", "recipe.json", "press.csv"];
        let others = others.iter().map(|other| folder.path().join(other));
        let archive = fs::read(format!("{FIXTURES}/deflated.npz")).unwrap();
        let mislabelled = others.map(|other| valid[&other].clone()).chain([archive, Vec::new()]);
        let cuts = [
            1,
            bytes.len() / 3,
            bytes.len() / 2,
            2 * bytes.len() / 3,
            bytes.len() - 2,
        ];
        let torn = cuts.into_iter().map(|length| bytes[..length].to_vec());
        for (number, changed) in torn.chain(mislabelled).enumerate() {
            fs::write(&path, &changed).unwrap();
            let (is_read, message) = ended(&Vec::from_iter(command.split(' ')), folder.path());
            let is_json = name.ends_with(".json") || name.ends_with(".checkpoint");
            assert!(
                !is_read || !is_json || changed == *bytes || number >= cuts.len(),
                "{command}: {number}"
            );
            for output in ["out", "out.csv", "out.json"].map(|output| folder.path().join(output)) {
                if output.is_dir() {
                    assert!(is_read, "{command}: {number}: {message}");
                    fs::remove_dir_all(&output).unwrap();
                } else {
                    let _ = fs::remove_file(&output);
                }
            }
            let mut found = contents(folder.path());
            let is_unchanged = found
                .insert(path.clone(), bytes.clone())
                .is_some_and(|found| found == changed);
            // A resumed training continues its checkpoint.
            assert!(is_unchanged || is_read, "{command}: {number}: {message}");
            assert!(found == valid, "{command}: {number}: {message}");
            fs::write(&path, bytes).unwrap();
        }
    }
}

/// Returns the archive with the contents of one entry replaced.
fn with_entry(archive: &[u8], part: &str, contents: &[u8]) -> Vec<u8> {
    let mut source = ZipArchive::new(Cursor::new(archive)).unwrap();
    let mut copy = ZipWriter::new(Cursor::new(Vec::new()));
    for index in 0..source.len() {
        let mut entry = source.by_index(index).unwrap();
        let name = entry.name().unwrap().into_owned();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        copy.start_file(name.as_str(), SimpleFileOptions::default()).unwrap();
        copy.write_all(if name.contains(part) { contents } else { &bytes })
            .unwrap();
    }
    copy.finish().unwrap().into_inner()
}

#[test]
fn archives_within_archives_are_refused_by_name_or_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let inner = ["plain.npz", "press.xlsx", "press.ods", "deflated.mat"]
        .map(|name| fs::read(format!("{FIXTURES}/{name}")).unwrap());
    for (outer, part) in [
        ("plain.npz", "x.npy"),
        ("press.xlsx", "worksheets/sheet2.xml"),
        ("press.xlsx", "workbook.xml"),
        ("press.ods", "content.xml"),
    ] {
        let bytes = fs::read(format!("{FIXTURES}/{outer}")).unwrap();
        for contents in &inner {
            let mut nested = with_entry(&bytes, part, contents);
            for _ in 0..3 {
                nested = with_entry(&bytes, part, &nested);
            }
            fs::write(folder.path().join(outer), nested).unwrap();
            let (is_read, message) = ended(&["inspect", "--data", outer], folder.path());
            // The other arrays of an archive are read without the entry.
            assert!(
                if is_read {
                    outer == "plain.npz"
                } else {
                    message.contains(outer)
                },
                "{outer}: {message}"
            );
        }
    }
}
