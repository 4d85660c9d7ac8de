//! Files of recordings become samples: values are read exactly, and omitted rows are reported.

use std::{fs, ops::ControlFlow};

use decoupler_core::{
    dataset::{Memory, Seed, Span},
    problem::Problem,
};
use decoupler_files::import::{
    ColumnKind, Decimal, DialectChoice, Encoding, FileSet, InspectedFile, Plan, Recipe, Separator, read_table,
};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use crate::support::{
    column, folder, go_on, import, joined, names, numbers, read, reading, recipe, refused, target, words,
};

#[test]
fn every_column_has_its_own_name() {
    let folder = folder(&[("data.csv", "a,a,a#2,a,b,\n1,2,3,4,5,6\n1,2,3,4,5,7\n")]);
    let table = read(&folder.path().join("data.csv")).unwrap();
    assert_eq!(names(&table), ["a", "a#3", "a#2", "a#4", "b", "c6"]);
}

#[test]
fn the_layout_given_by_the_user_is_used() {
    let folder = folder(&[("data.csv", "note; of 2\n1,5\n2,5\n")]);
    let choice = DialectChoice {
        separator: Some(Separator::Semicolon),
        decimal: Some(Decimal::Comma),
        header: Some(false),
        skip_lines: Some(1),
        encoding: Some(Encoding::Latin1),
    };
    let table = read_table(&folder.path().join("data.csv"), choice, &mut go_on).unwrap();
    assert_eq!((names(&table), column(&table, "c1")), (vec!["c1"], vec![1.5, 2.5]));
    assert_eq!(table.line(1), 3);
}

#[test]
fn numbers_are_read_to_the_last_bit() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let numbers = (0..2000).map(|_| f64::from_bits(rng.random()));
    let expected = Vec::from_iter(numbers.filter(|number| number.is_finite()));
    let text: String = expected.iter().map(|number| format!("{number:e},0\n")).collect();
    let folder = folder(&[("data.csv", &text)]);
    let found = column(&read(&folder.path().join("data.csv")).unwrap(), "c1");
    assert!(
        found
            .iter()
            .map(|number| number.to_bits())
            .eq(expected.iter().map(|number| number.to_bits()))
    );
}

#[test]
fn time_stamps_are_seconds_since_the_first_and_join_files_by_moment() {
    let folder = folder(&[
        (
            "data.csv",
            "2026-11-24T12:00:00.0+01:00,1\n2026-11-24T12:00:00.5+01:00,2\n2026-11-24T12:00:01+01:00,3\n",
        ),
        (
            "states.csv",
            "when,force\n2026-11-24 11:00:00.51Z,20\n2026-11-24 11:00:01.01Z,30\n2026-11-24 11:00:01.5Z,40\n",
        ),
        (
            "mixed.csv",
            "when,force\n2026-11-24 11:00:00Z,20\n2026-11-24 11:00:01,30\n",
        ),
    ]);
    let table = read(&folder.path().join("data.csv")).unwrap();
    assert_eq!(numbers(&table, ""), [[0.0, 0.5, 1.0], [1.0, 2.0, 3.0]]);
    assert_eq!(table.columns[0].unit.as_deref(), Some("s"));
    let mut wanted = recipe("c2", "states.force");
    wanted.join = vec![joined("states.csv")];
    (wanted.join[0].time, wanted.join[0].limit) = (Some("when".to_owned()), Some(0.1));
    wanted.time = Some("c1".to_owned());
    let recording = import(&wanted, folder.path()).unwrap();
    assert_eq!(
        (reading(&recording, 0), target(&recording, 0)),
        (vec![2.0, 3.0], vec![20.0, 30.0])
    );
    let mixed = read(&folder.path().join("mixed.csv")).unwrap();
    assert_eq!(mixed.columns[0].faults.count, 1, "a time zone is not guessed");
}

