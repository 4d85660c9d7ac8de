//! Network files, checkpoints and recipes made to harm.

use std::{
    fs::{self, File},
    io::Write,
};

use crate::refused;

/// Beginnings with which a file of each kind is read on, and the command that reads it.
const KINDS: [(&str, &[&str]); 3] = [
    (
        "{\"format\":\"decoupler network\",\"version\":4,",
        &[
            "decode",
            "--network",
            "file.json",
            "--data",
            "in.csv",
            "--out",
            "out.csv",
        ],
    ),
    (
        "{\"format\":\"decoupler checkpoint\",\"version\":4,",
        &["train", "--checkpoint", "file.json", "--resume"],
    ),
    (
        "{\"format\":\"decoupler recipe\",\"version\":1,",
        &["inspect", "--recipe", "file.json"],
    ),
];

#[test]
fn documents_that_are_large_or_deeply_nested_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("in.csv"), "1\n").unwrap();
    for (beginning, command) in KINDS {
        let path = folder.path().join("file.json");
        let mut file = File::create(&path).unwrap();
        file.write_all(beginning.as_bytes()).unwrap();
        file.set_len(400_000_000).unwrap();
        let message = refused(command, folder.path());
        assert!(
            message.contains("file.json") && message.contains("memory limit"),
            "{command:?}: {message}"
        );
        for (open, close) in [("[", "]"), ("{\"a\":", "}")] {
            let depth = 1_000_000;
            let nested = format!("{beginning}\"run\":{}1{}}}", open.repeat(depth), close.repeat(depth));
            fs::write(&path, nested).unwrap();
            let message = refused(command, folder.path());
            assert!(message.contains("file.json"), "{command:?}: {message}");
        }
        // An error quotes what it does not know.
        fs::write(&path, format!("{beginning}\"{}\":1}}", "x".repeat(5_000_000))).unwrap();
        refused(command, folder.path());
    }
}
