//! The run list: it is read back unchanged, programs that share it see each other's changes, and damaged files are
//! reported and never lost.

use std::{collections::BTreeMap, fs, path::Path, sync::Arc, thread};

use decoupler_files::export::{KeptRun, KeptRuns, NetworkFile, RunFolder};

use crate::trained::network;

fn trained(hidden: usize) -> Arc<NetworkFile> {
    Arc::new(network("4x3_2x9", hidden, 4))
}

/// Opens a folder without damaged files.
fn open(path: &Path) -> RunFolder {
    let (mut folder, mut problems) = RunFolder::open(path).unwrap();
    problems.extend(folder.load_used());
    assert!(problems.is_empty(), "{problems:?}");
    folder
}

/// A folder with two runs, one of them renamed and pinned.
fn two(path: &Path) -> RunFolder {
    let mut folder = open(path);
    for hidden in [2, 3] {
        folder.keep(trained(hidden)).unwrap();
    }
    let id = folder.runs().runs[1].id;
    folder.rename(id, "zweiter \"Lauf\" ×").unwrap();
    folder.pin([Some(id), None]).unwrap();
    assert!(folder.load_used().is_empty());
    folder
}

/// Names and contents of all files in the folder.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries
        .map(|entry| {
            (
                entry.file_name().into_string().unwrap(),
                fs::read(entry.path()).unwrap(),
            )
        })
        .collect()
}

fn names(list: &KeptRuns) -> Vec<&str> {
    list.runs.iter().map(|run| run.name.as_str()).collect()
}

fn run_path(folder: &Path, run: &KeptRun) -> std::path::PathBuf {
    folder.join(format!("run-{}.json", run.id))
}

#[test]
fn runs_are_read_back_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data").join("runs");
    assert_eq!(*open(&path).runs(), KeptRuns::default());
    let kept = two(&path);
    assert_eq!(names(kept.runs()), ["4×3_2×9 h2 lm", "zweiter \"Lauf\" ×"]);
    assert_eq!(open(&path).runs(), kept.runs());
    // Each run is a network file like any other.
    let run = &kept.runs().runs[0];
    assert_eq!(
        NetworkFile::load(&run_path(&path, run)).unwrap(),
        *run.load(&path).unwrap()
    );
}

#[test]
fn a_change_writes_one_small_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut kept = two(folder.path());
    let id = kept.runs().runs[0].id;
    let changed = |before: &BTreeMap<String, Vec<u8>>| {
        let mut after = contents(folder.path());
        after.retain(|name, text| before.get(name) != Some(text));
        for text in after.values() {
            assert!(text.len() < 300, "{} bytes", text.len());
        }
        after.into_keys().collect::<Vec<_>>()
    };
    let before = contents(folder.path());
    kept.rename(id, "another name").unwrap();
    assert_eq!(changed(&before), [format!("run-{id}.name.json")]);
    let before = contents(folder.path());
    kept.pin([None, Some(id)]).unwrap();
    assert_eq!(changed(&before), ["pinned.json"]);
    let before = contents(folder.path());
    kept.remove(id).unwrap();
    assert!(changed(&before).is_empty());
    assert_eq!(contents(folder.path()).len(), before.len() - 2, "the run and its name");
}

#[test]
fn two_programs_see_each_others_changes() {
    let folder = tempfile::tempdir().unwrap();
    let [mut first, mut second] = [(); 2].map(|()| open(folder.path()));
    let agree = |first: &mut RunFolder, second: &mut RunFolder| {
        for folder in [&mut *first, &mut *second] {
            assert!(folder.look().is_empty() && folder.load_used().is_empty());
        }
        assert_eq!(first.runs(), second.runs());
    };
    first.keep(trained(2)).unwrap();
    second.keep(trained(3)).unwrap();
    agree(&mut first, &mut second);
    let [a, b] = [0, 1].map(|index| first.runs().runs[index].id);
    first.rename(a, "one").unwrap();
    second.rename(b, "two").unwrap();
    second.pin([Some(b), Some(a)]).unwrap();
    agree(&mut first, &mut second);
    assert_eq!(
        (names(first.runs()), first.runs().pinned),
        (vec!["one", "two"], [Some(b), Some(a)])
    );
    second.remove(b).unwrap();
    // A program that still shows the run renames it; it stays removed.
    first.rename(b, "gone").unwrap();
    agree(&mut first, &mut second);
    assert_eq!(
        (names(first.runs()), first.runs().pinned),
        (vec!["one"], [None, Some(a)])
    );
    assert_eq!(contents(folder.path()).len(), 3);
}

#[test]
fn programs_that_write_at_the_same_time_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let file = trained(2);
    thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let mut kept = open(folder.path());
                for _ in 0..10 {
                    kept.keep(Arc::clone(&file)).unwrap();
                }
            });
        }
    });
    assert_eq!(open(folder.path()).runs().runs.len(), 40);
}

