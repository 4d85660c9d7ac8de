//! Guesses of the meanings of files and columns.

use std::path::Path;

use decoupler_core::dataset::SplitBy;
use decoupler_files::import::{Meaning, Plan, Recipe, suggested_plan};

use crate::support::{folder, go_on, joined, recipe};

/// Returns the guess for files with these names and contents.
fn guessed(files: &[(&str, &str)]) -> Plan {
    let folder = folder(files);
    let recipe = Recipe {
        data: files[0].0.into(),
        join: files[1..].iter().map(|(name, _)| joined(name)).collect(),
        ..Recipe::default()
    };
    suggested_plan(&recipe.inspect(folder.path(), &[], &mut go_on).unwrap())
}

/// Returns rows of these columns, each a function of the row.
fn table(header: Option<&str>, rows: usize, columns: &[fn(usize) -> f64]) -> String {
    let mut text = header.map_or(String::new(), |header| format!("{header}\n"));
    for row in 0..rows {
        let cells: Vec<String> = columns.iter().map(|of| of(row).to_string()).collect();
        text += &format!("{}\n", cells.join(","));
    }
    text
}

const VARYING: fn(usize) -> f64 = |row| ((row * 7 + 3) % 11) as f64 + 0.5;
const OTHER: fn(usize) -> f64 = |row| ((row * 5 + 1) % 13) as f64 - 2.5;
const THIRD: fn(usize) -> f64 = |row| ((row * 3 + 2) % 17) as f64 * 0.3;
const CLOCK: fn(usize) -> f64 = |row| 100.0 + 0.1 * row as f64;

#[test]
fn columns_are_guessed_from_names_units_and_numbers() {
    let three: &[fn(usize) -> f64] = &[VARYING, OTHER, THIRD];
    for (sentence, header, inputs, targets) in [
        ("names of targets", "r1,r2,force", "r1 r2", "force"),
        ("units of displacement and force", "a (V),b (mm),c (N)", "a", "b c"),
        (
            "units of sensors take precedence over names",
            "a,load (mV),z",
            "a load",
            "z",
        ),
        ("coordinates with numbers are channels", "x1,y1,x", "x1 y1", "x"),
        (
            "words within names",
            "hall_1,hall_2,probe_depth",
            "hall_1 hall_2",
            "probe_depth",
        ),
        (
            "a sensor's own position is not a target",
            "sensor_x,sensor_y,x",
            "sensor_x sensor_y",
            "x",
        ),
        ("no name matches: the last column", "a,b,c", "a b", "c"),
        ("no header: the last column", "", "c1 c2", "c3"),
        ("all look like targets: the last column", "x,y,z", "x y", "z"),
    ] {
        let header = (!header.is_empty()).then_some(header);
        let plan = guessed(&[("press.csv", &table(header, 30, three))]);
        assert_eq!(plan.import.inputs.join(" "), inputs, "{sentence}");
        assert_eq!(plan.import.targets.join(" "), targets, "{sentence}");
        assert_eq!(plan.division.by, SplitBy::Time, "{sentence}");
    }
}

#[test]
fn constant_columns_are_not_used_and_time_group_and_row_wire_are_found() {
    let columns: &[fn(usize) -> f64] = &[
        CLOCK,
        |row| (row / 10) as f64,
        |row| (row % 3 + 1) as f64,
        VARYING,
        |_| 4.0,
        VARYING,
        OTHER,
    ];
    let header = "time,session,row_wire,u,constant,copy,force";
    let plan = guessed(&[("press.csv", &table(Some(header), 40, columns))]);
    let import = &plan.import;
    assert_eq!(
        (&import.inputs[..], &import.targets[..]),
        (&["u".to_owned()][..], &["force".to_owned()][..])
    );
    assert_eq!(import.time.as_deref(), Some("time"));
    assert_eq!(import.group.as_deref(), Some("session"));
    assert_eq!(import.row_wire.as_deref(), Some("row_wire"));
    assert_eq!(
        plan.division.by,
        SplitBy::Group,
        "groups split the samples without leakage"
    );
}

#[test]
fn an_increasing_column_is_a_time_unless_its_name_says_otherwise() {
    let columns: &[fn(usize) -> f64] = &[CLOCK, VARYING, OTHER];
    for (header, time, inputs) in [
        (Some("u,v,force"), None, &["u", "v"][..]),
        (Some("u (ms),v,force"), Some("u"), &["v"]),
        (Some("Time stamp,v,force"), Some("Time stamp"), &["v"]),
        (None, Some("c1"), &["c2"]),
    ] {
        let import = guessed(&[("press.csv", &table(header, 30, columns))]).import;
        assert_eq!(import.time.as_deref(), time, "{header:?}");
        assert_eq!(import.inputs, inputs, "{header:?}");
    }
}

#[test]
fn files_that_share_a_time_are_joined_to_the_readings() {
    let states = table(None, 30, &[|row| CLOCK(row) + 0.01, VARYING, OTHER]);
    let sensor = table(None, 30, &[CLOCK, OTHER, THIRD]);
    for order in [[0, 1], [1, 0]] {
        let files = [("states.csv", states.as_str()), ("sensor_post.csv", sensor.as_str())];
        let import = guessed(&order.map(|number| files[number])).import;
        assert_eq!(import.data, Path::new("sensor_post.csv"));
        assert_eq!(import.inputs, ["c2", "c3"]);
        assert_eq!(import.targets, ["states.c2", "states.c3"]);
        assert_eq!(
            (import.time.as_deref(), import.join[0].time.as_deref()),
            (Some("c1"), Some("c1"))
        );
    }
}