#[test]
fn cells_that_are_not_numbers_are_named_and_never_guessed() {
    let folder = folder(&[("data.csv", "t,x,y\n0,1,2\n1,1.2.3,2\n2,,2\n3,1,n/a\n4,5,6\n")]);
    let cause = "line 3, column 2 ('x'): '1.2.3' is not a finite number";
    refused(&recipe("x", "t"), folder.path(), cause);
    // A column that is not used does not matter.
    let mut wanted = recipe("y", "t");
    refused(&wanted, folder.path(), "line 5, column 3 ('y'): 'n/a'");
    wanted.missing = vec!["n/a".parse().unwrap()];
    let recording = import(&wanted, folder.path()).unwrap();
    assert_eq!((recording.set.samples(), recording.rows), (4, 5));
    let dropped = &recording.dropped[0];
    assert_eq!(
        (dropped.reason.as_str(), dropped.rows, dropped.first_line),
        ("y is missing", 1, 5)
    );
}

#[test]
fn a_number_can_mean_missing_in_one_column_only() {
    let folder = folder(&[("data.csv", "a,b\n-1,1\n2,-1.0\n3,3\n")]);
    let mut wanted = recipe("a", "b");
    for (missing, left) in [("b=-1", &[-1.0, 3.0][..]), ("-1", &[3.0])] {
        wanted.missing = vec![missing.parse().unwrap()];
        assert_eq!(reading(&import(&wanted, folder.path()).unwrap(), 0), left, "{missing}");
    }
    wanted.missing = vec!["d=-1".parse().unwrap()];
    refused(&wanted, folder.path(), "there is no column 'd'; there are a, b");
}

#[test]
fn rows_of_different_lengths_are_counted() {
    let folder = folder(&[("data.csv", "1,2,3\n1,2,3\n4,5\n6,7,8,9\n1,2,3,\n1,2,3\n")]);
    let recording = import(&recipe("c1 c2", "c3"), folder.path()).unwrap();
    assert_eq!((recording.set.samples(), recording.rows), (4, 6));
    let dropped = recording.dropped.iter();
    let dropped = Vec::from_iter(dropped.map(|dropped| (dropped.reason.as_str(), dropped.rows, dropped.first_line)));
    assert_eq!(
        dropped,
        [("more cells than the 3 columns", 1, 4), ("c3 is missing", 1, 3)]
    );
    assert_eq!(recording.warnings.len(), 2, "{:?}", recording.warnings);
    // The existing cells can be used.
    assert_eq!(import(&recipe("c1", "c2"), folder.path()).unwrap().set.samples(), 5);
    let mut none = recipe("c1 c2", "c3");
    none.conditions = vec!["c1>5".parse().unwrap()];
    let cause = "no row of 6 is left: 1: more cells than the 3 columns; 5: c1>5 is not met";
    refused(&none, folder.path(), cause);
}

#[test]
fn two_recordings_are_joined_by_the_nearest_time() {
    let folder = folder(&[
        ("data.csv", "0.0,10\n1.0,11\n2.0,12\n3.0,13\n9.0,19\n"),
        ("states.csv", "2.1,102,7\n0.2,100,9\n1.1,101,8\n3.4,103,5\n"),
    ]);
    let mut wanted = recipe("c2", "states.c2");
    wanted.join = vec![joined("states.csv")];
    wanted.time = Some("c1".into());
    wanted.conditions = vec!["states.c3>5".parse().unwrap()];
    let recording = import(&wanted, folder.path()).unwrap();
    // The median interval of the states is 1.0, so the limit is 0.5; the last row has no partner.
    assert_eq!(reading(&recording, 0), [10.0, 11.0, 12.0]);
    assert_eq!(target(&recording, 0), [100.0, 101.0, 102.0]);
    assert_eq!(recording.times.unwrap(), [0.0, 1.0, 2.0]);
    let join = recording.files[1].join.unwrap();
    assert_eq!((join.without_partner, join.unused), (1, 0));
    assert!((join.limit - 0.5).abs() < 1e-9, "{}", join.limit);
    let states = folder.path().join("states.csv").display().to_string();
    let reasons = [
        "states.c3>5 is not met".to_owned(),
        format!("no row of '{states}' within 0.5"),
    ];
    let are_named = recording
        .dropped
        .iter()
        .zip(&reasons)
        .all(|(found, reason)| found.reason.starts_with(reason));
    assert!(are_named, "{:?}", recording.dropped);
    // Without times, rows are joined in order if their numbers are equal.
    wanted.time = None;
    refused(&wanted, folder.path(), "it has 4 rows and the other file 5");
}

