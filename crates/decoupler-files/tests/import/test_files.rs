//! Separate recordings for testing.

use std::{fs, ops::ControlFlow};

use decoupler_core::dataset::Seed;
use decoupler_files::import::{Plan, Recipe, TestFiles};

#[test]
fn training_rows_are_refused_as_test_rows() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..40).map(|row| format!("{row},{}\n", 2 * row)).collect();
    for name in ["train.csv", "test.csv"] {
        fs::write(folder.path().join(name), format!("u,x\n{rows}")).unwrap();
    }
    fs::create_dir(folder.path().join("sub")).unwrap();
    let tested = |data: &str| {
        let plan = Plan {
            import: Recipe {
                data: "train.csv".into(),
                inputs: vec!["u".to_owned()],
                targets: vec!["x".to_owned()],
                ..Recipe::default()
            },
            test: Some(TestFiles {
                data: data.into(),
                join: Vec::new(),
                append: Vec::new(),
            }),
            ..Plan::default()
        };
        let sets = plan.sets(folder.path(), Seed(0), &mut |_| ControlFlow::Continue(()));
        sets.map(|sets| sets.test.samples()).map_err(|error| error.to_string())
    };
    assert_eq!(tested("test.csv"), Ok(40));
    for same in ["train.csv", "sub/../train.csv"] {
        let reason = tested(same).unwrap_err();
        assert!(
            reason.contains("is trained on, so it cannot be a test file"),
            "{reason}"
        );
    }
}
