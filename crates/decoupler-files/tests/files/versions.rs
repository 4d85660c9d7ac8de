//! Files of other versions of the program are refused, with their version and the program that wrote them.

use std::{fs, path::Path};

use decoupler_files::export::{CheckpointFile, DocumentError, NetworkFile, RecipeFile, RunFolder, SensorFile};

#[test]
fn any_other_version_of_any_kind_is_named_with_its_program() {
    type Load = fn(&Path) -> Result<(), DocumentError>;
    let kinds: [(&str, Load); 4] = [
        ("network", |path| NetworkFile::load(path).map(|_| ())),
        ("checkpoint", |path| CheckpointFile::load(path).map(|_| ())),
        ("recipe", |path| RecipeFile::load(path).map(|_| ())),
        ("sensor", |path| SensorFile::load(path).map(|_| ())),
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file.json");
    for (kind, load) in kinds {
        for version in [0, 99] {
            let text =
                format!(r#"{{"format":"decoupler {kind}","version":{version},"program":"decoupler 7.8","x":1}}"#);
            fs::write(&path, text).unwrap();
            let message = load(&path).unwrap_err().to_string();
            for part in [
                "file.json",
                &format!("has version {version} of the format, written by decoupler 7.8"),
                "open it with the program that wrote it",
            ] {
                assert!(message.contains(part), "{kind}: {message}");
            }
        }
    }
}

#[test]
fn parts_of_a_run_list_of_another_version_are_named_with_their_program() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["run-1.json", "pinned.json"] {
        let kind = if name == "pinned.json" { "run list" } else { "network" };
        let text = format!(r#"{{"format":"decoupler {kind}","version":99,"program":"decoupler 7.8","x":1}}"#);
        fs::write(folder.path().join(name), text).unwrap();
        let (found, problems) = RunFolder::open(folder.path()).unwrap();
        assert!(found.runs().runs.is_empty());
        let [problem] = &problems[..] else {
            panic!("{problems:?}")
        };
        assert!(
            problem.contains(name) && problem.contains("version 99 of the format, written by decoupler 7.8"),
            "{problem}"
        );
        fs::remove_file(folder.path().join(name)).unwrap();
    }
}