#[test]
fn samples_are_in_the_order_of_their_times() {
    let folder = folder(&[("data.csv", "t,x,y\n3,30,1\n1,10,1\n2,20,1\n")]);
    let mut wanted = recipe("x", "y");
    wanted.time = Some("t".into());
    let recording = import(&wanted, folder.path()).unwrap();
    assert_eq!(reading(&recording, 0), [10.0, 20.0, 30.0]);
    let warning = &recording.warnings[0];
    assert!(warning.contains("backwards 1 time, first on line 3"), "{warning}");
}

#[test]
fn columns_have_names_ranges_units_and_one_meaning() {
    let text = "row,press,x (mm),y,z [N]\n1,a,1,2,3\n2,a,4,5,6\n1,b,7,8,9\n";
    let folder = folder(&[("data.csv", text)]);
    let mut wanted = recipe("x..y", "z");
    wanted.group = Some("press".into());
    wanted.row_wire = Some("row".into());
    wanted.units = [("y".to_owned(), "V".to_owned())].into();
    let recording = import(&wanted, folder.path()).unwrap();
    let problem = &recording.problem;
    let titles = Vec::from_iter(
        problem
            .inputs
            .iter()
            .chain(&problem.targets)
            .map(|channel| channel.title()),
    );
    assert_eq!(titles, ["x (mm)", "y (V)", "z (N)"]);
    assert_eq!(recording.set.groups(), [0, 0, 1]);
    assert_eq!([1, 2].map(|sample| recording.set.row_wire(sample)), [Some(1), Some(0)]);
    for (inputs, targets, cause) in [
        ("x", "zz", "no column 'zz'; there are row, press, x, y, z"),
        ("x y", "y", "'y' is both an input and a target"),
        ("y..x", "z", "'y..x' is not a range"),
        ("", "z", "no column is an input"),
    ] {
        refused(&recipe(inputs, targets), folder.path(), cause);
    }
    wanted.conditions = vec!["press<2".parse().unwrap()];
    refused(&wanted, folder.path(), "the label 'a' is not a number");
}

#[test]
fn reading_can_be_cancelled() {
    let folder = folder(&[("data.csv", &"1,2\n".repeat(1_000_000))]);
    let mut reports = 0;
    let mut watch = |progress: decoupler_files::import::Progress| {
        reports += 1;
        assert_eq!(progress.of, Some(4_000_000));
        match progress.bytes {
            0..=2_000_000 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        }
    };
    let cancelled = read_table(&folder.path().join("data.csv"), DialectChoice::default(), &mut watch);
    assert_eq!(cancelled.unwrap_err().to_string(), "the import was cancelled");
    assert!((2..=4).contains(&reports), "{reports}");
}

#[test]
fn an_inspection_describes_each_column() {
    let text = "time (s),a,b,c,d,e\n0,1.5,1,7,1,x\n1,,2,7,2,y\n2,2.5,3,7,3,z\n3,3,4,7,4,\n30,4,5,7,5,w\n";
    let folder = folder(&[("data.csv", text)]);
    let path = folder.path().join("data.csv");
    let found = InspectedFile::of(&read(&path).unwrap(), &path, None).unwrap();
    let columns = &found.columns;
    use ColumnKind::{Integer, Number, Text};
    let kinds = Vec::from_iter(columns.iter().map(|column| column.kind));
    assert_eq!(kinds, [Integer, Number, Integer, Integer, Integer, Text]);
    assert_eq!(
        (columns[1].missing, columns[1].min, columns[1].max),
        (1, Some(1.5), Some(4.0))
    );
    assert_eq!(columns[1].histogram.iter().sum::<usize>(), 4);
    assert!(columns[3].is_constant && !columns[2].is_constant);
    assert_eq!(columns[4].duplicate_of.as_deref(), Some("b"));
    assert_eq!(columns[5].first_text, Some((2, "x".to_owned())));
    let time = found.time.unwrap();
    assert_eq!(
        (time.column.as_str(), time.median_interval, time.gaps),
        ("time", Some(1.0), 1)
    );
    assert_eq!((time.longest, time.longest_after_line), (Some(27.0), Some(5)));
}

