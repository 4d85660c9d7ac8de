//! Files that are cut off, or of another kind than their name says.

use std::fs;

use crate::ended;

const FIXTURES: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/crates/decoupler-files/tests/fixtures/import"
);

#[test]
fn torn_and_mislabelled_files_are_refused_or_read() {
    let folder = tempfile::tempdir().unwrap();
    for entry in fs::read_dir(FIXTURES).unwrap() {
        let path = entry.unwrap().path();
        let (Ok(bytes), Some(extension)) = (fs::read(&path), path.extension()) else {
            continue;
        };
        let extension = extension.to_str().unwrap();
        let torn = format!("torn.{extension}");
        fs::write(folder.path().join(&torn), &bytes[..bytes.len() - bytes.len() / 3]).unwrap();
        ended(&["inspect", "--data", &torn], folder.path());
        for other in ["csv", "npy", "mat", "xlsx"]
            .into_iter()
            .filter(|other| *other != extension)
        {
            let name = format!("mislabelled.{other}");
            fs::write(folder.path().join(&name), &bytes).unwrap();
            ended(&["inspect", "--data", &name], folder.path());
        }
    }
}
