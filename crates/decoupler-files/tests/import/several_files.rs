//! Several files of one experiment: their rows follow one another, and each file is a group.

use std::{fs, ops::ControlFlow, path::Path};

use decoupler_core::dataset::{Memory, Seed, Span, SplitBy};
use decoupler_files::import::{FileSet, ImportError, Joined, Plan, Recipe, Recording};
use tempfile::TempDir;

/// A folder with a sensor file (t, r) and a states file (t, f) per session; the force of session s in row i is 10 s + i.
fn sessions(count: usize) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for session in 0..count {
        let (mut sensor, mut states) = ("t,r,subject\n".to_owned(), "t,f\n".to_owned());
        for row in 0..5 {
            let (time, force) = (0.1 * f64::from(row), 10 * session + row as usize);
            sensor += &format!("{time},{},{}\n", 2 * force, session % 2);
            states += &format!("{},{force}\n", time + 0.001);
        }
        fs::create_dir(folder.path().join(session.to_string())).unwrap();
        fs::write(folder.path().join(format!("{session}/sensor.csv")), sensor).unwrap();
        fs::write(folder.path().join(format!("{session}/states.csv")), states).unwrap();
    }
    folder
}

fn set(session: usize) -> FileSet {
    FileSet {
        data: format!("{session}/sensor.csv").into(),
        join: vec![format!("{session}/states.csv").into()],
        append: Vec::new(),
    }
}

fn recipe(count: usize) -> Recipe {
    Recipe {
        data: "0/sensor.csv".into(),
        join: vec![Joined {
            file: "0/states.csv".into(),
            ..Joined::default()
        }],
        append: (1..count).map(set).collect(),
        inputs: vec!["r".to_owned()],
        targets: vec!["states.f".to_owned()],
        time: Some("t".to_owned()),
        ..Recipe::default()
    }
}

fn import(recipe: &Recipe, folder: &TempDir) -> Result<Recording, ImportError> {
    recipe.import(folder.path(), &mut |_| ControlFlow::Continue(()))
}

#[test]
fn rows_of_all_files_follow_one_another_and_each_file_is_a_group() {
    let folder = sessions(3);
    let recording = import(&recipe(3), &folder).unwrap();
    let forces = Vec::from_iter((0..3).flat_map(|session| (0..5).map(move |row| f64::from(10 * session + row))));
    assert_eq!(recording.set.targets().column(0).to_vec(), forces);
    assert_eq!(
        recording.set.readings().column(0).to_vec(),
        Vec::from_iter(forces.iter().map(|force| 2.0 * force))
    );
    let groups = Vec::from_iter((0..3).flat_map(|session| [session; 5]));
    assert_eq!(recording.set.groups(), groups);
    assert_eq!((recording.rows, recording.files.len()), (15, 6));
    assert_eq!((recording.lines[0], recording.lines[7]), (2, 4));
    assert_eq!(recording.file_of(4), folder.path().join("0/sensor.csv"));
    assert_eq!(recording.file_of(5), folder.path().join("1/sensor.csv"));
    assert_eq!(recording.times.as_ref().map(Vec::len), Some(15));
    // A session is tested on as a whole.
    let mut plan = Plan {
        import: recipe(3),
        ..Plan::default()
    };
    plan.division.by = SplitBy::Group;
    plan.division.validation_fraction = Some(0.0);
    let (recording, _) = plan
        .recordings(folder.path(), &mut |_| ControlFlow::Continue(()))
        .unwrap();
    let (split, test) = plan.divide(&recording, None, Seed(0)).unwrap();
    assert_eq!((test.samples(), split.training.samples()), (5, 10));
}

#[test]
fn equal_values_of_a_group_column_are_one_group_in_all_files() {
    let folder = sessions(3);
    let by_subject = Recipe {
        group: Some("subject".to_owned()),
        ..recipe(3)
    };
    let recording = import(&by_subject, &folder).unwrap();
    assert_eq!(recording.set.groups(), [[0; 5], [1; 5], [0; 5]].concat());
}

#[test]
fn the_past_does_not_reach_into_the_file_before() {
    let folder = sessions(2);
    let with_lag = Recipe {
        memory: Some(Memory {
            lags: vec![Span::Samples(1.0)],
            ..Memory::default()
        }),
        ..recipe(2)
    };
    let recording = import(&with_lag, &folder).unwrap();
    let lagged = recording.set.readings().column(1).to_vec();
    assert_eq!(lagged, [0.0, 0.0, 2.0, 4.0, 6.0, 20.0, 20.0, 22.0, 24.0, 26.0]);
}

#[test]
fn a_file_with_other_columns_is_refused_by_name() {
    let folder = sessions(2);
    let error_with = |text: &str| {
        fs::write(folder.path().join("1/sensor.csv"), text).unwrap();
        import(&recipe(2), &folder).unwrap_err().to_string()
    };
    let error = error_with("t,resistance\n0,1\n0.1,2\n");
    assert!(error.contains("1/sensor.csv': there is no column 'r'"), "{error}");
    let error = error_with("t,r (ohm)\n0,1\n0.1,2\n");
    assert!(
        error.contains("r (ohm)") && error.contains("need the same columns"),
        "{error}"
    );
    let error = error_with("t,r\n0,1\n0.1,bad\n");
    assert!(error.contains("1/sensor.csv': line 3"), "{error}");
    let error = error_with("t,r\n50,1\n51,2\n");
    assert!(error.contains("1/sensor.csv': no row of 2 is left"), "{error}");
    let without_joined = Recipe {
        append: vec![FileSet {
            data: "1/sensor.csv".into(),
            ..FileSet::default()
        }],
        ..recipe(1)
    };
    let error = import(&without_joined, &folder).unwrap_err().to_string();
    assert!(error.contains("needs 1 joined file and has 0"), "{error}");
}

#[test]
fn plans_keep_their_files_and_old_plans_are_read() {
    let plan = Plan {
        import: recipe(2),
        ..Plan::default()
    };
    let text = serde_json::to_string(&plan).unwrap();
    assert_eq!(serde_json::from_str::<Plan>(&text).unwrap(), plan);
    let names = Vec::from_iter(plan.named().files().iter().map(|path| path.display().to_string()));
    assert_eq!(names, ["sensor.csv", "states.csv", "sensor.csv", "states.csv"]);
    let moved = plan.within(Path::new("/data"));
    assert!(moved.files().iter().all(|path| path.starts_with("/data")));
    let old: Recipe = serde_json::from_str(r#"{"data": "a.csv", "inputs": ["r"], "targets": ["f"]}"#).unwrap();
    assert!(old.append.is_empty() && !old.has_groups());
    assert!(!serde_json::to_string(&old).unwrap().contains("append"));
}