#[test]
fn a_damaged_run_is_named_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let kept = two(folder.path());
    let [first, damaged] = &kept.runs().runs[..] else {
        panic!()
    };
    let path = run_path(folder.path(), damaged);
    let whole = fs::read_to_string(&path).unwrap();
    let texts = [
        &whole[..whole.len() / 2],
        "",
        "not JSON",
        "{\"format\": \"decoupler run list\", \"version\": 1}",
        "{\"format\": \"decoupler network\", \"version\": 99, \"program\": \"decoupler 7.8\"}",
        &whole.replacen("\"hidden\":3", "\"hidden\":4", 1),
    ];
    for text in texts {
        assert_ne!(text, whole);
        fs::write(&path, text).unwrap();
        let before = contents(folder.path());
        let (mut found, problems) = RunFolder::open(folder.path()).unwrap();
        assert_eq!(&found.runs().runs[..], std::slice::from_ref(first));
        assert_eq!(found.runs().pinned, [None, None], "a missing run is not pinned");
        let [problem] = &problems[..] else {
            panic!("{problems:?}")
        };
        assert!(problem.contains(&path.display().to_string()), "{problem}");
        assert!(found.look().is_empty(), "reported once");
        assert_eq!(contents(folder.path()), before, "left unchanged");
        // Once repaired, it is listed again with its name and place.
        fs::write(&path, &whole).unwrap();
        found.look();
        assert!(found.load_used().is_empty());
        assert_eq!(found.runs(), kept.runs());
    }
}

#[test]
fn damaged_names_and_pins_lose_no_run() {
    let folder = tempfile::tempdir().unwrap();
    let kept = two(folder.path());
    let id = kept.runs().runs[1].id;
    for name in [format!("run-{id}.name.json"), "pinned.json".to_owned()] {
        let path = folder.path().join(&name);
        let whole = fs::read_to_string(&path).unwrap();
        let digit = whole.rfind(|c: char| c.is_ascii_alphanumeric()).unwrap();
        let changed = format!("{}7{}", &whole[..digit], &whole[digit + 1..]);
        let newer = whole.replacen("\"version\":1", "\"version\":2", 1);
        for text in [&changed, &newer, "", "{}", "null"] {
            fs::write(&path, text).unwrap();
            let (found, problems) = RunFolder::open(folder.path()).unwrap();
            assert_eq!(found.runs().runs.len(), 2, "{name}: {text}");
            assert!(
                problems.len() == 1 && problems[0].contains(&name),
                "{text}: {problems:?}"
            );
        }
        fs::write(&path, whole).unwrap();
    }
    assert_eq!(open(folder.path()).runs(), kept.runs());
}

#[test]
fn other_files_are_left_alone_and_any_run_number_has_a_successor() {
    let folder = tempfile::tempdir().unwrap();
    let mut kept = open(folder.path());
    kept.keep(trained(2)).unwrap();
    let run = kept.runs().runs[0].clone();
    let last = format!("run-{}.json", u64::MAX);
    fs::copy(run_path(folder.path(), &run), folder.path().join(&last)).unwrap();
    for name in [
        "run-007.json",
        "run-.json",
        "run-1.txt",
        "run-99999999999999999999.json",
    ] {
        fs::write(folder.path().join(name), "mine").unwrap();
    }
    fs::create_dir(folder.path().join("more")).unwrap();
    assert!(kept.look().is_empty());
    kept.keep(trained(3)).unwrap();
    let again = open(folder.path());
    assert_eq!(again.runs().runs.len(), 3);
    assert_eq!(again.runs().runs[2].id, u64::MAX);
}

#[test]
fn runs_that_cannot_be_written_last_until_the_program_ends() {
    let mut kept = RunFolder::default();
    for hidden in [2, 2] {
        kept.keep(trained(hidden)).unwrap();
    }
    assert!(kept.look().is_empty());
    assert_eq!(names(kept.runs()), ["4×3_2×9 h2 lm", "4×3_2×9 h2 lm (2)"]);

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("runs");
    let mut kept = two(&path);
    fs::remove_dir_all(&path).unwrap();
    let error = kept.keep(trained(4)).unwrap_err().to_string();
    assert!(error.contains("runs' does not exist"), "{error}");
    assert_eq!(kept.runs().runs.len(), 3);
    fs::create_dir(&path).unwrap();
    kept.look();
    assert_eq!(names(kept.runs()), ["4×3_2×9 h4 lm"], "others have removed the rest");
    let id = kept.runs().runs[0].id;
    kept.rename(id, "named").unwrap();
    kept.look();
    assert_eq!(names(kept.runs()), ["named"]);
    fs::write(folder.path().join("file"), "").unwrap();
    assert!(RunFolder::open(&folder.path().join("file")).is_err());
}
