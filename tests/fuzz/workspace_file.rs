use std::{fs, sync::Arc};

use decoupler::export::{KeptRun, NetworkFile, Workspace};

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
    trained::trained,
};

#[test]
fn damaged_runs_are_left_out_and_the_file_is_put_aside() {
    let kept = (1..).zip(trained()).map(|(id, run)| KeptRun {
        id,
        name: format!("run {id}"),
        file: Arc::new(NetworkFile::from_run(&run).unwrap()),
    });
    let workspace = Workspace {
        runs: kept.collect(),
        pinned: [Some(1), None],
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("workspace.json");
    let aside = folder.path().join("workspace.json.damaged-1");
    workspace.save(&path).unwrap();
    let valid = fs::read(&path).unwrap();
    for_each_seed(200, |rng| {
        let damaged = mutated(&valid, rng);
        fs::write(&path, &damaged).unwrap();
        let Ok(found) = Workspace::load(&path) else { return };
        for run in &found.workspace.runs {
            let original = workspace.runs.iter().find(|original| {
                let same = |file: &NetworkFile| (file.settings, file.network.clone(), file.errors);
                same(&original.file) == same(&run.file)
            });
            assert!(original.is_some(), "{}", String::from_utf8_lossy(&damaged));
        }
        if found.warning.is_some() {
            assert_eq!(fs::read(&aside).unwrap(), damaged);
            fs::remove_file(&aside).unwrap();
        }
    });
}

/// What is read is read again as the same, and what is left out is put aside.
#[test]
fn any_input() {
    replay!(|bytes: &[u8]| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("workspace.json");
        fs::write(&path, bytes).unwrap();
        let Ok(found) = Workspace::load(&path) else { return };
        if found.warning.is_some() {
            let aside = folder.path().join("workspace.json.damaged-1");
            assert_eq!(fs::read(aside).unwrap(), bytes);
        }
        found.workspace.save(&path).unwrap();
        let again = Workspace::load(&path).unwrap();
        assert!(again.warning.is_none());
        assert_eq!(again.workspace.runs.len(), found.workspace.runs.len());
    });
}
