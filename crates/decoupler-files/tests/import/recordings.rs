//! Files of recordings become samples: values are read exactly, and omitted rows are reported.

use std::{fs, ops::ControlFlow, path::Path};

use decoupler_core::dataset::{Memory, Span};
use decoupler_files::import::{
    ColumnKind, Decimal, DialectChoice, Encoding, InspectedFile, Joined, Progress, Recipe, Recording, Separator, Table,
    read_table,
};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use tempfile::TempDir;

fn go_on(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn read(path: &Path) -> Result<Table, String> {
    read_table(path, DialectChoice::default(), &mut go_on).map_err(|error| error.to_string())
}

fn numbers(table: &Table) -> Vec<Vec<f64>> {
    table.columns.iter().map(|column| column.numbers.clone()).collect()
}

fn names(table: &Table) -> Vec<&str> {
    table.columns.iter().map(|column| column.name.as_str()).collect()
}

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

fn recipe(inputs: &str, targets: &str) -> Recipe {
    Recipe {
        data: "data.csv".into(),
        inputs: words(inputs),
        targets: words(targets),
        ..Recipe::default()
    }
}

fn import(recipe: &Recipe, folder: &TempDir) -> Result<Recording, String> {
    recipe
        .import(folder.path(), &mut go_on)
        .map_err(|error| error.to_string())
}

#[test]
fn every_column_has_its_own_name() {
    let folder = folder(&[("data.csv", "a,a,a#2,a,b,\n1,2,3,4,5,6\n1,2,3,4,5,7\n")]);
    let table = read(&folder.path().join("data.csv")).unwrap();
    assert_eq!(names(&table), ["a", "a#3", "a#2", "a#4", "b", "c6"]);
}

#[test]
fn every_layout_of_one_table_gives_the_same_numbers() {
    let latin1 = "x (\u{b5}m);y\n1,5;-2\n3;4e-1\n"
        .chars()
        .map(|letter| letter as u8)
        .collect::<Vec<u8>>();
    let utf16 = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    let layouts: Vec<Vec<u8>> = vec![
        b"x (\xc2\xb5m),y\n1.5,-2\n3,4e-1\n".to_vec(),
        b"\xef\xbb\xbfx (\xc2\xb5m),y\r\n1.5,-2\r\n3,4e-1".to_vec(),
        latin1,
        utf16("\u{feff}x (µm)\ty\r\n1,5\t-2\r\n3\t4e-1\r\n"),
        b"sep=;\r\nx [\xc2\xb5m];y;\r\n1,5;-2;\r\n3;0,4;\r\n".to_vec(),
        b"\"x (\xc2\xb5m)\"|\"y\"\n\"1.5\"|-2\n\n3|0.4\n".to_vec(),
        b"x(\xc2\xb5m) y\n  1.5   -2\n  3.0  0.4\n".to_vec(),
        b"x (\xc2\xb5m),y\r1.5,-2\r3,0.4\r".to_vec(),
    ];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data.csv");
    for bytes in layouts {
        fs::write(&path, &bytes).unwrap();
        let table = read(&path).unwrap();
        let layout = String::from_utf8_lossy(&bytes);
        assert_eq!(names(&table), ["x", "y"], "{layout}");
        assert_eq!(table.columns[0].unit.as_deref(), Some("µm"), "{layout}");
        assert_eq!(numbers(&table), [[1.5, 3.0], [-2.0, 0.4]], "{layout}");
    }
}

#[test]
fn the_layout_given_by_the_user_is_used() {
    let folder = folder(&[("data.csv", "note; of 2\n1,5\n2,5\n")]);
    let path = folder.path().join("data.csv");
    let choice = DialectChoice {
        separator: Some(Separator::Semicolon),
        decimal: Some(Decimal::Comma),
        header: Some(false),
        skip_lines: Some(1),
        encoding: Some(Encoding::Latin1),
    };
    let table = read_table(&path, choice, &mut go_on).unwrap();
    assert_eq!((names(&table), numbers(&table)), (vec!["c1"], vec![vec![1.5, 2.5]]));
    assert_eq!(table.line(1), 3);
}

#[test]
fn numbers_are_read_to_the_last_bit() {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let expected: Vec<f64> = (0..2000)
        .map(|_| f64::from_bits(rng.random()))
        .filter(|number: &f64| number.is_finite())
        .collect();
    let text: String = expected.iter().map(|number| format!("{number:e},0\n")).collect();
    let folder = folder(&[("data.csv", &text)]);
    let found = numbers(&read(&folder.path().join("data.csv")).unwrap());
    assert!(
        found[0]
            .iter()
            .zip(&expected)
            .all(|(one, other)| one.to_bits() == other.to_bits())
    );
    assert_eq!(found[0].len(), expected.len());
}

#[test]
fn arrays_of_numpy_and_matlab_are_read_as_saved() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/import");
    let read = |name: &str| read(&fixtures.join(name));
    let expected: Vec<Vec<f64>> = (0..3)
        .map(|column| (0..5).map(|row| f64::from(row) + f64::from(column) / 4.0).collect())
        .collect();
    for name in ["f8.npy", "f4_columns_big.npy"] {
        let table = read(name).unwrap();
        assert_eq!(
            (names(&table), numbers(&table)),
            (vec!["c1", "c2", "c3"], expected.clone()),
            "{name}"
        );
    }
    assert_eq!(numbers(&read("i2.npy").unwrap()), [[-2.0, -1.0, 0.0, 1.0, 2.0]]);
    for name in ["plain.npz", "deflated.npz", "plain.mat", "deflated.mat"] {
        let table = read(name).unwrap();
        let found =
            |wanted: &str| numbers(&table)[names(&table).iter().position(|name| *name == wanted).unwrap()].clone();
        for (column, expected) in expected.iter().enumerate() {
            assert_eq!(&found(&format!("x.c{}", column + 1)), expected, "{name}");
        }
        assert_eq!(found("t"), [0.0, 1.0, 2.0, 3.0, 4.0], "{name}");
    }
    for (name, left_out) in [
        ("plain.npz", "rate is one number"),
        ("plain.mat", "who is text"),
        ("plain.mat", "s.a is 1 × 1"),
    ] {
        let notes = read(name).unwrap().notes;
        assert!(notes.iter().any(|note| note.contains(left_out)), "{name}: {notes:?}");
    }
    assert!(read("complex.npy").unwrap_err().contains("'<c16' is not supported"));
    assert!(read("level4.mat").unwrap_err().contains("-v7"));
}

