use std::{collections::BTreeMap, fs, path::PathBuf, sync::Arc};

use decoupler_files::export::{KeptRun, NetworkFile, RunFolder};

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
    trained::trained,
};

#[test]
fn damage_affects_only_the_damaged_file_and_changes_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let (mut kept, _) = RunFolder::open(folder.path()).unwrap();
    for run in trained() {
        kept.keep(Arc::new(NetworkFile::from_run(&run, None).unwrap())).unwrap();
    }
    kept.pin([Some(kept.runs().runs[0].id), None]).unwrap();
    let paths = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path());
    let files: BTreeMap<PathBuf, Vec<u8>> = paths.map(|path| (path.clone(), fs::read(path).unwrap())).collect();
    let same = |a: &KeptRun, b: &KeptRun| {
        let parts = |file: &NetworkFile| (file.settings, file.network.clone(), file.scores.clone());
        let [one, other] = [a, b].map(|run| run.load(folder.path()).unwrap());
        a.id == b.id && a.summary == b.summary && parts(&one) == parts(&other)
    };
    for (path, valid) in &files {
        for_each_seed(30, |rng| {
            let damaged = mutated(valid, rng);
            fs::write(path, &damaged).unwrap();
            let (found, problems) = RunFolder::open(folder.path()).unwrap();
            let text = || String::from_utf8_lossy(&damaged);
            assert!(problems.len() <= 1, "{problems:?}");
            assert!(
                found.runs().runs.len() + problems.len() >= kept.runs().runs.len(),
                "{}",
                text()
            );
            for run in &found.runs().runs {
                assert!(
                    kept.runs().runs.iter().any(|original| same(original, run)),
                    "{}",
                    text()
                );
            }
            assert_eq!(fs::read(path).unwrap(), damaged);
        });
        fs::write(path, valid).unwrap();
    }
    let (mut found, problems) = RunFolder::open(folder.path()).unwrap();
    assert!(problems.is_empty() && found.load_used().is_empty() && kept.load_used().is_empty());
    assert_eq!(found.runs(), kept.runs());
}

/// Reads each input as a run, as the pinned runs, and as a name.
#[test]
fn any_input() {
    replay!(0, |bytes: &[u8]| {
        for name in ["runs/run-1.json", "runs/run-1.name.json", "runs/pinned.json"] {
            let folder = tempfile::tempdir().unwrap();
            fs::create_dir(folder.path().join("runs")).unwrap();
            let file = folder.path().join(name);
            fs::write(&file, bytes).unwrap();
            let Ok((found, problems)) = RunFolder::open(&folder.path().join("runs")) else {
                continue;
            };
            assert!(
                problems
                    .iter()
                    .all(|problem| problem.len() < 2000 && !problem.contains('\n')),
                "{problems:?}"
            );
            assert_eq!(fs::read(&file).unwrap(), bytes, "{name} stays as it is");
            let (again, _) = RunFolder::open(&folder.path().join("runs")).unwrap();
            assert_eq!(again.runs(), found.runs(), "{name}");
        }
        0
    });
}
