//! The run list: it comes back as it was, and whatever is damaged is put aside and never lost.
#![cfg(feature = "files")]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::{fs, path::Path, sync::Arc};

use decoupler::{
    evaluation::{Run, SimulatedSettings, Simulation},
    export::{KeptRun, NetworkFile, Workspace},
};

fn kept(id: u64, name: &str, hidden: usize) -> KeptRun {
    let mut settings = SimulatedSettings {
        source: Simulation {
            samples: 40,
            validation_samples: 8,
            test_samples: 8,
            ..Simulation::default()
        },
        hidden,
        ..SimulatedSettings::default()
    };
    settings.source.sensor.scale = "4x3_2x9".parse().unwrap();
    settings.training.stopping.epochs = 4;
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    KeptRun {
        id,
        name: name.to_owned(),
        file: Arc::new(NetworkFile::from_run(&run).unwrap()),
    }
}

fn two() -> Workspace {
    Workspace {
        runs: vec![kept(3, "first \"one\"", 2), kept(7, "zweiter Lauf ×", 3)],
        pinned: [Some(7), None],
    }
}

fn names(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = names
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn what_was_kept_comes_back_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data").join("workspace.json");
    let empty = Workspace::load(&path).unwrap();
    assert_eq!((empty.workspace, empty.warning), (Workspace::default(), None));
    let workspace = two();
    workspace.save(&path).unwrap();
    let found = Workspace::load(&path).unwrap();
    assert_eq!((found.workspace, found.warning), (workspace, None));
    assert_eq!(
        names(path.parent().unwrap()),
        ["workspace.json"],
        "nothing is left beside it"
    );
}

#[test]
fn a_damaged_list_is_put_aside_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("workspace.json");
    two().save(&path).unwrap();
    let whole = fs::read_to_string(&path).unwrap();
    let damaged = [
        &whole[..whole.len() / 2],
        "",
        "not JSON",
        "{\"format\": \"decoupler network\", \"version\": 1}",
        "{\"format\": \"decoupler workspace\", \"version\": 1}",
    ];
    for (number, text) in (1..).zip(damaged) {
        fs::write(&path, text).unwrap();
        let found = Workspace::load(&path).unwrap();
        assert_eq!(found.workspace, Workspace::default());
        let aside = folder.path().join(format!("workspace.json.damaged-{number}"));
        assert_eq!(fs::read_to_string(&aside).unwrap(), text, "kept to the letter");
        let warning = found.warning.unwrap();
        assert!(warning.contains(&aside.display().to_string()), "{warning}");
        assert!(warning.contains("is damaged ("), "{warning}");
    }
}

#[test]
fn of_a_list_with_a_damaged_run_the_others_are_taken_up() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("workspace.json");
    let workspace = two();
    workspace.save(&path).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    let damaged = text.replacen("\"hidden\":3", "\"hidden\":4", 1);
    assert_ne!(text, damaged);
    fs::write(&path, &damaged).unwrap();
    let found = Workspace::load(&path).unwrap();
    assert_eq!(found.workspace.runs, workspace.runs[..1]);
    assert_eq!(found.workspace.pinned, [None, None], "what is gone is not pinned");
    let warning = found.warning.unwrap();
    assert!(warning.contains("run 'zweiter Lauf ×' cannot be read"), "{warning}");
    assert!(warning.contains("one run could be read"), "{warning}");
    let aside = folder.path().join("workspace.json.damaged-1");
    assert_eq!(fs::read_to_string(aside).unwrap(), damaged);
}

#[test]
fn a_list_of_a_newer_program_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("workspace.json");
    let text = "{\"format\": \"decoupler workspace\", \"version\": 2, \"program\": \"decoupler 9.0.0\", \"new\": []}";
    fs::write(&path, text).unwrap();
    let error = Workspace::load(&path).unwrap_err().to_string();
    assert!(
        error.contains("decoupler 9.0.0") && error.contains("update it"),
        "{error}"
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), text);
    assert_eq!(names(folder.path()), ["workspace.json"]);
}
