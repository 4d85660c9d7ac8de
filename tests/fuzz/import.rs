use std::{collections::BTreeSet, fmt::Write, fs, ops::ControlFlow, path::Path};

use decoupler_core::problem::TargetPosition;
use decoupler_files::{
    import::{
        DialectChoice, Format, InspectedFile, Recipe, Separator, Table, holds_positions, read_table, suggested_plan,
    },
    machine::limit_memory,
};

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
};

/// Memory for reading a file, in GB.
const MEMORY_GB: f64 = 0.25;

/// Reads `bytes` as a file with the extension of `path`, checks its columns, and makes samples of the first two, and of those
/// of the suggested plan.
pub(crate) fn check(bytes: &[u8], path: &Path) {
    limit_memory(MEMORY_GB);
    fs::write(path, bytes).unwrap();
    let mut watch = |_| ControlFlow::Continue(());
    let table = match read_table(path, DialectChoice::default(), &mut watch) {
        Ok(table) => table,
        Err(error) => {
            let message = error.to_string();
            assert!(message.len() < 2000 && !message.contains('\n'), "{message}");
            return;
        }
    };
    // A false header does not allocate memory.
    assert!(table.rows <= 1100 * bytes.len().max(1));
    for column in &table.columns {
        assert_eq!(column.numbers.len(), table.rows);
        let gaps = column.numbers.iter().filter(|number| number.is_nan()).count();
        assert_eq!(gaps, column.missing + column.faults.count);
        assert!(column.numbers.iter().all(|number| !number.is_infinite()));
    }
    let names = BTreeSet::from_iter(table.columns.iter().map(|column| &column.name));
    assert_eq!(names.len(), table.columns.len(), "each column has its own name");
    if !matches!(table.format, Format::Text(_)) {
        same_as_text(&table, path);
    }
    let inspection = InspectedFile::of(&table, path, None).unwrap();
    for column in &inspection.columns {
        let bars = column.histogram.iter().sum::<usize>();
        assert!(bars == 0 || bars == table.rows - column.missing - column.texts);
    }
    let recipe = Recipe {
        data: path.to_owned(),
        inputs: table.columns.iter().take(1).map(|column| column.name.clone()).collect(),
        targets: table
            .columns
            .iter()
            .skip(1)
            .take(1)
            .map(|column| column.name.clone())
            .collect(),
        ..Recipe::default()
    };
    check_samples(&recipe);
    let plain = Recipe {
        data: path.to_owned(),
        ..Recipe::default()
    };
    if let Ok(files) = plain.inspect(Path::new(""), &[], &mut watch) {
        check_samples(&suggested_plan(&files).import);
    }
}

/// Imports the samples, which are finite; every row is a sample or is dropped for a reason.
fn check_samples(recipe: &Recipe) {
    if let Ok(recording) = recipe.import(Path::new(""), &mut |_| ControlFlow::Continue(())) {
        let set = &recording.set;
        assert!(
            set.readings()
                .iter()
                .chain(set.targets())
                .all(|number| number.is_finite())
        );
        let dropped: usize = recording.dropped.iter().map(|dropped| dropped.rows).sum();
        assert_eq!(set.samples() + dropped, recording.rows);
    }
}

/// Longest table that is also written as text.
const MAX_CELLS: usize = 2000;

/// Writes the numbers of a table as text with all their digits: they are read back bit by bit.
fn same_as_text(table: &Table, path: &Path) {
    let columns = Vec::from_iter(table.columns.iter().map(|column| match column.faults.count {
        0 => column.numbers.as_slice(),
        _ => &[],
    }));
    if table.rows * columns.len() > MAX_CELLS || columns.iter().any(|numbers| numbers.is_empty()) {
        return;
    }
    let mut text = Vec::from_iter((0..columns.len()).map(|column| format!("x{column}"))).join(",");
    for row in 0..table.rows {
        text.push('\n');
        for (index, numbers) in columns.iter().enumerate() {
            let comma = if index > 0 { "," } else { "" };
            match numbers[row] {
                number if number.is_nan() => write!(text, "{comma}NaN").unwrap(),
                number => write!(text, "{comma}{number:?}").unwrap(),
            }
        }
    }
    text.push('\n');
    let copy = path.with_file_name("copy.csv");
    fs::write(&copy, text).unwrap();
    let choice = DialectChoice {
        separator: Some(Separator::Comma),
        header: Some(true),
        ..DialectChoice::default()
    };
    let read = read_table(&copy, choice, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(read.columns.len(), columns.len());
    for (numbers, column) in columns.iter().zip(&read.columns) {
        let found = &column.numbers;
        let is_same = |(one, other): (&f64, &f64)| one == other || (one.is_nan() && other.is_nan());
        assert!(numbers.iter().zip(found).all(is_same), "{numbers:?} {found:?}");
    }
}

/// Reads the file as positions of the targets of a recording.
fn check_positions(path: &Path, recording: &Path) {
    holds_positions(path);
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let recipe = Recipe {
        data: recording.to_owned(),
        inputs: names(&["u"]),
        targets: names(&["d1", "d2"]),
        positions: Some(path.to_owned()),
        ..Recipe::default()
    };
    if let Ok(read) = recipe.import(Path::new(""), &mut |_| ControlFlow::Continue(())) {
        let at = |place: &TargetPosition| (place.target, place.x_mm.is_finite() && place.y_mm.is_finite());
        let places = Vec::from_iter(read.problem.positions.iter().map(at));
        assert!(
            [
                &[(0, true)][..],
                &[(1, true)],
                &[(0, true), (1, true)],
                &[(1, true), (0, true)]
            ]
            .contains(&&places[..])
        );
        TargetPosition::lattice(&read.problem.positions);
    }
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("recording.csv");
    fs::write(&recording, "u,d1,d2\n1,2,3\n4,5,6\n").unwrap();
    // With its extension, a file without its beginning is still read as a MAT-file.
    let paths = ["data.csv", "data.mat"].map(|name| folder.path().join(name));
    let check_all = |bytes: &[u8]| {
        for path in &paths {
            check(bytes, path);
            check_positions(path, &recording);
        }
    };
    replay!(0, |bytes: &[u8]| {
        check_all(bytes);
        for_each_seed(40, |rng| check_all(&mutated(bytes, rng)));
        0
    });
}