#[test]
fn variables_of_a_workspace_are_chosen_by_their_columns() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/import/workspace.mat");
    let table = read(&path).unwrap();
    assert_eq!(table.rows, 12, "{:?}", table.notes);
    let all = names(&table);
    let column = |name: &str| numbers(&table)[all.iter().position(|other| *other == name).expect(name)].clone();
    let each = |of: fn(f64) -> f64| Vec::from_iter((0..12).map(|press| of(f64::from(press))));
    assert_eq!(column("positions.c2"), each(|press| 0.5 * press));
    // Two rows per press, side by side: the columns of the first row, then those of the second.
    assert_eq!(column("pairs.c2"), each(|press| 100.0 * press));
    assert_eq!(column("pairs.c3"), each(|press| 10.0 * press + 1.0));
    // In the order of MATLAB: the second dimension varies fastest.
    assert_eq!(column("cube.c4"), each(|press| 100.0 * press + 10.0 + 1.0));
    assert_eq!(column("log.force"), each(|press| 0.25 * press));
    assert_eq!(column("log.nested.z"), each(|press| press));
    assert_eq!(column("records.xy.c2"), each(|press| 2.0 * press));
    for note in [
        "log.label is text",
        "calibration is 5 × 1",
        "cube is 12 × 2 × 3, read as 12 × 6",
        "2 rows per sample",
    ] {
        assert!(
            table.notes.iter().any(|found| found.contains(note)),
            "{note}: {:?}",
            table.notes
        );
    }
    // The named columns determine the rows: each of a pair is a sample of its own.
    let recipe = Recipe {
        data: path.clone(),
        inputs: vec!["pairs.c1".to_owned()],
        targets: vec!["pairs.c2".to_owned()],
        ..Recipe::default()
    };
    let set = recipe
        .import(Path::new(""), &mut |_| ControlFlow::Continue(()))
        .unwrap()
        .set;
    assert_eq!(set.samples(), 24);
}