#[test]
fn derived_columns_are_differences_and_ratios_also_with_the_start_of_the_file() {
    let text = "t (ms),a (V),b (V),f\n0,2,1,1\n1000,4,0,2\n2000,9,3,3\n3000,6,2,4\n";
    let folder = folder(&[("data.csv", text)]);
    let derive = ["d=a-b", "q=a/b", "r=a/start(1s)", "p=a-start(3)"];
    let recipe = Recipe {
        derive: derive.iter().map(|text| text.parse().unwrap()).collect(),
        time: Some("t".to_owned()),
        ..recipe("d q r p", "f")
    };
    let recording = import(&recipe, folder.path()).unwrap();
    // The row with b = 0 has no quotient.
    let expected = [
        [1.0, 6.0, 4.0],
        [2.0, 3.0, 3.0],
        [2.0 / 3.0, 3.0, 2.0],
        [-3.0, 4.0, 1.0],
    ];
    assert_eq!([0, 1, 2, 3].map(|column| reading(&recording, column)), expected);
    let problem = &recording.problem;
    assert_eq!(
        [0, 1].map(|input| problem.inputs[input].unit.as_deref()),
        [Some("V"), None]
    );
    let inputs = Recipe {
        derive: recipe.derive[..1].to_vec(),
        ..recipe.clone()
    };
    let one = Problem {
        inputs: problem.inputs[..1].to_vec(),
        ..problem.clone()
    };
    let found = inputs
        .read_inputs(&folder.path().join("data.csv"), &one, false, &mut go_on)
        .unwrap();
    assert_eq!(found.readings.column(0).to_vec(), [1.0, 4.0, 6.0, 4.0]);
    let without_time = Recipe { time: None, ..recipe };
    refused(&without_time, folder.path(), "r=a / start(1s)");
    refused(&without_time, folder.path(), "time column");
}

#[test]
fn every_column_may_be_named_by_its_whole_header() {
    let folder = folder(&[
        (
            "data.csv",
            "t (ms),x (V),press (id),y (N)\n0,1,a,1\n1000,2,a,-1\n2000,3,b,3\n3000,5,b,4\n",
        ),
        ("more.csv", "when (ms),z (mm)\n0,10\n1000,20\n2000,30\n3000,40\n"),
    ]);
    let mut wanted = Recipe {
        group: Some("press (id)".to_owned()),
        time: Some("t (ms)".to_owned()),
        missing: vec!["y (N)=-1".parse().unwrap(), "more.z (mm)=40".parse().unwrap()],
        derive: vec!["d=x (V) / start(1.5s)".parse().unwrap()],
        conditions: vec!["x (V)<5".parse().unwrap()],
        units: [("t".to_owned(), "ms".to_owned())].into(),
        join: vec![joined("more.csv")],
        inputs: vec!["x (V)".to_owned(), "d".to_owned(), "more.z (mm)".to_owned()],
        ..recipe("", "y")
    };
    wanted.join[0].time = Some("when (ms)".to_owned());
    let recording = import(&wanted, folder.path()).unwrap();
    assert_eq!(
        (recording.set.groups(), target(&recording, 0)),
        (&[0, 1][..], vec![1.0, 3.0])
    );
    assert_eq!(
        [1, 2].map(|column| reading(&recording, column)),
        [[1.0 / 1.5, 2.0], [10.0, 30.0]]
    );
}

#[test]
fn time_stamps_that_are_not_understood_say_which_are() {
    let understood = "is not a time stamp such as 2026-11-24T12:00:00.5+01:00 or 2026-11-24 12:00";
    for (cells, expected) in [
        ("24.11.2026 12:00:00", understood),
        ("2026-11-24", understood),
        ("11/24/2026", understood),
        ("2026-11-24 12:00\n2026-11-24 25:00", understood),
        ("2026-11-24 12:00\nsoon", understood),
        (
            "2026-11-24 12:00Z\n2026-11-24 12:00",
            "has no time zone, and the first time stamp of the column has one",
        ),
        (
            "2026-11-24 12:00\n2026-11-24 12:00Z",
            "has a time zone, and the first time stamp of the column has none",
        ),
        ("5\n2026-11-24 12:00", "is a time stamp after numbers"),
        ("1.2.3", "is not a finite number"),
    ] {
        let rows = cells.replace('\n', ",1,2\n");
        let folder = folder(&[("data.csv", &format!("when,x,y\n{rows},1,2\n"))]);
        let mut wanted = recipe("x", "y");
        wanted.time = Some("when".to_owned());
        let last = cells.lines().last().unwrap();
        refused(&wanted, folder.path(), &format!("'{last}' {expected}; "));
    }
}

