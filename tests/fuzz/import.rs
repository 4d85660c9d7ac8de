use std::{fs, ops::ControlFlow, path::Path};

use decoupler_core::evaluation::TargetPosition;
use decoupler_files::import::{Cells, DialectChoice, Inspection, Recipe, holds_positions, read_table};

use crate::{
    corpus::replay,
    mutation::{for_each_seed, mutated},
};

/// Reads `bytes` as a file with the extension of `path`, checks its columns, and makes samples of the first two.
fn check(bytes: &[u8], path: &Path) {
    fs::write(path, bytes).unwrap();
    let mut watch = |_| ControlFlow::Continue(());
    let Ok(table) = read_table(path, DialectChoice::default(), &mut watch) else {
        return;
    };
    // A false header does not allocate memory.
    assert!(table.rows <= 1100 * bytes.len().max(1));
    for column in &table.columns {
        assert_eq!(column.cells.len(), table.rows);
        if let Cells::Numbers(numbers) = &column.cells {
            let gaps = numbers.iter().filter(|number| number.is_nan()).count();
            assert_eq!(gaps, column.missing + column.faults.count);
            assert!(numbers.iter().all(|number| !number.is_infinite()));
        }
    }
    let (inspection, _) = Inspection::read(path, DialectChoice::default(), None, &mut watch).unwrap();
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
    if let Ok(recording) = recipe.import(Path::new(""), &mut watch) {
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
        let places = Vec::from_iter(read.positions.iter().map(at));
        assert!(
            [
                &[(0, true)][..],
                &[(1, true)],
                &[(0, true), (1, true)],
                &[(1, true), (0, true)]
            ]
            .contains(&&places[..])
        );
        TargetPosition::lattice(&read.positions);
    }
}

#[test]
fn any_input() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("recording.csv");
    fs::write(&recording, "u,d1,d2\n1,2,3\n4,5,6\n").unwrap();
    // With its extension, a file without its beginning is still read as a MAT-file.
    let paths = ["data.csv", "data.mat"].map(|name| folder.path().join(name));
    replay!(|bytes: &[u8]| {
        for path in &paths {
            check(bytes, path);
            check_positions(path, &recording);
        }
        for_each_seed(40, |rng| {
            let bytes = mutated(bytes, rng);
            for path in &paths {
                check(&bytes, path);
                check_positions(path, &recording);
            }
        });
    });
}