#[test]
fn sheets_are_read_like_the_text_they_are_saved_as() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/import");
    for name in ["press.xlsx", "press.ods"] {
        let table = read(&fixtures.join(name)).unwrap();
        assert_eq!(names(&table), ["time", "r1", "force", "note"], "{name}");
        assert_eq!(table.columns[1].unit.as_deref(), Some("kOhm"), "{name}");
        let force = &numbers(&table)[2];
        // Programs write 15 or 17 digits.
        let is_force = |(row, found): (usize, &f64)| (found - 0.1 * row as f64).abs() < 1e-14;
        assert!(
            force.len() == 20 && force.iter().enumerate().all(is_force),
            "{name}: {force:?}"
        );
        assert_eq!(table.line(0), 2, "{name}");
        assert_eq!(table.format.to_string(), "sheet 'Data'");
        let is_left_out = table.notes.iter().any(|note| note.contains("sheet 'About' is 1 × 1"));
        assert_eq!(is_left_out, name == "press.xlsx", "{:?}", table.notes);
    }
    let table = read(&fixtures.join("stamps.xlsx")).unwrap();
    let seconds = Vec::from_iter((0..12).map(|row| 0.25 * f64::from(row)));
    assert_eq!(numbers(&table)[0], seconds);
}

#[test]
fn time_stamps_are_seconds_since_the_first_and_join_files_by_moment() {
    let folder = folder(&[
        (
            "sensor.csv",
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
    let table = read(&folder.path().join("sensor.csv")).unwrap();
    assert_eq!(numbers(&table), [[0.0, 0.5, 1.0], [1.0, 2.0, 3.0]]);
    assert_eq!(table.columns[0].unit.as_deref(), Some("s"));
    let recipe = Recipe {
        data: "sensor.csv".into(),
        join: vec![Joined {
            file: "states.csv".into(),
            time: Some("when".to_owned()),
            limit: Some(0.1),
            ..Joined::default()
        }],
        inputs: vec!["c2".to_owned()],
        targets: vec!["states.force".to_owned()],
        time: Some("c1".to_owned()),
        ..Recipe::default()
    };
    let recording = import(&recipe, &folder).unwrap();
    assert_eq!(recording.set.readings().column(0).to_vec(), [2.0, 3.0]);
    assert_eq!(recording.set.targets().column(0).to_vec(), [20.0, 30.0]);
    let mixed = read(&folder.path().join("mixed.csv")).unwrap();
    assert_eq!(mixed.columns[0].faults.count, 1, "a time zone is not guessed");
}

#[test]
fn files_of_other_kinds_are_refused_by_name() {
    for (start, expected) in [
        (
            &b"\x89HDF\r\n\x1a\n\0\0\0\0\0\0\0\0"[..],
            "an HDF5 file, which is not read; save it as .npz",
        ),
        (b"PAR1\x15\x04\x15", "a Parquet file"),
        (b"\x89PNG\r\n\x1a\n", "a PNG image"),
        (b"\x80\x04\x95\x10", "a Python pickle"),
        (
            b"\x1f\x8b\x08\x00",
            "compressed with gzip, which is not read; unpack it",
        ),
        (b"%PDF-1.7", "a PDF document"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("data.csv");
        std::fs::write(&path, start).unwrap();
        let error = read(&path).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn cells_that_are_not_numbers_are_named_and_never_guessed() {
    let folder = folder(&[("data.csv", "t,x,y\n0,1,2\n1,1.2.3,2\n2,,2\n3,1,n/a\n4,5,6\n")]);
    let error = import(&recipe("x", "t"), &folder).unwrap_err();
    assert!(
        error.contains("line 3, column 2 ('x'): '1.2.3' is not a finite number"),
        "{error}"
    );
    // A column that is not used does not matter.
    let mut wanted = recipe("y", "t");
    let error = import(&wanted, &folder).unwrap_err();
    assert!(error.contains("line 5, column 3 ('y'): 'n/a'"), "{error}");
    wanted.missing = vec!["n/a".parse().unwrap()];
    let recording = import(&wanted, &folder).unwrap();
    assert_eq!((recording.set.samples(), recording.rows), (4, 5));
    assert_eq!(
        (
            recording.dropped[0].reason.as_str(),
            recording.dropped[0].rows,
            recording.dropped[0].first_line
        ),
        ("y is missing", 1, 5)
    );
}

#[test]
fn a_number_can_mean_missing_in_one_column_only() {
    let folder = folder(&[("data.csv", "a,b\n-1,1\n2,-1.0\n3,3\n")]);
    let mut wanted = recipe("a", "b");
    wanted.missing = vec!["b=-1".parse().unwrap()];
    let recording = import(&wanted, &folder).unwrap();
    assert_eq!(recording.set.readings().column(0).to_vec(), [-1.0, 3.0]);
    wanted.missing = vec!["-1".parse().unwrap()];
    assert_eq!(
        import(&wanted, &folder).unwrap().set.readings().column(0).to_vec(),
        [3.0]
    );
    wanted.missing = vec!["d=-1".parse().unwrap()];
    assert!(
        import(&wanted, &folder)
            .unwrap_err()
            .contains("there is no column 'd'; there are a, b")
    );
}

#[test]
fn rows_of_different_lengths_are_counted() {
    let folder = folder(&[("data.csv", "1,2,3\n1,2,3\n4,5\n6,7,8,9\n1,2,3,\n1,2,3\n")]);
    let recording = import(&recipe("c1 c2", "c3"), &folder).unwrap();
    assert_eq!((recording.set.samples(), recording.rows), (4, 6));
    let dropped: Vec<(&str, usize, u64)> = recording
        .dropped
        .iter()
        .map(|dropped| (dropped.reason.as_str(), dropped.rows, dropped.first_line))
        .collect();
    assert_eq!(
        dropped,
        [("more cells than the 3 columns", 1, 4), ("c3 is missing", 1, 3)]
    );
    assert_eq!(recording.warnings.len(), 2, "{:?}", recording.warnings);
    // The existing cells can be used.
    assert_eq!(import(&recipe("c1", "c2"), &folder).unwrap().set.samples(), 5);
}

#[test]
fn two_recordings_are_joined_by_the_nearest_time() {
    let folder = folder(&[
        ("data.csv", "0.0,10\n1.0,11\n2.0,12\n3.0,13\n9.0,19\n"),
        ("states.csv", "2.1,102,7\n0.2,100,9\n1.1,101,8\n3.4,103,5\n"),
    ]);
    let mut wanted = recipe("c2", "states.c2");
    wanted.join = vec![Joined {
        file: "states.csv".into(),
        ..Joined::default()
    }];
    wanted.time = Some("c1".into());
    wanted.conditions = vec!["states.c3>5".parse().unwrap()];
    let recording = import(&wanted, &folder).unwrap();
    // The median interval of the states is 1.0, so the limit is 0.5; the last row has no partner.
    assert_eq!(recording.set.readings().column(0).to_vec(), [10.0, 11.0, 12.0]);
    assert_eq!(recording.set.targets().column(0).to_vec(), [100.0, 101.0, 102.0]);
    assert_eq!(recording.times.unwrap(), [0.0, 1.0, 2.0]);
    let join = recording.files[1].join.unwrap();
    assert_eq!((join.without_partner, join.unused), (1, 0));
    assert!((join.limit - 0.5).abs() < 1e-9, "{}", join.limit);
    let reasons: Vec<&str> = recording
        .dropped
        .iter()
        .map(|dropped| dropped.reason.as_str())
        .collect();
    assert_eq!(reasons[0], "states.c3>5 is not met");
    let states = folder.path().join("states.csv");
    assert!(
        reasons[1].starts_with(&format!("no row of '{}' within 0.5", states.display())),
        "{reasons:?}"
    );
    // Without times, rows are joined in order if their numbers are equal.
    wanted.time = None;
    let error = import(&wanted, &folder).unwrap_err();
    assert!(error.contains("it has 4 rows and the other file 5"), "{error}");
}

#[test]
fn samples_are_in_the_order_of_their_times() {
    let folder = folder(&[("data.csv", "t,x,y\n3,30,1\n1,10,1\n2,20,1\n")]);
    let mut wanted = recipe("x", "y");
    wanted.time = Some("t".into());
    let recording = import(&wanted, &folder).unwrap();
    assert_eq!(recording.set.readings().column(0).to_vec(), [10.0, 20.0, 30.0]);
    assert!(
        recording.warnings[0].contains("backwards 1 time, first on line 3"),
        "{:?}",
        recording.warnings
    );
}

#[test]
fn columns_have_names_ranges_units_and_one_meaning() {
    let folder = folder(&[(
        "data.csv",
        "row,press,x (mm),y,z [N]\n1,a,1,2,3\n2,a,4,5,6\n1,b,7,8,9\n",
    )]);
    let mut wanted = recipe("x..y", "z");
    wanted.group = Some("press".into());
    wanted.row_wire = Some("row".into());
    wanted.units = [("y".to_owned(), "V".to_owned())].into();
    let recording = import(&wanted, &folder).unwrap();
    let titles = |channels: &[decoupler_core::problem::Channel]| {
        channels.iter().map(|channel| channel.title()).collect::<Vec<_>>()
    };
    assert_eq!(titles(&recording.problem.inputs), ["x (mm)", "y (V)"]);
    assert_eq!(titles(&recording.problem.targets), ["z (N)"]);
    assert_eq!(recording.set.groups(), [0, 0, 1]);
    assert_eq!(
        (recording.set.row_wire(1), recording.set.row_wire(2)),
        (Some(1), Some(0))
    );
    for (inputs, targets, cause) in [
        ("x", "zz", "no column 'zz'; there are row, press, x, y, z"),
        ("x y", "y", "'y' is both an input and a target"),
        ("y..x", "z", "'y..x' is not a range"),
        ("", "z", "no column is an input"),
    ] {
        let error = import(&recipe(inputs, targets), &folder).unwrap_err();
        assert!(error.contains(cause), "{error}");
    }
    wanted.conditions = vec!["press<2".parse().unwrap()];
    let error = import(&wanted, &folder).unwrap_err();
    assert!(error.contains("the label 'a' is not a number"), "{error}");
}

#[test]
fn having_no_rows_left_is_an_error_with_counted_reasons() {
    let folder = folder(&[("data.csv", "1,2\n3,\n")]);
    let mut wanted = recipe("c1", "c2");
    wanted.conditions = vec!["c1>2".parse().unwrap()];
    let error = import(&wanted, &folder).unwrap_err();
    assert!(
        error.contains("no row of 2 is left: 1: c1>2 is not met; 1: c2 is missing"),
        "{error}"
    );
}

#[test]
fn reading_can_be_cancelled() {
    let folder = folder(&[("data.csv", &"1,2\n".repeat(1_000_000))]);
    let mut reports = 0;
    let cancelled = read_table(
        &folder.path().join("data.csv"),
        DialectChoice::default(),
        &mut |progress| {
            reports += 1;
            assert_eq!(progress.of, Some(4_000_000));
            if progress.bytes > 2_000_000 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        },
    );
    assert_eq!(cancelled.unwrap_err().to_string(), "the import was cancelled");
    assert!((2..=4).contains(&reports), "{reports}");
}

#[test]
fn an_inspection_describes_each_column() {
    let folder = folder(&[(
        "data.csv",
        "time (s),a,b,c,d,e\n0,1.5,1,7,1,x\n1,,2,7,2,y\n2,2.5,3,7,3,z\n3,3,4,7,4,\n30,4,5,7,5,w\n",
    )]);
    let path = folder.path().join("data.csv");
    let found = InspectedFile::of(&read(&path).unwrap(), &path, None).unwrap();
    let kinds: Vec<ColumnKind> = found.columns.iter().map(|column| column.kind).collect();
    use ColumnKind::{Integer, Number, Text};
    assert_eq!(kinds, [Integer, Number, Integer, Integer, Integer, Text]);
    assert_eq!(
        (found.columns[1].missing, found.columns[1].min, found.columns[1].max),
        (1, Some(1.5), Some(4.0))
    );
    assert_eq!(found.columns[1].histogram.iter().sum::<usize>(), 4);
    assert!(found.columns[3].is_constant && !found.columns[2].is_constant);
    assert_eq!(found.columns[4].duplicate_of.as_deref(), Some("b"));
    assert_eq!(found.columns[5].first_text, Some((2, "x".to_owned())));
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
    let recording = import(&recipe, &folder).unwrap();
    let readings = &recording.set.readings();
    // The row with b = 0 has no quotient.
    assert_eq!(readings.column(0).to_vec(), [1.0, 6.0, 4.0]);
    assert_eq!(readings.column(1).to_vec(), [2.0, 3.0, 3.0]);
    assert_eq!(readings.column(2).to_vec(), [2.0 / 3.0, 3.0, 2.0]);
    assert_eq!(readings.column(3).to_vec(), [-3.0, 4.0, 1.0]);
    assert_eq!(recording.problem.inputs[0].unit.as_deref(), Some("V"));
    assert_eq!(recording.problem.inputs[1].unit, None);
    let problem = &recording.problem;
    let path = folder.path().join("data.csv");
    let inputs = Recipe {
        derive: recipe.derive[..1].to_vec(),
        ..recipe.clone()
    };
    let one = decoupler_core::problem::Problem {
        inputs: problem.inputs[..1].to_vec(),
        ..problem.clone()
    };
    let found = inputs
        .read_inputs(&path, &one, false, &mut |_| ControlFlow::Continue(()))
        .unwrap();
    assert_eq!(found.readings.column(0).to_vec(), [1.0, 4.0, 6.0, 4.0]);
    let without_time = Recipe { time: None, ..recipe };
    let error = import(&without_time, &folder).unwrap_err();
    assert!(
        error.contains("r=a / start(1s)") && error.contains("time column"),
        "{error}"
    );
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
    let wanted = Recipe {
        group: Some("press (id)".to_owned()),
        time: Some("t (ms)".to_owned()),
        missing: vec!["y (N)=-1".parse().unwrap(), "more.z (mm)=40".parse().unwrap()],
        derive: vec!["d=x (V) / start(1.5s)".parse().unwrap()],
        conditions: vec!["x (V)<5".parse().unwrap()],
        units: [("t".to_owned(), "ms".to_owned())].into(),
        join: vec![Joined {
            file: "more.csv".into(),
            time: Some("when (ms)".to_owned()),
            ..Joined::default()
        }],
        inputs: vec!["x (V)".to_owned(), "d".to_owned(), "more.z (mm)".to_owned()],
        ..recipe("", "y")
    };
    let recording = import(&wanted, &folder).unwrap();
    assert_eq!(recording.set.groups(), [0, 1]);
    assert_eq!(recording.set.targets().column(0).to_vec(), [1.0, 3.0]);
    assert_eq!(recording.set.readings().column(1).to_vec(), [1.0 / 1.5, 2.0]);
    assert_eq!(recording.set.readings().column(2).to_vec(), [10.0, 30.0]);
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
        let error = import(&wanted, &folder).unwrap_err();
        let last = cells.lines().last().unwrap();
        assert!(error.contains(&format!("'{last}' {expected}; ")), "{cells}: {error}");
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
        let recording = import(&wanted, &folder).unwrap();
        assert_eq!(
            recording.history.times_s().map(|times| times[1] - times[0]),
            Some(0.5),
            "{text}"
        );
    }
}

#[test]
fn only_rows_that_are_used_have_markers_of_missing_values() {
    let mut text = "x,y,ok\n".to_owned();
    for row in 0..60 {
        let y = if row < 10 {
            "-1".to_owned()
        } else {
            format!("{}", 3.5 + 0.37 * f64::from(row))
        };
        text += &format!("{row},{y},{}\n", u8::from(row >= 10));
    }
    let folder = folder(&[("data.csv", &text)]);
    let mut wanted = recipe("x", "y");
    let warned = |wanted: &Recipe| {
        import(wanted, &folder)
            .unwrap()
            .warnings
            .join("\n")
            .contains("mark it as missing")
    };
    assert!(warned(&wanted));
    wanted.conditions = vec!["ok==1".parse().unwrap()];
    assert!(!warned(&wanted));
}