#[test]
fn files_without_a_common_time_are_joined_row_by_row_and_test_files_found() {
    let of = |shift: usize| {
        let text = |pick: fn(usize) -> f64| {
            (0..20)
                .map(|row| format!("{},{}\n", pick(row + shift), OTHER(row)))
                .collect()
        };
        let (pose, force): (String, String) = (text(VARYING), text(THIRD));
        (pose, force)
    };
    let ((pose, force), (test_pose, test_force)) = (of(0), of(5));
    let plan = guessed(&[
        ("testForce.csv", &test_force),
        ("trainForce.csv", &force),
        ("trainPose.csv", &pose),
        ("testPose.csv", &test_pose),
    ]);
    assert_eq!(plan.import.data, Path::new("trainPose.csv"));
    assert_eq!(plan.import.join[0].file, Path::new("trainForce.csv"));
    assert_eq!((plan.import.time, &plan.import.join[0].time), (None, &None));
    assert_eq!(plan.import.targets, ["trainForce.c1", "trainForce.c2"]);
    let test = plan.test.unwrap();
    assert_eq!(
        (test.data.as_path(), &test.join[..]),
        (Path::new("testPose.csv"), &["testForce.csv".into()][..])
    );
}

#[test]
fn a_recipe_is_inspected_with_its_own_meanings_and_missing_cells() {
    let folder = folder(&[
        ("data.csv", "t,u,v,g\n1,5,-1,p\n2,6,7,p\n3,7,8,q\n"),
        ("b.csv", "t,f\n1,-1\n2,3\n3,4\n"),
    ]);
    let recipe = Recipe {
        join: vec![joined("b.csv")],
        time: Some("t".to_owned()),
        group: Some("g".to_owned()),
        missing: vec!["v=-1".parse().unwrap()],
        ..recipe("u..v", "b.f")
    };
    let files = recipe.inspect(folder.path(), &[], &mut go_on).unwrap();
    assert_eq!(
        files[0].meanings,
        [Meaning::Time, Meaning::Input, Meaning::Input, Meaning::Group]
    );
    assert_eq!(files[1].meanings, [Meaning::Time, Meaning::Target]);
    let missing = |file: usize, column: usize| files[file].columns[column].missing;
    assert_eq!((missing(0, 2), missing(1, 1)), (1, 0));
    assert_eq!(
        (files[1].full_name(1).as_str(), files[0].full_name(1).as_str()),
        ("b.f", "u")
    );
    // A missing column is named.
    let wrong = Recipe {
        targets: vec!["b.force".to_owned()],
        ..recipe
    };
    let error = wrong.inspect(folder.path(), &[], &mut go_on).unwrap_err();
    assert!(error.to_string().contains("b.force"), "{error}");
}

#[test]
fn files_with_the_same_columns_are_appended_and_split_by_file() {
    let three: &[fn(usize) -> f64] = &[VARYING, OTHER, THIRD];
    let first = table(None, 30, three);
    let second = table(None, 40, three);
    let plan = guessed(&[
        ("squat_S1.csv", &first),
        ("squat_S3.csv", &second),
        ("squat_S5.csv", &first),
    ]);
    let appended = Vec::from_iter(plan.import.append.iter().map(|set| set.data.display().to_string()));
    assert_eq!(
        (appended, plan.import.join.len()),
        (vec!["squat_S3.csv".to_owned(), "squat_S5.csv".to_owned()], 0)
    );
    assert_eq!(plan.division.by, SplitBy::Group);
    // Two recordings of a sensor and a probe each.
    let clocked: &[fn(usize) -> f64] = &[CLOCK, VARYING, OTHER];
    let (sensor, states) = (table(None, 30, clocked), table(None, 30, &[CLOCK, THIRD]));
    let plan = guessed(&[
        ("sensor_1.csv", &sensor),
        ("states_1.csv", &states),
        ("sensor_2.csv", &sensor),
        ("states_2.csv", &states),
    ]);
    assert_eq!(
        (plan.import.data.to_str(), plan.import.join.len()),
        (Some("sensor_1.csv"), 1)
    );
    assert_eq!(plan.import.append[0].data, Path::new("sensor_2.csv"));
    assert_eq!(plan.import.append[0].join, [Path::new("states_2.csv")]);
    // Files of different kinds are joined, as before.
    let plan = guessed(&[("pose.csv", &first), ("force.csv", &first)]);
    assert_eq!((plan.import.append.len(), plan.import.join.len()), (0, 1));
}

#[test]
fn a_constant_with_rounding_errors_is_not_proposed_as_a_target() {
    const ROUNDED: fn(usize) -> f64 = |row| if row % 2 == 0 { 145.1 } else { 145.100_01 };
    let text = table(Some("r1,r2,x (mm),force (N)"), 30, &[VARYING, OTHER, ROUNDED, THIRD]);
    let plan = guessed(&[("data.csv", &text)]);
    assert_eq!(plan.import.targets, ["force"]);
}