#[test]
fn a_time_zone_in_the_header_is_no_unit() {
    let stamps = |unit: &str| format!("time ({unit}),x,y\n2026-11-24 12:00:00,1,2\n2026-11-24 12:00:00.5,3,4\n");
    let numbers = "time (UTC),x,y\n100,1,2\n100.5,3,4\n".to_owned();
    for text in [stamps("UTC"), stamps("ms"), stamps("yyyy-mm-dd hh:mm:ss"), numbers] {
        let folder = folder(&[("data.csv", &text)]);
        let mut wanted = recipe("x", "y");
        wanted.time = Some("time".to_owned());
        wanted.memory = Some(Memory {
            averages: vec![Span::Seconds(2.0)],
            ..Memory::default()
        });
        let recording = import(&wanted, folder.path()).unwrap();
        let times = recording.history.times_s().unwrap();
        assert_eq!(times[1] - times[0], 0.5, "{text}");
    }
}

#[test]
fn only_rows_that_are_used_have_markers_of_missing_values() {
    let row = |row: u32| match row {
        0..10 => format!("{row},-1,0\n"),
        _ => format!("{row},{},1\n", 3.5 + 0.37 * f64::from(row)),
    };
    let rows: String = (0..60).map(row).collect();
    let folder = folder(&[("data.csv", &format!("x,y,ok\n{rows}"))]);
    let mut wanted = recipe("x", "y");
    for (conditions, is_warned) in [(Vec::new(), true), (vec!["ok==1".parse().unwrap()], false)] {
        wanted.conditions = conditions;
        let warnings = import(&wanted, folder.path()).unwrap().warnings.join("\n");
        assert_eq!(warnings.contains("mark it as missing"), is_warned, "{warnings}");
    }
}

#[test]
fn training_rows_are_refused_as_test_rows() {
    let rows: String = (0..40).map(|row| format!("{row},{}\n", 2 * row)).collect();
    let text = format!("u,x\n{rows}");
    let folder = folder(&[("data.csv", &text), ("test.csv", &text)]);
    fs::create_dir(folder.path().join("sub")).unwrap();
    let tested = |data: &str| {
        let plan = Plan {
            import: recipe("u", "x"),
            test: Some(FileSet {
                data: data.into(),
                ..FileSet::default()
            }),
            ..Plan::default()
        };
        let recordings = plan.recordings(folder.path(), &mut go_on);
        let (recording, test) = recordings.map_err(|error| error.to_string())?;
        Ok::<_, String>(plan.divide(&recording, test.as_ref(), Seed(0)).unwrap().1.samples())
    };
    assert_eq!(tested("test.csv"), Ok(40));
    for same in words("data.csv sub/../data.csv") {
        let reason = tested(&same).unwrap_err();
        assert!(
            reason.contains("is trained on, so it cannot be a test file"),
            "{reason}"
        );
    }
}

/// A folder with data.csv: a reading that counts the rows, and a target of which every fifth is missing. Times are in
/// milliseconds, with a gap after half of the rows.
fn counting() -> tempfile::TempDir {
    let row = |row: usize| {
        let time = 20 * row + if row >= 20 { 1000 } else { 0 };
        let target = if row % 5 == 4 {
            String::new()
        } else {
            (3 * row).to_string()
        };
        format!("{time},{row},{},{target}\n", usize::from(row >= 10))
    };
    let rows: String = (0..40).map(row).collect();
    folder(&[("data.csv", &format!("t (ms),u (V),group,y\n{rows}"))])
}

fn remembering(lags: &[Span], averages: &[Span]) -> Recipe {
    Recipe {
        time: Some("t".to_owned()),
        memory: Some(Memory {
            lags: lags.to_vec(),
            averages: averages.to_vec(),
            ..Memory::default()
        }),
        ..recipe("u", "y")
    }
}

