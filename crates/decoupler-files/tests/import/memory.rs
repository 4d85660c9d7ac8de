//! A memory in a recipe: features of the past, within stretches, of training and test samples alike.

use std::{fs, ops::ControlFlow, path::Path};

use decoupler_core::dataset::{Memory, Seed, Span};
use decoupler_files::import::{FileSet, Plan, Recipe, Recording};
use tempfile::TempDir;

/// A folder with data.csv: a reading that counts the rows, and a target of which every fifth is missing. Times are in
/// milliseconds, with a gap after half of the rows.
fn folder(rows: usize) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "t (ms),u (V),group,y\n".to_owned();
    for row in 0..rows {
        let time = 20 * row + if row >= rows / 2 { 1000 } else { 0 };
        let target = if row % 5 == 4 {
            String::new()
        } else {
            format!("{}", 3 * row)
        };
        text += &format!("{time},{row},{},{target}\n", usize::from(row >= rows / 4));
    }
    fs::write(folder.path().join("data.csv"), text).unwrap();
    folder
}

fn recipe(memory: Option<Memory>) -> Recipe {
    Recipe {
        data: "data.csv".into(),
        inputs: vec!["u".to_owned()],
        targets: vec!["y".to_owned()],
        time: Some("t".to_owned()),
        memory,
        ..Recipe::default()
    }
}

fn import(recipe: &Recipe, folder: &Path) -> Result<Recording, String> {
    let imported = recipe.import(folder, &mut |_| ControlFlow::Continue(()));
    imported.map_err(|error| error.to_string())
}

#[test]
fn features_come_from_all_readings_and_start_again_after_a_gap() {
    let folder = folder(40);
    let memory = Memory {
        lags: vec![Span::Samples(1.0), Span::Seconds(0.04)],
        averages: vec![Span::Seconds(0.1)],
        ..Memory::default()
    };
    let recording = import(&recipe(Some(memory.clone())), folder.path()).unwrap();
    let titles = Vec::from_iter(recording.problem.features().iter().map(|channel| channel.title()));
    assert_eq!(titles, ["u (V)", "u[-1] (V)", "u[-0.04s] (V)", "u~0.1s (V)"]);
    let problem = &recording.problem;
    assert_eq!((problem.inputs.len(), problem.feature_count()), (1, 4));
    assert!((problem.memory.as_ref().unwrap().interval_s.unwrap() - 0.02).abs() < 1e-12);
    // The rows without a target are no samples, but they are in the past of those after them.
    assert_eq!(recording.set.samples(), 32);
    let weight = 1.0 - f64::exp(-0.2);
    let mut average = 0.0;
    for row in 0..40_usize {
        let (reading, is_first) = (row as f64, row == 0 || row == 20);
        average = if is_first {
            reading
        } else {
            average + weight * (reading - average)
        };
        let first = if row < 20 { 0 } else { 20 };
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
    assert_eq!(plain.set, import(&recipe(None), folder.path()).unwrap().set);
    assert_eq!(plain.with_memory(Some(&memory)).unwrap().set, recording.set);
}

#[test]
fn groups_have_a_past_of_their_own() {
    let folder = folder(40);
    let mut recipe = recipe(Some(Memory {
        lags: vec![Span::Samples(3.0)],
        ..Memory::default()
    }));
    recipe.group = Some("group".to_owned());
    let recording = import(&recipe, folder.path()).unwrap();
    // Row 10 is the first of its group, row 11 the second.
    for (row, expected) in [(8.0, 5.0), (10.0, 10.0), (11.0, 10.0), (13.0, 10.0)] {
        let sample = recording
            .set
            .readings()
            .column(0)
            .iter()
            .position(|&found| found == row)
            .unwrap();
        assert_eq!(recording.set.sample_readings(sample), [row, expected]);
    }
}

#[test]
fn the_state_continues_into_the_test_samples_and_test_files_have_the_intervals_of_training() {
    let folder = folder(40);
    let memory = Memory {
        lags: vec![Span::Seconds(0.04)],
        ..Memory::default()
    };
    let mut plan = Plan {
        import: recipe(Some(memory)),
        ..Plan::default()
    };
    let tested = |plan: &Plan| {
        let (recording, test) = plan
            .recordings(folder.path(), &mut |_| ControlFlow::Continue(()))
            .unwrap();
        plan.divide(&recording, test.as_ref(), Seed(0)).unwrap().1
    };
    let test = tested(&plan);
    let first = test.sample_readings(0);
    assert_eq!(first[1], first[0] - 2.0);
    // Twice as slow: a lag of 0.04 s would be one sample of this file.
    let slow = (0..10)
        .map(|row| format!("{},{row},0,1\n", 40 * row))
        .collect::<String>();
    fs::write(folder.path().join("slow.csv"), format!("t (ms),u (V),group,y\n{slow}")).unwrap();
    plan.test = Some(FileSet {
        data: "slow.csv".into(),
        ..FileSet::default()
    });
    assert_eq!(tested(&plan).sample_readings(5), [5.0, 3.0]);
}

#[test]
fn a_memory_in_seconds_needs_times_in_a_unit_of_time() {
    let folder = folder(40);
    let mut without = recipe(Some(Memory {
        averages: vec![Span::Seconds(2.0)],
        ..Memory::default()
    }));
    without.time = None;
    assert!(
        import(&without, folder.path())
            .unwrap_err()
            .contains("name the time column")
    );
    without.memory = Some(Memory {
        averages: vec![Span::Samples(20.0)],
        ..Memory::default()
    });
    assert_eq!(import(&without, folder.path()).unwrap().set.channels(), 2);
    let mut strange = recipe(Some(Memory {
        averages: vec![Span::Seconds(2.0)],
        ..Memory::default()
    }));
    strange.units.insert("t".to_owned(), "V".to_owned());
    assert!(
        import(&strange, folder.path())
            .unwrap_err()
            .contains("times in 't' are in V")
    );
}
