//! Several files of one experiment: their rows follow one another, and each file is a group.

use std::{fs, path::Path};

use decoupler_core::dataset::{Memory, Seed, Span, SplitBy};
use decoupler_files::import::{FileSet, Plan, Recipe};
use tempfile::TempDir;

use crate::support::{folder, go_on, import, joined, reading, recipe, refused, target};

/// A folder with a sensor file (t, r) and a states file (t, f) per session; the force of session s in row i is 10 s + i.
fn sessions(count: usize) -> TempDir {
    let folder = folder(&[]);
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

fn of_sessions(count: usize) -> Recipe {
    let appended = |session: usize| FileSet {
        data: format!("{session}/sensor.csv").into(),
        join: vec![format!("{session}/states.csv").into()],
        append: Vec::new(),
    };
    Recipe {
        data: "0/sensor.csv".into(),
        join: vec![joined("0/states.csv")],
        append: (1..count).map(appended).collect(),
        time: Some("t".to_owned()),
        ..recipe("r", "states.f")
    }
}

#[test]
fn rows_of_all_files_follow_one_another_and_each_file_is_a_group() {
    let folder = sessions(3);
    let recording = import(&of_sessions(3), folder.path()).unwrap();
    let forces = Vec::from_iter((0..3).flat_map(|session| (0..5).map(move |row| f64::from(10 * session + row))));
    assert_eq!(target(&recording, 0), forces);
    assert_eq!(
        reading(&recording, 0),
        Vec::from_iter(forces.iter().map(|force| 2.0 * force))
    );
    assert_eq!(recording.set.groups(), [[0; 5], [1; 5], [2; 5]].concat());
    assert_eq!((recording.rows, recording.files.len()), (15, 6));
    assert_eq!((recording.lines[0], recording.lines[7]), (2, 4));
    for (sample, file) in [(4, "0/sensor.csv"), (5, "1/sensor.csv")] {
        assert_eq!(recording.file_of(sample), folder.path().join(file));
    }
    assert_eq!(recording.times.as_ref().map(Vec::len), Some(15));
    // A session is tested on as a whole.
    let mut plan = Plan {
        import: of_sessions(3),
        ..Plan::default()
    };
    plan.division.by = SplitBy::Group;
    plan.division.validation_fraction = Some(0.0);
    let (recording, _) = plan.recordings(folder.path(), &mut go_on).unwrap();
    let (split, test) = plan.divide(&recording, None, Seed(0)).unwrap();
    assert_eq!((test.samples(), split.training.samples()), (5, 10));
    // Equal values of a column of groups are one group in all files.
    let by_subject = Recipe {
        group: Some("subject".to_owned()),
        ..of_sessions(3)
    };
    let recording = import(&by_subject, folder.path()).unwrap();
    assert_eq!(recording.set.groups(), [[0; 5], [1; 5], [0; 5]].concat());
}

#[test]
fn the_past_does_not_reach_into_the_file_before() {
    let mut with_lag = of_sessions(2);
    with_lag.memory = Some(Memory {
        lags: vec![Span::Samples(1.0)],
        ..Memory::default()
    });
    let recording = import(&with_lag, sessions(2).path()).unwrap();
    assert_eq!(
        reading(&recording, 1),
        [0.0, 0.0, 2.0, 4.0, 6.0, 20.0, 20.0, 22.0, 24.0, 26.0]
    );
}

#[test]
fn a_file_with_other_columns_is_refused_by_name() {
    let folder = sessions(2);
    for (text, cause) in [
        ("t,resistance\n0,1\n0.1,2\n", "1/sensor.csv': there is no column 'r'"),
        ("t,r (ohm)\n0,1\n0.1,2\n", "need the same columns"),
        ("t,r\n0,1\n0.1,bad\n", "1/sensor.csv': line 3"),
        ("t,r\n50,1\n51,2\n", "1/sensor.csv': no row of 2 is left"),
    ] {
        fs::write(folder.path().join("1/sensor.csv"), text).unwrap();
        refused(&of_sessions(2), folder.path(), cause);
    }
    let mut without_joined = of_sessions(2);
    without_joined.append[0].join.clear();
    refused(&without_joined, folder.path(), "needs 1 joined file and has 0");
}

#[test]
fn plans_keep_their_files_and_old_plans_are_read() {
    let plan = Plan {
        import: of_sessions(2),
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