#[test]
fn features_come_from_all_readings_and_start_again_after_a_gap() {
    let folder = counting();
    let wanted = remembering(&[Span::Samples(1.0), Span::Seconds(0.04)], &[Span::Seconds(0.1)]);
    let recording = import(&wanted, folder.path()).unwrap();
    let problem = &recording.problem;
    let titles = Vec::from_iter(problem.features().iter().map(|channel| channel.title()));
    assert_eq!(titles, ["u (V)", "u[-1] (V)", "u[-0.04s] (V)", "u~0.1s (V)"]);
    assert_eq!((problem.inputs.len(), problem.feature_count()), (1, 4));
    assert!((problem.memory.as_ref().unwrap().interval_s.unwrap() - 0.02).abs() < 1e-12);
    // The rows without a target are no samples, but they are in the past of those after them.
    assert_eq!(recording.set.samples(), 32);
    let weight = 1.0 - f64::exp(-0.2);
    let mut average = 0.0;
    for row in 0..40_usize {
        let (reading, first) = (row as f64, if row < 20 { 0 } else { 20 });
        average += if row == first {
            reading - average
        } else {
            weight * (reading - average)
        };
        let before = |lag: usize| row.saturating_sub(lag).max(first) as f64;
        let Some(sample) = (0..32).find(|&sample| recording.set.targets()[[sample, 0]] == 3.0 * reading) else {
            assert_eq!(row % 5, 4);
            continue;
        };
        let found = recording.set.sample_readings(sample);
        assert_eq!(found[..3], [reading, before(1), before(2)], "row {row}");
        assert!((found[3] - average).abs() < 1e-12, "row {row}: {found:?}");
    }
    let plain = recording.with_memory(None).unwrap();
    let without = Recipe {
        memory: None,
        ..wanted.clone()
    };
    assert_eq!(plain.set, import(&without, folder.path()).unwrap().set);
    assert_eq!(plain.with_memory(wanted.memory.as_ref()).unwrap().set, recording.set);
    // Row 10 is the first of its group, row 11 the second.
    let mut of_groups = remembering(&[Span::Samples(3.0)], &[]);
    of_groups.group = Some("group".to_owned());
    let recording = import(&of_groups, folder.path()).unwrap();
    for expected in [[8.0, 5.0], [10.0, 10.0], [11.0, 10.0], [13.0, 10.0]] {
        assert!(
            recording
                .set
                .readings()
                .rows()
                .into_iter()
                .any(|row| row.to_vec() == expected)
        );
    }
}

#[test]
fn the_state_continues_into_the_test_samples_and_test_files_have_the_intervals_of_training() {
    let folder = counting();
    let mut plan = Plan {
        import: remembering(&[Span::Seconds(0.04)], &[]),
        ..Plan::default()
    };
    let tested = |plan: &Plan| {
        let (recording, test) = plan.recordings(folder.path(), &mut go_on).unwrap();
        plan.divide(&recording, test.as_ref(), Seed(0)).unwrap().1
    };
    let test = tested(&plan);
    let first = test.sample_readings(0);
    assert_eq!(first[1], first[0] - 2.0);
    // Twice as slow: a lag of 0.04 s would be one sample of this file.
    let slow: String = (0..10).map(|row| format!("{},{row},0,1\n", 40 * row)).collect();
    fs::write(folder.path().join("slow.csv"), format!("t (ms),u (V),group,y\n{slow}")).unwrap();
    plan.test = Some(FileSet {
        data: "slow.csv".into(),
        ..FileSet::default()
    });
    assert_eq!(tested(&plan).sample_readings(5), [5.0, 3.0]);
}

#[test]
fn a_memory_in_seconds_needs_times_in_a_unit_of_time() {
    let folder = counting();
    for (time, unit, cause) in [
        (None, "ms", "name the time column"),
        (Some("t"), "V", "times in 't' are in V"),
    ] {
        let mut wanted = remembering(&[], &[Span::Seconds(2.0)]);
        wanted.time = time.map(str::to_owned);
        wanted.units.insert("t".to_owned(), unit.to_owned());
        refused(&wanted, folder.path(), cause);
    }
    let mut without = remembering(&[], &[Span::Samples(20.0)]);
    without.time = None;
    assert_eq!(import(&without, folder.path()).unwrap().set.channels(), 2);
}
